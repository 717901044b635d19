"""The settings of a replay, in one place: frozen, and saved with every result."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Final, Literal

import numpy as np

from scpf.models.association import NearestNeighbour
from scpf.models.consider import ConsiderSettings
from scpf.models.devices import DeviceName
from scpf.models.errors import UsageError
from scpf.models.lasting_errors import LastingTempering
from scpf.models.maskrcnn_conventions import CheckpointSettings
from scpf.models.particle_filter import FilterSettings

GpsSource = Literal["auto", "log", "emulated", "none"]


@dataclass(frozen=True)
class ConstraintSettings:
    """Slack and limits of the soft constraints; the defaults are the paper's."""

    road_slack_mean_m: float = 0.25
    speed_limit_mps: float = 12.0
    speed_slack_mean_mps: float = 1.0
    landmarks: bool = True
    road: bool = True
    speed: bool = True


@dataclass(frozen=True)
class GpsSettings:
    """The rough GPS: the log's own, or the reference disturbed by white noise of ``sigma_m`` a axis, or none.

    ``auto`` takes the log's own where it has one, else emulates it. ``outages_s``: intervals (from, until) without a
    fix, in seconds after the log's first image.
    """

    source: GpsSource = "auto"
    sigma_m: float = 3.0
    outages_s: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class HeadingSettings:
    """Beyond the paper: a heading of its own, bearings against it, and matching by every particle for itself.

    ``q_turn_rad2ps3``: noise density of the turn rate. ``bearing_deviation_rad`` weighs bearings,
    ``road_deviation_rad`` the road's direction. ``tempering``: exponent of the landmarks' log-probability, as far as
    errors last, which ``consider`` finds out. ``floor``: ε for "none of the mapped landmarks". ``initial_variance`` of
    heading and turn rate; first velocities are drawn ``velocity_doubt`` times as wide as the filter's variances say.
    """

    q_turn_rad2ps3: float = 0.003
    bearing_deviation_rad: float = float(np.radians(3.0))
    road_deviation_rad: float = float(np.radians(7.0))
    floor: float = 0.001
    initial_variance: tuple[float, float] = (0.2**2, 0.05**2)
    velocity_doubt: float = 2.0
    tempering: LastingTempering = field(default_factory=LastingTempering)
    consider: ConsiderSettings = field(default_factory=ConsiderSettings)


@dataclass(frozen=True)
class KalmanSettings:
    """The baseline that a practitioner would try: range and bearing of matched landmarks, and no soft constraint.

    ``bearing_deviation_rad`` covers the bearing's error and how far the vehicle turns away from the road.
    """

    bearing_deviation_rad: float = float(np.radians(3.0))


@dataclass(frozen=True)
class SurfaceSettings:
    """The grid on which the constraint surface is recorded, centred on the estimate.

    ``terms``: each constraint by itself as well.
    """

    cells: int = 81
    cell_m: float = 0.5
    terms: bool = False


@dataclass(frozen=True)
class Settings:
    """What a replay runs with.

    ``q_m2ps3`` is the motion noise of the scPF, ``baseline_q_m2ps3`` that of the PF beside it. ``heading`` None is the
    paper's filter. ``kalman``: an extended Kalman filter in place of the particles.
    """

    preset: str = "paper"
    segmenter: str = "polenet"
    score_threshold: float = 0.9
    bfloat16: bool = False
    device: DeviceName = "cpu"
    checkpoint: CheckpointSettings = field(default_factory=CheckpointSettings)
    distance_model: str = "default"
    seed: int = 0
    q_m2ps3: float = 11.0
    baseline_q_m2ps3: float = 4.0
    filter: FilterSettings = field(default_factory=FilterSettings)
    constraints: ConstraintSettings = field(default_factory=ConstraintSettings)
    matching: NearestNeighbour = field(default_factory=NearestNeighbour)
    heading: HeadingSettings | None = None
    kalman: KalmanSettings | None = None
    gps: GpsSettings = field(default_factory=GpsSettings)
    surface: SurfaceSettings = field(default_factory=SurfaceSettings)

    def as_dict(self) -> dict[str, Any]:
        """The settings as plain values, for JSON."""
        return asdict(self)


PRESETS: Final[dict[str, Settings]] = {
    "paper": Settings(),
    "default": Settings(preset="default", q_m2ps3=1.0, heading=HeadingSettings()),
    "pf": Settings(
        preset="pf",
        q_m2ps3=4.0,
        constraints=ConstraintSettings(landmarks=False, road=False, speed=False),
    ),
    "ekf": Settings(
        preset="ekf",
        q_m2ps3=1.0,
        constraints=ConstraintSettings(road=False, speed=False),
        kalman=KalmanSettings(),
    ),
}
"""``paper``: the paper's scPF. ``default``: the best of this project, see docs/EVALUATION.md. ``pf``: the paper's
filter without any constraint, with its motion noise for it. ``ekf``: an extended Kalman filter of range and bearing."""


def preset(name: str) -> Settings:
    """The settings of a preset; UsageError where there is none of that name."""
    if name not in PRESETS:
        raise UsageError(f"no preset {name!r}", f"presets: {', '.join(PRESETS)}")
    return PRESETS[name]


def check(settings: Settings) -> None:
    """Raise UsageError where a number lies outside of what it can mean."""
    rules = (
        ("gps.sigma_m", settings.gps.sigma_m, 1e-3, 1e4),
        ("score_threshold", settings.score_threshold, 0.0, 1.0),
        ("filter.particles", settings.filter.particles, 1, 1_000_000),
        ("q_m2ps3", settings.q_m2ps3, 0.0, 1e6),
        ("baseline_q_m2ps3", settings.baseline_q_m2ps3, 0.0, 1e6),
        ("constraints.road_slack_mean_m", settings.constraints.road_slack_mean_m, 1e-6, 1e6),
        ("constraints.speed_slack_mean_mps", settings.constraints.speed_slack_mean_mps, 1e-6, 1e6),
        ("surface.cells", settings.surface.cells, 2, 2000),
        ("surface.cell_m", settings.surface.cell_m, 1e-3, 1e3),
        ("seed", settings.seed, 0, 2**63 - 1),
    )
    for name, value, low, high in rules:
        if not low <= value <= high:
            raise UsageError(f"{name} = {value:g}", f"it has to lie between {low:g} and {high:g}")
    for begin, end in settings.gps.outages_s:
        if not begin < end:
            raise UsageError(f"a GPS outage from {begin:g} to {end:g}", "its end comes after its begin")
    if len(settings.filter.initial_variance) != 4 or min(settings.filter.initial_variance) < 0.0:
        raise UsageError("filter.initial_variance", "four variances: x, y, vx, vy")
