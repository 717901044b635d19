"""Motion models: how a state moves on in an interval, noise included."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class MotionModel(Protocol):
    """Anything that moves states (N, D) on by ``dt_s`` seconds."""

    def propagate(self, states: Array, dt_s: float, rng: np.random.Generator) -> Array:
        """The states (N, D) ``dt_s`` later, each with its own draw of the process noise."""
        ...


@dataclass(frozen=True)
class ConstantVelocity:
    """Nearly constant velocity in the plane, states [x, y, vx, vy].

    White acceleration of spectral density ``q_m2ps3`` a axis, discretised exactly: a step's noise has the
    covariance q·[T³/3 T²/2; T²/2 T] of (position, velocity).
    """

    q_m2ps3: float

    def covariance(self, dt_s: float) -> Array:
        """Covariance (2, 2) of an axis' (position, velocity) noise over ``dt_s``."""
        t = dt_s
        return self.q_m2ps3 * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])

    def propagate(self, states: Array, dt_s: float, rng: np.random.Generator) -> Array:
        """The states (N, 4) ``dt_s`` later."""
        moved = states.copy()
        moved[:, :2] += dt_s * states[:, 2:4]
        if dt_s > 0.0 and self.q_m2ps3 > 0.0:
            # The Cholesky factor of T³/3, T²/2, T in closed form: it exists for every T, however small.
            root = np.sqrt(self.q_m2ps3 * dt_s)
            first, second = rng.standard_normal((2, len(states), 2))
            moved[:, :2] += root * dt_s / np.sqrt(3.0) * first
            moved[:, 2:4] += root * (np.sqrt(3.0) / 2.0 * first + 0.5 * second)
        return moved


@dataclass(frozen=True)
class ConstantTurnRate:
    """Nearly constant turn rate and speed in the plane, states [x, y, vx, vy, ψ, ω].

    Five degrees of freedom in six columns: velocity is v·(cos ψ, sin ψ), so that whatever reads [x, y, vx, vy]
    reads these states too, and a standing vehicle keeps its heading. ψ (rad) is not wrapped; a negative v drives
    backwards. White acceleration of density ``q_speed_m2ps3`` along the path; the turn rate decays with
    ``turn_time_s`` under white noise of density ``q_turn_rad2ps3``; ``q_heading_rad2ps`` is the heading's own walk.
    Both noises are discretised exactly along path and heading; the step is then the chord of its arc.
    """

    q_speed_m2ps3: float = 0.5
    q_turn_rad2ps3: float = 0.01
    turn_time_s: float = 3.0
    q_heading_rad2ps: float = 1.2e-4

    def along_covariance(self, dt_s: float) -> Array:
        """Covariance (2, 2) of the noise of (path length, speed) over ``dt_s``."""
        return ConstantVelocity(self.q_speed_m2ps3).covariance(dt_s)

    def turn_covariance(self, dt_s: float) -> Array:
        """Covariance (2, 2) of the noise of (heading, turn rate): an integrated Ornstein-Uhlenbeck process."""
        noise = self.q_turn_rad2ps3 * decaying_noise(self.turn_time_s, dt_s)
        noise[0, 0] += self.q_heading_rad2ps * dt_s
        return noise

    def turn_response(self, dt_s: float) -> tuple[float, float]:
        """The turn rate's share left after ``dt_s``, and its integral (s): what it turns the heading by."""
        return decaying_response(self.turn_time_s, dt_s)

    def propagate(self, states: Array, dt_s: float, rng: np.random.Generator) -> Array:
        """The states (N, 6) ``dt_s`` later."""
        moved = states.copy()
        if dt_s <= 0.0:
            return moved
        draws = rng.standard_normal((2, 2, len(states)))
        length_noise, speed_noise = root_2x2(self.along_covariance(dt_s)) @ draws[0]
        heading_noise, rate_noise = root_2x2(self.turn_covariance(dt_s)) @ draws[1]
        decay, lever_s = self.turn_response(dt_s)
        heading, rate = states[:, 4], states[:, 5]
        speed = states[:, 2] * np.cos(heading) + states[:, 3] * np.sin(heading)
        turned = lever_s * rate + heading_noise
        chord = (dt_s * speed + length_noise) * np.sinc(turned / (2 * np.pi))
        speed = speed + speed_noise
        moved[:, 0] += chord * np.cos(heading + turned / 2)
        moved[:, 1] += chord * np.sin(heading + turned / 2)
        moved[:, 4] = heading + turned
        moved[:, 5] = decay * rate + rate_noise
        moved[:, 2] = speed * np.cos(moved[:, 4])
        moved[:, 3] = speed * np.sin(moved[:, 4])
        return moved


def turn_rate_state(position_m: Array, velocity_mps: Array, heading_rad: float) -> Array:
    """The state (6,) of ``ConstantTurnRate`` at a position (2,), its velocity (2,) projected on the heading."""
    ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    return np.concatenate([position_m, (velocity_mps @ ahead) * ahead, [heading_rad, 0.0]])


def decaying_response(time_s: float, dt_s: float) -> tuple[float, float]:
    """A rate that decays with ``time_s``: its share left after ``dt_s``, and the integral of that share (s)."""
    return float(np.exp(-dt_s / time_s)), float(-np.expm1(-dt_s / time_s) * time_s)


def decaying_noise(time_s: float, dt_s: float) -> Array:
    """Covariance (2, 2) of the noise of (integral, rate) after ``dt_s``, under white noise of unit density.

    The rate is an Ornstein-Uhlenbeck process that decays with ``time_s``.
    """
    tau = time_s
    gone, gone_twice = -np.expm1(-dt_s / tau), -np.expm1(-2 * dt_s / tau)
    integral = tau**2 * (dt_s - 2 * tau * gone + tau / 2 * gone_twice)
    both, rate = tau**2 / 2 * gone**2, tau / 2 * gone_twice
    return np.array([[integral, both], [both, rate]])


def root_2x2(covariance: Array) -> Array:
    """Lower Cholesky factor (2, 2), zero where the covariance is: a noise may be switched off."""
    first = float(np.sqrt(covariance[0, 0]))
    below = float(covariance[0, 1]) / first if first > 0.0 else 0.0
    return np.array([[first, 0.0], [below, np.sqrt(max(float(covariance[1, 1]) - below**2, 0.0))]])
