"""Compiled kernels that weigh particles: one a constraint, adding its log-probability to ``log_weights`` (R, N).

``states`` (D, R, N) are the particles; what differs between runs is an array (R, …).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scpf.models.compiled import (
    Array32,
    angle_of,
    erfc_parts,
    f4,
    kernel,
    log_positive,
    wrapped,
)

RECIPROCAL_SQRT2 = 0.7071067811865476


@kernel
def add_fix(log_weights: Array32, states: Array32, fix_m: Any, inverse_variance: Any) -> None:
    """``PositionFix.log_likelihood``; ``fix_m`` (R, 2)."""
    scale = f4(0.5 * inverse_variance)
    for r in range(states.shape[1]):
        lw, xr, yr = log_weights[r], states[0, r], states[1, r]
        fx, fy = f4(fix_m[r, 0]), f4(fix_m[r, 1])
        for i in range(xr.size):
            lw[i] -= ((xr[i] - fx) ** 2 + (yr[i] - fy) ** 2) * scale


@kernel
def add_road(
    log_weights: Array32, states: Array32, cubics: Any, which: Any, half_width: Any, inverse_mean: Any
) -> None:
    """``RoadConstraint``; ``cubics`` (S, 7: centre x, y, b0 … b3, swapped), ``which`` (R,) is each run's."""
    half, steep = f4(half_width), f4(inverse_mean)
    for r in range(states.shape[1]):
        lw, x, y = log_weights[r], states[0, r], states[1, r]
        cubic = cubics[which[r]]
        swapped = cubic[6] > 0.5
        along, across = (y, x) if swapped else (x, y)
        c0, c1 = (f4(cubic[1]), f4(cubic[0])) if swapped else (f4(cubic[0]), f4(cubic[1]))
        b0, b1, b2, b3 = f4(cubic[2]), f4(cubic[3]), f4(cubic[4]), f4(cubic[5])
        for i in range(lw.size):
            t = along[i] - c0
            offset = across[i] - c1 - (b0 + t * (b1 + t * (b2 + t * b3)))
            lw[i] -= max(abs(offset) - half, f4(0.0)) * steep


@kernel
def add_speed(log_weights: Array32, states: Array32, limit: Any, inverse_mean: Any) -> None:
    """``SpeedConstraint``."""
    top, steep = f4(limit), f4(inverse_mean)
    for r in range(states.shape[1]):
        lw, u, v = log_weights[r], states[2, r], states[3, r]
        for i in range(lw.size):
            lw[i] -= max(np.sqrt(u[i] * u[i] + v[i] * v[i]) - top, f4(0.0)) * steep


@kernel
def add_range(
    log_weights: Array32,
    states: Array32,
    marks: Any,
    which: Any,
    distance: Any,
    deviation: Any,
    exponents: Any,
) -> None:
    """``LandmarkConstraint`` to the power of ``exponents`` (R,).

    ``which`` (R,) of ``marks`` (L, 3: x, y, variance of each axis) it is in each run, −1 for none.
    """
    mu = f4(distance)
    for r in range(states.shape[1]):
        if which[r] < 0:
            continue
        lw, xr, yr = log_weights[r], states[0, r], states[1, r]
        lx, ly = f4(marks[which[r], 0]), f4(marks[which[r], 1])
        scale = f4(RECIPROCAL_SQRT2 / np.sqrt(deviation**2 + marks[which[r], 2]))
        power = f4(exponents[r])
        for i in range(lw.size):
            dx, dy = xr[i] - lx, yr[i] - ly
            t, p = erfc_parts(abs(np.sqrt(dx * dx + dy * dy) - mu) * scale)
            lw[i] += power * (log_positive(t) + p)


@kernel
def add_bearing(
    log_weights: Array32,
    states: Array32,
    marks: Any,
    which: Any,
    distance: Any,
    bearing: Any,
    deviation: Any,
    exponents: Any,
) -> None:
    """``BearingConstraint`` of a landmark ``distance`` away, to the power of ``exponents`` (R,).

    The rest as in ``add_range``.
    """
    beta, squared = f4(bearing), max(distance, 1.0) ** 2
    for r in range(states.shape[1]):
        if which[r] < 0:
            continue
        lx, ly = f4(marks[which[r], 0]), f4(marks[which[r], 1])
        scale = f4(RECIPROCAL_SQRT2 / np.sqrt(deviation**2 + marks[which[r], 2] / squared))
        power = f4(exponents[r])
        lw, xr, yr, hr = log_weights[r], states[0, r], states[1, r], states[4, r]
        for i in range(lw.size):
            off = wrapped(angle_of(ly - yr[i], lx - xr[i]) - hr[i] - beta)
            t, p = erfc_parts(abs(off) * scale)
            lw[i] += power * (log_positive(t) + p)


@kernel
def add_heading(log_weights: Array32, heading: Array32, direction: Any, deviation: Any) -> None:
    """``HeadingConstraint``; ``direction`` (R,)."""
    scale = f4(0.5 / (deviation * deviation))
    for r in range(heading.shape[0]):
        lw, hr, road = log_weights[r], heading[r], f4(direction[r])
        for i in range(lw.size):
            off = wrapped(hr[i] - road)
            lw[i] -= scale * off * off


@kernel
def half_normal_in_place(violations: Any, deviation: Any) -> None:
    """``half_normal_log_survival`` in the place of its ``violations`` (N,), in single precision."""
    scale = f4(RECIPROCAL_SQRT2 / deviation)
    for i in range(violations.size):
        t, p = erfc_parts(max(f4(violations[i]), f4(0.0)) * scale)
        violations[i] = log_positive(t) + p
