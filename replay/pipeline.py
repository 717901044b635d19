"""The pipeline: Algorithm 1 of the paper, a frame at a time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from scpf.models.association import Match
from scpf.models.camera import Camera
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    log_probability,
    total_violation,
)
from scpf.models.instances import Instance
from scpf.models.labelling import Label, label
from scpf.models.motion import ConstantVelocity
from scpf.models.observation import Distance, Observation
from scpf.models.particle_filter import Belief, ParticleFilter, PositionFix
from scpf.models.road_map import RoadMap
from scpf.models.trajectory import yaw_of
from scpf.replay.settings import Settings
from scpf.replay.step import Errors, Frame, Step, Surface

Array = NDArray[np.float64]
Segment = Callable[[Frame], Sequence[Instance]]


class DistancePredictor(Protocol):
    """Anything that predicts the distance of each instance; None for one that it cannot measure."""

    def predict(
        self, instances: Sequence[Instance], image_width_px: int, image_height_px: int
    ) -> list[Distance | None]:
        """The instances' distances, in their order."""
        ...


class DistanceSource(Protocol):
    """What has a predictor for every frame: one model for all of them, or several, each for its stretch."""

    def for_frame(self, stamp_ns: int) -> DistancePredictor:
        """The predictor to use at that time."""
        ...


class Pipeline:
    """The stages of a replay, wired. The scPF and the unconstrained PF run side by side on the same fixes.

    Without a camera or a distance model nothing is measured; without a map nothing constrains.
    """

    def __init__(
        self,
        settings: Settings,
        segment: Segment,
        distance_model: DistanceSource | None,
        camera: Camera | None,
        road_map: RoadMap | None,
    ) -> None:
        self.settings = settings
        self._segment = segment
        self._distance_model = distance_model
        self._camera = camera
        self._map = road_map if road_map is not None else RoadMap((), np.zeros((0, 2)))
        self._filter, self._baseline = (
            ParticleFilter(
                ConstantVelocity(q), settings.filter, np.random.default_rng([settings.seed, 2, stream])
            )
            for stream, q in enumerate((settings.q_m2ps3, settings.baseline_q_m2ps3))
        )
        self._belief: Belief | None = None

    def start(self, mean: Array) -> None:
        """Draw both filters' first particles around the state ``mean`` (4,)."""
        self._belief = self._filter.initialise(mean)
        self._baseline.initialise(mean)

    def step(self, frame: Frame) -> Step:
        """Everything that one frame leads to."""
        timing: dict[str, float] = {}
        with _timed(timing, "segmentation"):
            instances = self._segment(frame)
        with _timed(timing, "distance"):
            observations, unmeasured = self._observe(instances, frame.stamp_ns)
        with _timed(timing, "filter"):
            predicted = self._filter.predict(frame.dt_s)
            self._baseline.predict(frame.dt_s)
            matches = self._match(observations, predicted)
            constraints = self._constraints(observations, matches, predicted)
            fix = None if frame.gps_m is None else PositionFix(frame.gps_m, frame.gps_variance_m2)
            belief = self._filter.update(constraints, fix)
            baseline = self._baseline.update([], fix)
        with _timed(timing, "surface"):
            surface = self._surface(constraints, belief)
        self._belief = belief
        truths = self._truths(observations, frame)
        return Step(
            frame=frame,
            observations=tuple(observations),
            unmeasured=tuple(unmeasured),
            matches=tuple(matches),
            true_distances_m=tuple(truth.distance_m for truth in truths),
            true_landmark_ids=tuple(truth.landmark_id for truth in truths),
            belief=belief,
            baseline=baseline,
            surface=surface,
            errors=_errors(belief, frame),
            baseline_errors=_errors(baseline, frame),
            timing_s=timing,
        )

    def _observe(
        self, instances: Sequence[Instance], stamp_ns: int
    ) -> tuple[list[Observation], list[Instance]]:
        """Range and bearing of each instance; the instances that cannot be measured apart."""
        camera, model = self._camera, self._distance_model
        if camera is None or model is None or not instances:
            return [], list(instances)
        distances = model.for_frame(stamp_ns).predict(instances, camera.width_px, camera.height_px)
        bearings = camera.bearings(np.array([foot_px(instance) for instance in instances]))
        observations, unmeasured = [], []
        for instance, distance, bearing in zip(instances, distances, bearings, strict=True):
            if distance is None:
                unmeasured.append(instance)
            else:
                observations.append(Observation(instance, distance, float(bearing)))
        return observations, unmeasured

    def _match(self, observations: Sequence[Observation], predicted: Array) -> list[Match]:
        """The landmark of each observation, sought around the predicted state."""
        if self._belief is None:
            raise RuntimeError("start() comes first")
        yaw = self._map.direction_near(predicted[:2], predicted[2:4])
        if yaw is None:
            yaw = float(np.arctan2(predicted[3], predicted[2]))
        return self.settings.matching.match(
            observations, self._map, predicted[:2], self._belief.covariance[:2, :2], yaw
        )

    def _constraints(
        self, observations: Sequence[Observation], matches: Sequence[Match], predicted: Array
    ) -> list[Constraint]:
        """The soft constraints of this step: road, speed, and one a matched landmark."""
        wanted = self.settings.constraints
        constraints: list[Constraint] = []
        segment = self._map.segment_near(predicted[:2]) if wanted.road else None
        if segment is not None:
            constraints.append(RoadConstraint(segment, self._map.half_width_m, wanted.road_slack_mean_m))
        if wanted.speed:
            constraints.append(SpeedConstraint(wanted.speed_limit_mps, wanted.speed_slack_mean_mps))
        for observation, match in zip(observations, matches, strict=True):
            mark = self._map.landmark(match.landmark_id) if wanted.landmarks else None
            if mark is not None:
                distance = observation.distance
                variance_m2 = distance.variance_m2 + mark.variance_m2
                position_m = np.array(mark.position_m[:2])
                constraints.append(LandmarkConstraint(mark.id, position_m, distance.mean_m, variance_m2))
        return constraints

    def _surface(self, constraints: Sequence[Constraint], belief: Belief) -> Surface:
        """The constraints' values on a grid about the estimate, at the estimated velocity."""
        grid = self.settings.surface
        # Cells lie on multiples of their size, so that the surface does not shimmer from frame to frame.
        corner_m = np.round(belief.mean[:2] / grid.cell_m - (grid.cells - 1) / 2) * grid.cell_m
        steps = np.arange(grid.cells) * grid.cell_m
        east, north = np.meshgrid(corner_m[0] + steps, corner_m[1] + steps)
        states = np.tile(belief.mean, (grid.cells**2, 1))
        states[:, 0], states[:, 1] = east.ravel(), north.ravel()
        shape = (grid.cells, grid.cells)
        return Surface(
            corner_m,
            grid.cell_m,
            total_violation(constraints, states).reshape(shape),
            log_probability(constraints, states).reshape(shape),
        )

    def _truths(self, observations: Sequence[Observation], frame: Frame) -> list[Label]:
        """The landmark that each observation really shows, from the reference pose and the map."""
        if frame.T_map_body is None or self._camera is None or not self._map.landmarks:
            return [Label("", None, "no reference")] * len(observations)
        return label([o.instance for o in observations], self._camera, frame.T_map_body, self._map)


def foot_px(instance: Instance) -> tuple[float, float]:
    """The pixel (x, y) where the pole stands: the middle of the mask's lowest tenth of rows.

    Lower than an arm or a lamp can reach, and, for an upright pole, at the bearing of its axis.
    """
    rows = max(1, instance.mask.shape[0] // 10)
    low = instance.mask[-rows:]
    columns = np.flatnonzero(low.any(0))
    x = 0.5 * (columns[0] + columns[-1]) if len(columns) else (instance.mask.shape[1] - 1) / 2
    return instance.offset_px[0] + float(x), instance.offset_px[1] + instance.mask.shape[0] - 1.0


def _errors(belief: Belief, frame: Frame) -> Errors | None:
    """Position error of a belief's mean against the frame's reference pose."""
    if frame.T_map_body is None:
        return None
    off = belief.mean[:2] - frame.T_map_body[:2, 3]
    yaw = yaw_of(frame.T_map_body)
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    left = np.array([-ahead[1], ahead[0]])
    return Errors(float(np.hypot(*off)), float(off @ ahead), float(off @ left))


@contextmanager
def _timed(timing: dict[str, float], stage: str) -> Iterator[None]:
    """Add the seconds that the block took to ``timing[stage]``."""
    begun = time.perf_counter()
    yield
    timing[stage] = timing.get(stage, 0.0) + time.perf_counter() - begun
