"""What the evaluation compares: the estimators' settings, one frozen record each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from scpf.models.consider import ConsiderSettings
from scpf.models.errors import UsageError
from scpf.models.lasting_errors import LastingTempering

MotionName = Literal["constant-velocity", "constant-turn-rate"]


@dataclass(frozen=True)
class Estimator:
    """An estimator's settings.

    ``kind``: particle filter or extended Kalman filter. ``q_m2ps3``: density of the acceleration noise, along the
    path where the turn rate is constant. ``landmarks``, ``road``, ``speed``: which soft constraints it has.
    ``bearing_deviation_rad``: None leaves bearings out. ``heading_deviation_rad``: of the road-heading constraint,
    None for none. ``tempering``: exponent of the landmark constraints, always the same or as errors last.
    ``landmark_variance_m2`` is added to every
    range variance; ``landmark_deviation_m`` across the line of sight widens bearings. ``floor``: ε of the matching
    by every particle for itself, used where ``per_particle`` and matching is unknown. ``consider``: what lasts of the
    errors is found out, and the covariance tells of it; None for that of the particles. In a particle filter
    bearings, heading and ``consider`` need states with a heading: a constant turn rate.
    ``velocity_doubt``: how many times wider than stated the first velocities are drawn.
    """

    name: str
    kind: Literal["particles", "kalman"] = "particles"
    motion: MotionName = "constant-velocity"
    q_m2ps3: float = 11.0
    q_turn_rad2ps3: float = 0.01
    landmarks: bool = True
    road: bool = True
    speed: bool = True
    bearing_deviation_rad: float | None = None
    heading_deviation_rad: float | None = None
    tempering: float | LastingTempering = 1.0
    landmark_variance_m2: float = 0.0
    landmark_deviation_m: float = 0.0
    per_particle: bool = False
    consider: ConsiderSettings | None = None
    velocity_doubt: float = 1.0
    floor: float = 0.001
    particles: int = 500
    resample_below: float = 1.0


PRESETS: Final = {
    "paper": Estimator("paper"),
    "pf": Estimator("pf", q_m2ps3=4.0, landmarks=False, road=False, speed=False),
    "ekf": Estimator(
        "ekf",
        kind="kalman",
        q_m2ps3=1.0,
        road=False,
        speed=False,
        bearing_deviation_rad=float(np.radians(3.0)),
    ),
    "default": Estimator(
        "default",
        motion="constant-turn-rate",
        q_m2ps3=1.0,
        q_turn_rad2ps3=0.003,
        bearing_deviation_rad=float(np.radians(3.0)),
        heading_deviation_rad=float(np.radians(7.0)),
        tempering=LastingTempering(),
        per_particle=True,
        consider=ConsiderSettings(),
        velocity_doubt=2.0,
    ),
}
"""``paper``: the soft-constrained filter as published. ``pf``: the same without constraints. ``ekf``: range, bearing
and fixes in an extended Kalman filter. ``default``: the best of this project, one setting for all cases."""


def estimator(name: str, **changes: object) -> Estimator:
    """A preset's settings, with ``changes``; UsageError where there is none of that name."""
    if name not in PRESETS:
        raise UsageError(f"no preset {name!r} to evaluate", f"presets: {', '.join(PRESETS)}")
    return replace(PRESETS[name], **changes)  # type: ignore[arg-type]
