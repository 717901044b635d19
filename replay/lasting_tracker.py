"""The particle filter of the `default` preset: it finds out what lasts of the errors, and says so in its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scpf.models.bearing_constraint import HeadingConstraint
from scpf.models.consider import ConsiderCovariance
from scpf.models.constraints import Constraint
from scpf.models.matched_landmarks import MatchedLandmarks
from scpf.models.motion import ConstantTurnRate
from scpf.models.particle_filter import Belief, FilterSettings, ParticleFilter, PositionFix
from scpf.models.road_map import RoadMap
from scpf.replay.settings import HeadingSettings

Array = NDArray[np.float64]


class LastingTracker:
    """Steps as `ParticleFilter` does, for states [x, y, vx, vy, ψ, ω].

    Beside the particles it keeps the covariance of errors that last (`ConsiderCovariance`): its beliefs have that one,
    of the whole state (6, 6). ``exponent`` is what landmarks count in the next step, as far as their errors last.
    """

    def __init__(
        self,
        settings: HeadingSettings,
        motion: ConstantTurnRate,
        particles: FilterSettings,
        road_map: RoadMap,
        rng: np.random.Generator,
    ) -> None:
        doubt = settings.velocity_doubt**2
        east, north, *velocity = particles.initial_variance
        variances = (east, north, *(doubt * each for each in velocity), *settings.initial_variance)
        self._settings, self._motion = settings, motion
        self._deviations = np.sqrt(np.array(variances))
        own_m2 = np.array([mark.variance_m2 for mark in road_map.landmarks])
        self._marks = np.column_stack([road_map.positions_m, own_m2])
        self._filter = ParticleFilter(motion, replace(particles, initial_variance=variances), rng)
        self._consider = self._afresh()
        self._mean = np.zeros(6)

    @property
    def exponent(self) -> float:
        """The tempering of the landmarks' constraints in the next step."""
        lasting = self._consider.lasting
        return float(self._settings.tempering.exponent(lasting.share, lasting.offset_m2)[0])

    def initialise(self, mean: Array) -> Belief:
        """Begin around ``mean`` (6,); what was learnt of errors is forgotten."""
        self._consider, self._mean = self._afresh(), mean
        return self._filter.initialise(mean)

    def predict(self, dt_s: float) -> Array:
        """Move on by ``dt_s``; the predicted mean (6,)."""
        self._consider.predict(self._mean[None], dt_s)
        return self._filter.predict(dt_s)

    def update(self, constraints: Sequence[Constraint], fix: PositionFix | None = None) -> Belief:
        """Weight the particles by the fix and the constraints; the covariance takes in the same."""
        road = next((one for one in constraints if isinstance(one, HeadingConstraint)), None)
        seen = [one for each in constraints if isinstance(each, MatchedLandmarks) for one in each.sightings]
        exponents = np.array([self.exponent])
        belief = self._filter.update(constraints, fix)
        self._consider.update(
            None if fix is None else fix.variance_m2,
            None if road is None else road.deviation_rad**2,
            seen,
            exponents,
        )
        self._mean = belief.mean
        spread = belief.covariance[[0, 0, 1], [0, 1, 1]]
        return replace(belief, covariance=self._consider.state_covariances(spread[None])[0])

    def _afresh(self) -> ConsiderCovariance:
        return ConsiderCovariance(self._settings.consider, self._motion, self._marks, 1, self._deviations)
