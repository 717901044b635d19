"""The fast surface is what the constraints themselves say of every place."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.bearing_constraint import BearingConstraint, HeadingConstraint
from scpf.models.constraint_surface import surfaces
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    log_probability,
    total_violation,
)
from scpf.models.matched_landmarks import MatchedLandmarks, Sighting
from scpf.models.road_map import RoadSegment
from scpf.models.slack import Slackened, Tempered

MARKS = np.array([[520.0, -306.0], [535.0, -294.0], [548.0, -306.5]])
ROAD = RoadConstraint(RoadSegment(np.array([510.0, -300.0]), np.array([0.0, 0.1, 1e-3, 1e-5]), False))
RING = LandmarkConstraint("a", MARKS[0], 21.0, 0.6)
SEEN = [Sighting(21.0, 0.8, -0.3, 0.05), Sighting(40.0, 1.2, 0.1, 0.05)]
MATCHED = MatchedLandmarks(MARKS, SEEN, 0.001, 0.3, np.array([0.2, 0.0, 1.0]))
OTHERS = [
    BearingConstraint("a", MARKS[0], -0.3, 0.05),
    Tempered(RING, 0.2),
    Slackened(SpeedConstraint(), 2.0),
]
EACH: list[list[Constraint]] = [
    [],
    [ROAD],
    [SpeedConstraint()],
    [HeadingConstraint(0.3)],
    [RING],
    [MATCHED],
    [*OTHERS],
    [ROAD, SpeedConstraint(), HeadingConstraint(0.3), RING, MATCHED],
]


@pytest.mark.parametrize("constraints", EACH, ids=range(len(EACH)))
def test_it_is_what_the_constraints_say(constraints: list[Constraint]) -> None:
    state = np.array([7.0, 8.0, 13.0, 2.0, 0.2, 0.0])  # its position does not matter
    east, north = np.linspace(480.0, 520.0, 47), np.linspace(-320.0, -285.0, 33)
    violation, joint = surfaces(constraints, state, east, north)
    assert violation.shape == joint.shape == (33, 47)
    for row, column in ((0, 0), (5, 40), (32, 46), (16, 20)):
        here = np.concatenate([[east[column], north[row]], state[2:]])[None]
        assert violation[row, column] == pytest.approx(total_violation(constraints, here)[0], abs=2e-4)
        expected = log_probability(constraints, here)[0]
        assert joint[row, column] == pytest.approx(expected, rel=1e-5, abs=2e-4)
    assert (violation >= 0.0).all()
    assert (joint <= 0.0).all()
