"""Monte Carlo runs of the compiled particle filter, all in lock-step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models import compiled_terms as terms
from scpf.models.batch_filter import BatchFilter, Motion, Term
from scpf.models.consider import ConsiderCovariance
from scpf.models.lasting_errors import LastingTempering
from scpf.models.matched_landmarks import CANDIDATE_BEHIND_M, CANDIDATE_RANGE_M, Sighting
from scpf.models.motion import ConstantTurnRate, ConstantVelocity
from scpf.models.road_map import fit_segment
from scpf.replay.evaluation_common import INITIAL_DEVIATIONS, Runs
from scpf.replay.evaluation_presets import Estimator
from scpf.replay.protocol import Detection, Scenario

Array = NDArray[np.float64]

INITIAL_HEADING_DEVIATIONS: Final = np.array([0.2, 0.05])


class ParticleRuns(Runs):
    """The particle filter's runs, compiled."""

    def __init__(
        self,
        settings: Estimator,
        scenario: Scenario,
        sigma_m: float,
        first: Array,
        seeds: Sequence[int],
        known_matching: bool,
    ) -> None:
        super().__init__(settings, scenario, sigma_m, first, seeds, known_matching)
        # float32 keeps its millimetres near 0 alone: the ring's own origin is its middle.
        marks = np.column_stack([self.positions_m, self.variances_m2])
        self.marks = marks.astype(np.float32)
        line = scenario.road_map.centre_line_m
        self.cubics = terms.road_cubics([fit_segment(line, anchor) for anchor in self.positions_m])
        self.half_width_m = scenario.road_map.half_width_m
        motion: Motion
        # Without GPS nothing but landmarks tells of a first speed that is far off, and they are believed slowly.
        deviations = INITIAL_DEVIATIONS * np.array(
            [1.0, 1.0, settings.velocity_doubt, settings.velocity_doubt]
        )
        self.consider: ConsiderCovariance | None = None
        if settings.motion == "constant-turn-rate":
            turning = ConstantTurnRate(settings.q_m2ps3, settings.q_turn_rad2ps3)
            motion = terms.TurnRateMotion(turning)
            heading = self.road.direction_rad(first[:, :2])
            speed = first[:, 2] * np.cos(heading) + first[:, 3] * np.sin(heading)
            ahead = np.column_stack([np.cos(heading), np.sin(heading)])
            first = np.column_stack([first[:, :2], speed[:, None] * ahead, heading, np.zeros(len(first))])
            deviations = np.concatenate([deviations, INITIAL_HEADING_DEVIATIONS])
            if settings.consider is not None:
                self.consider = ConsiderCovariance(settings.consider, turning, marks, len(first), deviations)
        else:
            motion = terms.VelocityMotion(ConstantVelocity(settings.q_m2ps3))
        self.filter = BatchFilter(motion, seeds, settings.particles, settings.resample_below)
        self.filter.initialise(first, deviations)
        self.mean, self.covariance = first, np.tile([10.0, 0.0, 10.0], (len(first), 1))

    def step(self, dt_s: float, fixes_m: Array, detections: Sequence[Detection]) -> tuple[Array, Array]:
        """Means (R, D) and position covariances (R, 3) after a frame."""
        if dt_s > 0.0:
            self.filter.predict(dt_s)
        poses = self.mean[:, :2] + dt_s * self.mean[:, 2:4]
        exponents = self._exponents()
        constraints = self._constraints(poses, detections, exponents)
        belief = self.filter.update([terms.Fix(fixes_m, self.fix_variance_m2), *constraints])
        covariance = belief.covariance
        if self.consider is not None:
            self.consider.predict(self.mean, dt_s)
            road = self.settings.heading_deviation_rad
            sightings = self._sightings(detections) if self.settings.landmarks else []
            self.consider.update(
                self.fix_variance_m2, None if road is None else road**2, sightings, exponents
            )
            covariance = self.consider.covariance(belief.covariance)
        self.mean, self.covariance = belief.mean, covariance
        return belief.mean, covariance

    def _exponents(self) -> Array:
        """How much the landmarks count in each run (R,)."""
        tempering = self.settings.tempering
        if isinstance(tempering, LastingTempering) and self.consider is not None:
            lasting = self.consider.lasting
            return tempering.exponent(lasting.share, lasting.offset_m2)
        always = tempering.lasting if isinstance(tempering, LastingTempering) else tempering
        return np.full(len(self.mean), always)

    def _constraints(self, poses_m: Array, detections: Sequence[Detection], exponents: Array) -> list[Term]:
        """The soft constraints around the predicted positions (R, 2)."""
        settings = self.settings
        wanted: list[Term] = []
        offset = self.positions_m[None] - poses_m[:, None]
        squared = (offset**2).sum(2)
        if settings.road:
            wanted.append(terms.Road(self.cubics, np.argmin(squared, axis=1), self.half_width_m))
        if settings.speed:
            wanted.append(terms.Speed())
        yaws = self.road.direction_rad(poses_m)
        if settings.heading_deviation_rad is not None:
            wanted.append(terms.Heading(yaws, settings.heading_deviation_rad))
        if not settings.landmarks or not detections:
            return wanted
        if settings.per_particle and not self.known_matching:
            return [*wanted, self._matched(offset, squared, yaws, detections, exponents)]
        matched = self.which(detections, poses_m, self.covariance, yaws)
        for seen, which in zip(self._sightings(detections), matched, strict=True):
            wanted.append(
                terms.Range(self.marks, which, seen.distance_m, seen.distance_deviation_m, exponents)
            )
            if settings.bearing_deviation_rad is not None:
                bearing = (seen.distance_m, seen.bearing_rad, seen.bearing_deviation_rad)
                wanted.append(terms.Bearing(self.marks, which, *bearing, exponents))
        return wanted

    def _sightings(self, detections: Sequence[Detection]) -> list[Sighting]:
        """The detections with the deviations to weigh them by."""
        return [
            Sighting(
                d.distance_m,
                float(np.sqrt(self.range_variance_m2(d))),
                d.bearing_rad,
                self.bearing_deviation_rad(d),
            )
            for d in detections
        ]

    def _matched(
        self,
        offset_m: Array,
        squared_m2: Array,
        yaws_rad: Array,
        detections: Sequence[Detection],
        exponents: Array,
    ) -> terms.Matched:
        """Matching by every particle, among the landmarks in sight of each run."""
        ahead = offset_m[..., 0] * np.cos(yaws_rad)[:, None] + offset_m[..., 1] * np.sin(yaws_rad)[:, None]
        near = (squared_m2 < CANDIDATE_RANGE_M**2) & (ahead > -CANDIDATE_BEHIND_M)
        most = int(near.sum(1).max(initial=0))
        order = np.argsort(~near, axis=1, kind="stable")[:, :most]
        candidates = np.where(np.take_along_axis(near, order, axis=1), order, -1)
        floor, seen = self.settings.floor, self._sightings(detections)
        return terms.Matched(self.marks, candidates, seen, floor, exponents)
