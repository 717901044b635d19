"""The records that pass between the stages of a replay: a frame in, a step out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scpf.models.association import Match
from scpf.models.instances import Image, Instance
from scpf.models.observation import Observation
from scpf.models.particle_filter import Belief, State
from scpf.models.trajectory import yaw_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera frame of a drive log with what else is known at its time.

    ``image`` (H, W, 3) RGB is None where the segmenter reads no pixels; ``encoded`` are the file's own bytes.
    ``T_map_body`` (4, 4) is the reference pose at the exposure, ``gps_m`` (2,) the rough position; either may be
    missing. ``dt_s`` is the interval since the frame before, never negative. ``recorded`` are the instances that the
    log itself holds for this frame. ``problems`` say what was wrong with it: kind, and the particulars.
    """

    index: int
    stamp_ns: int
    encoded: bytes | memoryview
    image_format: str
    image: Image | None
    dt_s: float
    T_map_body: Array | None
    gps_m: Array | None
    gps_variance_m2: float
    recorded: tuple[Instance, ...] = ()
    problems: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False)
class SurfaceTerm:
    """One constraint over the grid of a surface: log Pr(γ ≥ C) (R, C), and what the ``label`` beside it says."""

    label: str
    log_probability: Array


@dataclass(frozen=True, eq=False)
class Surface:
    """Constraint values over a grid of positions at the estimated velocity.

    ``violation`` (R, C): the paper's Σ max(C, 0); ``log_probability`` (R, C): Σ log Pr. Row 0 is the southernmost,
    column 0 the westernmost; ``corner_m`` (2,) is the centre of cell (0, 0), in map; ``cell_m`` its side. ``terms``:
    each constraint by itself, where that was asked for.
    """

    corner_m: Array
    cell_m: float
    violation: Array
    log_probability: Array
    terms: Mapping[str, SurfaceTerm] = field(default_factory=dict)


@dataclass(frozen=True)
class Errors:
    """Position error against the reference (m): total, along and to the left of the reference heading."""

    position_m: float
    longitudinal_m: float
    lateral_m: float

    @staticmethod
    def of(belief: Belief, frame: Frame) -> Errors | None:
        """Those of a belief's mean; None where the frame has no reference pose."""
        if frame.T_map_body is None:
            return None
        off = belief.mean[:2] - frame.T_map_body[:2, 3]
        yaw = yaw_of(frame.T_map_body)
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        left = np.array([-ahead[1], ahead[0]])
        return Errors(float(np.hypot(*off)), float(off @ ahead), float(off @ left))


@dataclass(frozen=True, eq=False)
class Step:
    """Everything that one frame led to; what recording and results are written from.

    ``observations``, ``matches``, ``true_distances_m`` and ``true_landmark_ids`` run in parallel; the last two come
    from the reference pose and the map (None and "" where they do not say). ``unmeasured`` are instances without a
    distance. ``baseline`` is the unconstrained particle filter's belief. ``belief``, ``baseline`` and ``surface`` are
    None as long as nothing has said where the vehicle is. ``timing_s`` names each stage. ``notes`` are (level, text)
    for the log lane; level as in logging.
    """

    frame: Frame
    observations: tuple[Observation, ...]
    matches: tuple[Match, ...]
    true_distances_m: tuple[float | None, ...]
    belief: Belief | None
    baseline: Belief | None
    surface: Surface | None
    errors: Errors | None
    baseline_errors: Errors | None
    timing_s: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[tuple[str, str], ...] = ()
    unmeasured: tuple[Instance, ...] = ()
    true_landmark_ids: tuple[str, ...] = ()

    @property
    def state(self) -> State:
        """What the state lane reads: the belief's state, *initialising* before there is one."""
        return "initialising" if self.belief is None else self.belief.state
