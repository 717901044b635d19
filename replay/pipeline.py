"""The pipeline: Algorithm 1 of the paper, a frame at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from scpf.models.association import Match
from scpf.models.camera import Camera
from scpf.models.constraints import Constraint
from scpf.models.instances import Instance, foot_px
from scpf.models.labelling import Label, label
from scpf.models.motion import ConstantTurnRate, ConstantVelocity, turn_rate_state
from scpf.models.observation import Distance, Observation
from scpf.models.particle_filter import Belief, ParticleFilter, PositionFix
from scpf.models.road_map import RoadMap
from scpf.replay.kalman_tracker import KalmanTracker
from scpf.replay.lasting_tracker import LastingTracker
from scpf.replay.settings import Settings
from scpf.replay.soft_constraints import soft_constraints
from scpf.replay.stages import Stages
from scpf.replay.step import Errors, Frame, Step, Surface
from scpf.replay.surface import constraint_surface
from scpf.replay.surface_terms import surface_terms

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

    @property
    def landmark_classes(self) -> frozenset[str]:
        """The classes whose distance it knows."""
        ...

    def for_frame(self, stamp_ns: int) -> DistancePredictor:
        """The predictor to use at that time."""
        ...


class Tracker(Protocol):
    """Anything that follows the vehicle: `ParticleFilter`, or what takes its place."""

    @property
    def exponent(self) -> float:
        """The tempering of the landmarks' constraints in the next step; 1 takes them at their word."""
        ...

    def initialise(self, mean: Array) -> Belief:
        """Begin around the state ``mean``."""
        ...

    def predict(self, dt_s: float) -> Array:
        """Move on by ``dt_s``; the predicted mean."""
        ...

    def update(self, constraints: Sequence[Constraint], fix: PositionFix | None = None) -> Belief:
        """Take in what was observed."""
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
        streams = [np.random.default_rng([settings.seed, 2, stream]) for stream in (0, 1)]
        velocity = ConstantVelocity(settings.q_m2ps3)
        self._filter: Tracker
        if settings.kalman is not None:
            self._filter = KalmanTracker(velocity, settings.filter, streams[0])
        elif settings.heading is not None:
            turning = ConstantTurnRate(settings.q_m2ps3, settings.heading.q_turn_rad2ps3)
            around = (settings.filter, self._map, streams[0])
            self._filter = LastingTracker(settings.heading, turning, *around)
        else:
            self._filter = ParticleFilter(velocity, settings.filter, streams[0])
        self._baseline = ParticleFilter(
            ConstantVelocity(settings.baseline_q_m2ps3), settings.filter, streams[1]
        )
        self._belief: Belief | None = None
        self._just_started = False

    def start(self, mean: Array) -> None:
        """Draw both filters' first particles around the state ``mean`` [x, y, vx, vy] at the next frame's time."""
        first = mean
        if self.settings.heading is not None:
            first = turn_rate_state(mean[:2], mean[2:4], self._yaw(mean))
        self._belief = self._filter.initialise(first)
        self._baseline.initialise(mean)
        self._just_started = True

    @property
    def started(self) -> bool:
        """Whether there is a belief. Before, a step segments and measures, and estimates nothing."""
        return self._belief is not None

    def step(self, frame: Frame) -> Step:
        """Everything that one frame leads to."""
        stages = Stages()
        with stages.timed("segmentation"):
            instances = self._segment(frame)
        with stages.timed("distance"):
            observations, unmeasured = stages.attempt(
                "distance", lambda: self._observe(instances, frame.stamp_ns), lambda: ([], list(instances))
            )
        if self._belief is None:
            return self._unlocated(stages.told(frame), observations, unmeasured, stages.timing_s)
        with stages.timed("filter"):
            dt_s = 0.0 if self._just_started else frame.dt_s
            predicted = self._filter.predict(dt_s)
            self._baseline.predict(dt_s)
            matches, constraints = stages.attempt(
                "matching",
                lambda: self._constrain(observations, predicted),
                lambda: ([Match("", "matching failed")] * len(observations), []),
            )
            fix = None if frame.gps_m is None else PositionFix(frame.gps_m, frame.gps_variance_m2)
            belief = stages.attempt(
                "filter", lambda: self._filter.update(constraints, fix), lambda: self._filter.update([], fix)
            )
            baseline = self._baseline.update([], fix)
        with stages.timed("surface"):
            surface = stages.attempt(
                "constraint surface",
                lambda: self._surface(constraints, fix, belief.mean),
                lambda: self._surface([], None, belief.mean),
            )
        self._belief, self._just_started = belief, False
        truths = self._truths(observations, frame)
        return Step(
            frame=stages.told(frame),
            observations=tuple(observations),
            unmeasured=tuple(unmeasured),
            matches=tuple(matches),
            true_distances_m=tuple(truth.distance_m for truth in truths),
            true_landmark_ids=tuple(truth.landmark_id for truth in truths),
            belief=belief,
            baseline=baseline,
            surface=surface,
            errors=Errors.of(belief, frame),
            baseline_errors=Errors.of(baseline, frame),
            timing_s=stages.timing_s,
        )

    def _unlocated(
        self,
        frame: Frame,
        observations: Sequence[Observation],
        unmeasured: Sequence[Instance],
        timing: dict[str, float],
    ) -> Step:
        """The step of a frame before anything has said where the vehicle is."""
        unknown = Match("", "position not known yet")
        return Step(
            frame=frame,
            observations=tuple(observations),
            unmeasured=tuple(unmeasured),
            matches=(unknown,) * len(observations),
            true_distances_m=(None,) * len(observations),
            true_landmark_ids=("",) * len(observations),
            belief=None,
            baseline=None,
            surface=None,
            errors=None,
            baseline_errors=None,
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

    def _constrain(
        self, observations: Sequence[Observation], predicted: Array
    ) -> tuple[list[Match], list[Constraint]]:
        """The landmark of each observation, sought around the predicted state, and the constraints about it."""
        if self._belief is None:
            raise RuntimeError("start() comes first")
        yaw, exponent = self._yaw(predicted), self._filter.exponent
        around = self._belief.covariance[:2, :2]
        matches = self.settings.matching.match(observations, self._map, predicted[:2], around, yaw)
        return matches, soft_constraints(
            self.settings, self._map, observations, matches, predicted, yaw, exponent
        )

    def _surface(self, constraints: Sequence[Constraint], fix: PositionFix | None, mean: Array) -> Surface:
        """The constraint surface around the ``mean`` state, with each constraint by itself where that is asked for."""
        surface = constraint_surface(constraints, mean, self.settings.surface)
        if not self.settings.surface.terms:
            return surface
        return replace(surface, terms=surface_terms(constraints, fix, mean, surface))

    def _yaw(self, state: Array) -> float:
        """A state's own heading (rad); where it has none, the road's near it, else that of its velocity."""
        if len(state) > 4:
            return float(state[4])
        yaw = self._map.direction_near(state[:2], state[2:4])
        return float(np.arctan2(state[3], state[2])) if yaw is None else yaw

    def _truths(self, observations: Sequence[Observation], frame: Frame) -> list[Label]:
        """The landmark that each observation really shows, from the reference pose and the map."""
        if frame.T_map_body is None or self._camera is None or not self._map.landmarks:
            return [Label("", None, "no reference")] * len(observations)
        return label([o.instance for o in observations], self._camera, frame.T_map_body, self._map)
