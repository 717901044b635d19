"""The paper's constraint surface at one frame of a drive: the sum of violations and the joint log-probability."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.models.constraint_surface import surfaces
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
)
from scpf.replay.protocol import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CELLS: Final = 121
HALF_WIDTH_M: Final = 15.0
DEEPEST: Final = -40.0
"""Log-probabilities below are drawn as this: what is impossible has no shape worth showing."""


class DrawnSurface(NamedTuple):
    """A grid around the true position, ``offsets_m`` (C,) east and north of it, at the true velocity.

    ``violation`` and ``log_probability`` (C, C), row 0 the southernmost; ``landmarks_m`` (L, 2) the poles seen,
    relative to the truth.
    """

    frame: int
    offsets_m: Array
    violation: Array
    log_probability: Array
    landmarks_m: Array


def surface_at(scenario: Scenario, frame: int | None = None) -> DrawnSurface:
    """Road, speed and landmark constraints of a frame; by default of one that sees most poles.

    Detections are matched as they truly were; those whose landmark is not known are left out.
    """
    known = [sum(seen.landmark >= 0 for seen in detections) for detections in scenario.detections]
    if frame is None:
        most = np.flatnonzero(np.array(known) == max(known))
        frame = int(most[len(most) // 2])
    truth, velocity = scenario.drive.positions_m[frame], scenario.drive.velocities_mps[frame]
    marks = scenario.road_map.positions_m
    constraints: list[Constraint] = [SpeedConstraint()]
    segment = scenario.road_map.segment_near(truth)
    if segment is not None:
        constraints.append(RoadConstraint(segment, scenario.road_map.half_width_m))
    seen = [one for one in scenario.detections[frame] if one.landmark >= 0]
    for one in seen:
        position = marks[one.landmark]
        constraints.append(LandmarkConstraint(str(one.landmark), position, one.distance_m, one.variance_m2))
    offsets = np.linspace(-HALF_WIDTH_M, HALF_WIDTH_M, CELLS)
    state = np.concatenate([truth, velocity])
    landmarks = marks[[one.landmark for one in seen]] - truth
    violation, log_probability = surfaces(constraints, state, truth[0] + offsets, truth[1] + offsets)
    return DrawnSurface(frame, offsets, violation, log_probability, landmarks)


def surface_2d(figure: Figure, scenario: Scenario) -> None:
    """Both surfaces from above, with the truth and the poles that lie inside."""
    surface = surface_at(scenario)
    figure.set_size_inches(10.0, 4.8)
    left, right = figure.subplots(1, 2, sharey=True)
    drawn = (
        (left, surface.violation, "viridis_r", "sum of violations, Σ max(C, 0)"),
        (right, np.maximum(surface.log_probability, DEEPEST), "viridis", "joint log-probability"),
    )
    for axes, values, colours, title in drawn:
        filled = axes.contourf(surface.offsets_m, surface.offsets_m, values, 24, cmap=colours)
        figure.colorbar(filled, ax=axes)
        axes.plot(0.0, 0.0, "+", color="white", markersize=12, markeredgewidth=2)
        inside = np.abs(surface.landmarks_m).max(axis=1, initial=0.0) <= HALF_WIDTH_M
        axes.plot(*surface.landmarks_m[inside].T, "^", color="#d55e00", markeredgecolor="white")
        axes.set(title=title, xlabel="east of the truth (m)", aspect="equal")
    left.set_ylabel("north of the truth (m)")
    figure.suptitle(_about(scenario, surface))


def surface_3d(figure: Figure, scenario: Scenario) -> None:
    """The sum of violations as a landscape, the joint log-probability beside it."""
    surface = surface_at(scenario)
    figure.set_size_inches(11.0, 5.2)
    east, north = np.meshgrid(surface.offsets_m, surface.offsets_m)
    drawn = (
        (surface.violation, "viridis_r", "sum of violations, Σ max(C, 0)"),
        (np.maximum(surface.log_probability, DEEPEST), "viridis", "joint log-probability"),
    )
    for place, (values, colours, title) in enumerate(drawn, start=1):
        axes = figure.add_subplot(1, 2, place, projection="3d")
        axes.plot_surface(
            east, north, values, cmap=colours, rcount=60, ccount=60, linewidth=0, antialiased=True
        )
        axes.set(title=title, xlabel="east (m)", ylabel="north (m)")
    figure.suptitle(_about(scenario, surface))


def _about(scenario: Scenario, surface: DrawnSurface) -> str:
    poles = len(surface.landmarks_m)
    time_s = scenario.times_s[surface.frame]
    return f"{scenario.case.name}: constraints {time_s:.1f} s after the start, {poles} poles in sight"
