"""Compiled kernels of ``consider.py``: what a filter's gains make of errors that last, for R runs at once.

Deviations have five parts, [x, y, ψ, v, ω] (m, m, rad, m/s, rad/s). Three covariances (R, 5, 5) run side by side:
``claimed`` is the one that the filter's gains follow, ``plain`` that of its real error on a perfect map, and
``placed`` what misplaced landmarks add to it for each m² (an axis) of their places' variance. ``cross``
(R, L, 3, 5) is the covariance of the error with each landmark's lasting range error (m), and with the offset of its
place (east, north) of unit variance.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scpf.models.compiled import inlined, kernel

Array = NDArray[np.float64]

SIZE = 5


class Tracked(NamedTuple):
    """The covariances above, and ``idle_s`` (R, L): seconds since a landmark was seen, −1 for those forgotten."""

    claimed: Array
    plain: Array
    placed: Array
    cross: Array
    idle_s: Array


@inlined
def correct(covariance: Any, gain: Any, gap: Any, innovation: Any) -> None:
    """P ← (I − k hᵀ) P (I − k hᵀ)ᵀ + what the measurement's error adds, for ``gain`` k (5,).

    ``gap`` (5,) is the covariance of error and innovation, ``innovation`` the latter's variance.
    """
    for i in range(SIZE):
        for j in range(SIZE):
            covariance[i, j] += innovation * gain[i] * gain[j] - gain[i] * gap[j] - gap[i] * gain[j]


@inlined
def take_in(
    claimed: Any,
    plain: Any,
    placed: Any,
    cross: Any,
    idle: Any,
    slope: Any,
    weighed: Any,
    white: Any,
    mark: Any,
    lasting: Any,
    scratch: Any,
) -> None:
    """One scalar measurement of ``slope`` (5,), of one run.

    The filter takes its error for white with variance ``weighed``. Really it is white with ``white``, plus, of
    landmark ``mark`` (−1 for none), the lasting error of variance ``lasting``, and its place's offset seen through
    the slope. ``scratch`` (3, 5).
    """
    gain, gap, placed_gap = scratch[0], scratch[1], scratch[2]
    weighed_innovation, innovation, placed_innovation = weighed, white, 0.0
    for i in range(SIZE):
        gain[i], gap[i], placed_gap[i] = 0.0, 0.0, 0.0
        for j in range(SIZE):
            gain[i] += claimed[i, j] * slope[j]
            gap[i] += plain[i, j] * slope[j]
            placed_gap[i] += placed[i, j] * slope[j]
        weighed_innovation += slope[i] * gain[i]
        innovation += slope[i] * gap[i]
        placed_innovation += slope[i] * placed_gap[i]
    for i in range(SIZE):
        for j in range(SIZE):
            claimed[i, j] -= gain[i] * gain[j] / weighed_innovation
    for i in range(SIZE):
        gain[i] /= weighed_innovation
    if mark >= 0:
        innovation += lasting
        placed_innovation += slope[0] * slope[0] + slope[1] * slope[1]
        for i in range(SIZE):
            shared = cross[mark, 0, i] if lasting > 0.0 else 0.0
            gap[i] -= shared
            innovation -= 2.0 * slope[i] * shared
            shared = cross[mark, 1, i] * slope[0] + cross[mark, 2, i] * slope[1]
            placed_gap[i] -= shared
            placed_innovation -= 2.0 * slope[i] * shared
    correct(plain, gain, gap, innovation)
    correct(placed, gain, placed_gap, placed_innovation)
    for m in range(cross.shape[0]):
        if idle[m] >= 0.0:
            for k in range(3):
                seen = 0.0
                for i in range(SIZE):
                    seen += slope[i] * cross[m, k, i]
                for i in range(SIZE):
                    cross[m, k, i] -= gain[i] * seen
    if mark >= 0:
        for i in range(SIZE):
            cross[mark, 0, i] += gain[i] * lasting
            cross[mark, 1, i] += gain[i] * slope[0]
            cross[mark, 2, i] += gain[i] * slope[1]


@kernel
def advance(means: Any, tracked: Any, dt: Any, noise: Any, keep: Any, forget: Any) -> None:
    """Move on by ``dt`` s as ``ConstantTurnRate`` does; ``means`` (R, 5) move along.

    ``noise`` (8,): covariances of (path, speed) and of (heading, turn rate), three numbers each; the turn rate's
    share left and its integral. ``keep``: the share of a lasting range error that is left. ``idle`` (R, L): seconds
    since a landmark was seen, −1 for those forgotten, as they are after ``forget`` s.
    """
    claimed, plain, placed, cross, idle = tracked
    step, moved = np.eye(SIZE), np.empty((SIZE, SIZE))
    step[2, 4], step[4, 4] = noise[7], noise[6]
    row = np.empty(SIZE)
    for r in range(means.shape[0]):
        speed, turned = means[r, 3], noise[7] * means[r, 4]
        c, s = np.cos(means[r, 2] + 0.5 * turned), np.sin(means[r, 2] + 0.5 * turned)
        means[r, 0] += dt * speed * c
        means[r, 1] += dt * speed * s
        means[r, 2] += turned
        means[r, 4] *= noise[6]
        step[0, 2], step[0, 3] = -dt * speed * s, dt * c
        step[1, 2], step[1, 3] = dt * speed * c, dt * s
        for covariance in (claimed[r], plain[r], placed[r]):
            for i in range(SIZE):
                for j in range(SIZE):
                    total = 0.0
                    for k in range(SIZE):
                        total += step[i, k] * covariance[k, j]
                    moved[i, j] = total
            for i in range(SIZE):
                for j in range(SIZE):
                    total = 0.0
                    for k in range(SIZE):
                        total += moved[i, k] * step[j, k]
                    covariance[i, j] = total
        for covariance in (claimed[r], plain[r]):
            covariance[0, 0] += noise[0] * c * c
            covariance[0, 1] += noise[0] * c * s
            covariance[1, 0] += noise[0] * c * s
            covariance[1, 1] += noise[0] * s * s
            covariance[0, 3] += noise[1] * c
            covariance[3, 0] += noise[1] * c
            covariance[1, 3] += noise[1] * s
            covariance[3, 1] += noise[1] * s
            covariance[3, 3] += noise[2]
            covariance[2, 2] += noise[3]
            covariance[2, 4] += noise[4]
            covariance[4, 2] += noise[4]
            covariance[4, 4] += noise[5]
        for m in range(cross.shape[1]):
            if idle[r, m] < 0.0:
                continue
            idle[r, m] += dt
            if idle[r, m] > forget:
                idle[r, m] = -1.0
                cross[r, m] = 0.0
                continue
            for k in range(3):
                left = keep if k == 0 else 1.0
                for i in range(SIZE):
                    row[i] = 0.0
                    for j in range(SIZE):
                        row[i] += step[i, j] * cross[r, m, k, j]
                for i in range(SIZE):
                    cross[r, m, k, i] = left * row[i]


@kernel
def take_in_direct(tracked: Any, part: Any, variance: Any) -> None:
    """A measurement of the state's ``part`` itself with white noise of ``variance``, in every run."""
    claimed, plain, placed, cross, idle = tracked
    slope, scratch = np.zeros(SIZE), np.empty((3, SIZE))
    slope[part] = 1.0
    for r in range(claimed.shape[0]):
        own = (claimed[r], plain[r], placed[r], cross[r], idle[r])
        take_in(own[0], own[1], own[2], own[3], own[4], slope, variance, variance, -1, 0.0, scratch)


@kernel
def take_in_landmarks(
    means: Any,
    tracked: Any,
    marks: Any,
    detections: Any,
    which: Any,
    exponents: Any,
    flatter: Any,
    noise: Any,
    shares: Any,
) -> None:
    """Take in distance and bearing of the detections (M, 4), as for ``look``, matched to ``which`` (M, R) of ``marks``.

    ``exponents`` (R,) temper what they weigh, ``flatter`` is the variance of their likelihood for a deviation of 1.
    A distance errs by its deviation, of whose square ``shares`` (R,) last; a bearing by ``noise`` (rad²) alone.
    """
    claimed, plain, placed, cross, idle = tracked
    slope, scratch = np.zeros(SIZE), np.empty((3, SIZE))
    for r in range(means.shape[0]):
        weight = flatter / exponents[r]
        for m in range(detections.shape[0]):
            mark = which[m, r]
            if mark < 0:
                continue
            if idle[r, mark] < 0.0:
                cross[r, mark] = 0.0
            idle[r, mark] = 0.0
            dx, dy = marks[mark, 0] - means[r, 0], marks[mark, 1] - means[r, 1]
            squared = max(dx * dx + dy * dy, 1.0)
            distance = np.sqrt(squared)
            own = (claimed[r], plain[r], placed[r], cross[r], idle[r])
            slope[0], slope[1], slope[2] = -dx / distance, -dy / distance, 0.0
            variance = detections[m, 1] ** 2
            lasting, white = shares[r] * variance, (1.0 - shares[r]) * variance
            weighed = weight * (variance + marks[mark, 2])
            take_in(own[0], own[1], own[2], own[3], own[4], slope, weighed, white, mark, lasting, scratch)
            slope[0], slope[1], slope[2] = dy / squared, -dx / squared, -1.0
            weighed = weight * (detections[m, 3] ** 2 + marks[mark, 2] / max(detections[m, 0], 1.0) ** 2)
            take_in(own[0], own[1], own[2], own[3], own[4], slope, weighed, noise, mark, 0.0, scratch)
