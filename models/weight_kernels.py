"""Compiled kernels that weigh particles: one a constraint, adding its log-probability to ``log_weights`` (R, N).

``x``, ``y``, … are rows (R, N) of the particles; what differs between runs is an array (R, …).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scpf.models.compiled import (
    Array32,
    angle_of,
    erfc_parts,
    exp_negative,
    f4,
    kernel,
    log_positive,
    wrapped,
)

RECIPROCAL_SQRT2 = 0.7071067811865476


@kernel
def add_fix(log_weights: Array32, x: Array32, y: Array32, fix_m: Any, inverse_variance: Any) -> None:
    """``PositionFix.log_likelihood``; ``fix_m`` (R, 2)."""
    scale = f4(0.5 * inverse_variance)
    for r in range(x.shape[0]):
        lw, xr, yr = log_weights[r], x[r], y[r]
        fx, fy = f4(fix_m[r, 0]), f4(fix_m[r, 1])
        for i in range(xr.size):
            lw[i] -= ((xr[i] - fx) ** 2 + (yr[i] - fy) ** 2) * scale


@kernel
def add_road(
    log_weights: Array32, x: Array32, y: Array32, cubics: Any, which: Any, half_width: Any, inverse_mean: Any
) -> None:
    """``RoadConstraint``; ``cubics`` (S, 7: centre x, y, b0 … b3, swapped), ``which`` (R,) is each run's."""
    half, steep = f4(half_width), f4(inverse_mean)
    for r in range(x.shape[0]):
        lw = log_weights[r]
        cubic = cubics[which[r]]
        swapped = cubic[6] > 0.5
        along, across = (y[r], x[r]) if swapped else (x[r], y[r])
        c0, c1 = (f4(cubic[1]), f4(cubic[0])) if swapped else (f4(cubic[0]), f4(cubic[1]))
        b0, b1, b2, b3 = f4(cubic[2]), f4(cubic[3]), f4(cubic[4]), f4(cubic[5])
        for i in range(lw.size):
            t = along[i] - c0
            offset = across[i] - c1 - (b0 + t * (b1 + t * (b2 + t * b3)))
            lw[i] -= max(abs(offset) - half, f4(0.0)) * steep


@kernel
def add_speed(log_weights: Array32, vx: Array32, vy: Array32, limit: Any, inverse_mean: Any) -> None:
    """``SpeedConstraint``."""
    top, steep = f4(limit), f4(inverse_mean)
    for r in range(vx.shape[0]):
        lw, u, v = log_weights[r], vx[r], vy[r]
        for i in range(lw.size):
            lw[i] -= max(np.sqrt(u[i] * u[i] + v[i] * v[i]) - top, f4(0.0)) * steep


@kernel
def add_range(
    log_weights: Array32,
    x: Array32,
    y: Array32,
    positions: Any,
    which: Any,
    distance: Any,
    deviation: Any,
    exponents: Any,
) -> None:
    """``LandmarkConstraint`` to the power of ``exponents`` (R,).

    ``which`` (R,) of ``positions`` (L, 2) it is in each run, −1 for none.
    """
    mu, scale = f4(distance), f4(RECIPROCAL_SQRT2 / deviation)
    for r in range(x.shape[0]):
        if which[r] < 0:
            continue
        lw, xr, yr = log_weights[r], x[r], y[r]
        lx, ly = f4(positions[which[r], 0]), f4(positions[which[r], 1])
        power = f4(exponents[r])
        for i in range(lw.size):
            dx, dy = xr[i] - lx, yr[i] - ly
            t, p = erfc_parts(abs(np.sqrt(dx * dx + dy * dy) - mu) * scale)
            lw[i] += power * (log_positive(t) + p)


@kernel
def add_bearing(
    log_weights: Array32,
    x: Array32,
    y: Array32,
    heading: Array32,
    positions: Any,
    which: Any,
    bearing: Any,
    deviation: Any,
    exponents: Any,
) -> None:
    """``BearingConstraint`` to the power of ``exponents`` (R,); the rest as in ``add_range``."""
    beta, scale = f4(bearing), f4(RECIPROCAL_SQRT2 / deviation)
    for r in range(x.shape[0]):
        if which[r] < 0:
            continue
        lx, ly = f4(positions[which[r], 0]), f4(positions[which[r], 1])
        power = f4(exponents[r])
        lw, xr, yr, hr = log_weights[r], x[r], y[r], heading[r]
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
def add_matched(
    log_weights: Array32,
    states: Array32,
    positions: Array32,
    candidates: Any,
    detections: Any,
    floor: Any,
    exponents: Any,
    scratch: Array32,
) -> None:
    """``MatchedLandmarks``: each particle weighs every candidate for every detection, one to one.

    ``positions`` (L, 2); ``candidates`` (R, C) landmark indices, −1 after the last; ``detections`` (M, 4: distance,
    its deviation, bearing, its deviation); ``exponents`` (R,) temper; ``scratch`` (M, 4, N).
    """
    count = detections.shape[0]
    few = f4(floor)
    fit = np.empty(states.shape[2], f4)
    for r in range(states.shape[1]):
        lw, x, y, heading = log_weights[r], states[0, r], states[1, r], states[4, r]
        n, power = lw.size, f4(exponents[r])
        for m in range(count):
            for k in range(4):
                scratch[m, k, :] = f4(-1e30) if k < 2 else f4(-1.0)
        for c in range(candidates.shape[1]):
            index = candidates[r, c]
            if index < 0:
                break
            lx, ly, mark = f4(positions[index, 0]), f4(positions[index, 1]), f4(index)
            for m in range(count):
                best, second, who, other = scratch[m, 0], scratch[m, 1], scratch[m, 2], scratch[m, 3]
                mu, beta = f4(detections[m, 0]), f4(detections[m, 2])
                in_range = f4(RECIPROCAL_SQRT2 / detections[m, 1])
                in_bearing = f4(RECIPROCAL_SQRT2 / detections[m, 3])
                for i in range(n):
                    dx, dy = lx - x[i], ly - y[i]
                    t1, p1 = erfc_parts(abs(np.sqrt(dx * dx + dy * dy) - mu) * in_range)
                    t2, p2 = erfc_parts(abs(wrapped(angle_of(dy, dx) - heading[i] - beta)) * in_bearing)
                    fit[i] = log_positive(t1 * t2) + p1 + p2
                # Apart from the mathematics: with fewer arrays in a loop the compiler can tell them apart.
                for i in range(n):
                    value = fit[i]
                    first = value > best[i]
                    later = value > second[i]
                    other[i] = who[i] if first else (mark if later else other[i])
                    second[i] = best[i] if first else (value if later else second[i])
                    who[i] = mark if first else who[i]
                    best[i] = value if first else best[i]
        # Two detections that a particle takes for one landmark: the worse one takes its second choice.
        for m in range(count):
            best, second, who, other = scratch[m, 0], scratch[m, 1], scratch[m, 2], scratch[m, 3]
            for k in range(count):
                if k != m:
                    taken = scratch[k, 2]
                    for i in range(n):
                        second[i] = f4(-1e30) if taken[i] == other[i] else second[i]
            for k in range(count):
                if k != m:
                    rival, taken = scratch[k, 0], scratch[k, 2]
                    for i in range(n):
                        beaten = rival[i] > best[i] or (rival[i] == best[i] and k < m)
                        loses = beaten and taken[i] == who[i] and who[i] >= f4(0.0)
                        other[i] = f4(-2.0) if loses else other[i]
            for i in range(n):
                value = second[i] if other[i] == f4(-2.0) else best[i]
                lw[i] += power * log_positive((f4(1.0) - few) * exp_negative(value) + few)
