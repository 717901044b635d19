"""Compiled matching by every particle: what ``MatchedLandmarks`` chooses, for one run's particles at a time."""

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
NONE_FITS = -1e30
BLOCK = 1024
"""So many particles' choices fit into a fast cache."""


@kernel
def choose(
    x: Array32,
    y: Array32,
    heading: Array32,
    marks: Array32,
    candidates: Any,
    detections: Any,
    scratch: Array32,
) -> None:
    """Every particle's landmark for every detection, one to one, and how well it fits.

    ``x``, ``y``, ``heading`` (N,); ``marks`` (L, 3: x, y, variance of each axis); ``candidates`` (C,) index them, −1
    after the last; ``detections`` (M, 4: distance, its deviation, bearing, its deviation). ``scratch`` (M, 4, N)
    holds log S in row 0, −1e30 where none is left, and the landmark in row 2, −1 there; the rest is used up.
    """
    n, count = x.size, detections.shape[0]
    # Made here, it overlaps no other array: else the compiler would not take particles together.
    fit = np.empty(n, f4)
    for m in range(count):
        for k in range(4):
            scratch[m, k, :] = f4(NONE_FITS) if k < 2 else f4(-1.0)
    for c in range(candidates.size):
        index = candidates[c]
        if index < 0:
            break
        lx, ly, own, mark = f4(marks[index, 0]), f4(marks[index, 1]), marks[index, 2], f4(index)
        for m in range(count):
            best, second, who, other = scratch[m, 0], scratch[m, 1], scratch[m, 2], scratch[m, 3]
            mu, beta = f4(detections[m, 0]), f4(detections[m, 2])
            off_m2 = own / max(detections[m, 0], 1.0) ** 2
            in_range = f4(RECIPROCAL_SQRT2 / np.sqrt(detections[m, 1] ** 2 + own))
            in_bearing = f4(RECIPROCAL_SQRT2 / np.sqrt(detections[m, 3] ** 2 + off_m2))
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
                    second[i] = f4(NONE_FITS) if taken[i] == other[i] else second[i]
    for m in range(count):
        best, second, who, other = scratch[m, 0], scratch[m, 1], scratch[m, 2], scratch[m, 3]
        loses = fit
        loses[:] = f4(0.0)
        for k in range(count):
            if k != m:
                rival, taken = scratch[k, 0], scratch[k, 2]
                for i in range(n):
                    beaten = rival[i] > best[i] or (rival[i] == best[i] and k < m)
                    same = beaten and taken[i] == who[i] and who[i] >= f4(0.0)
                    loses[i] = f4(1.0) if same else loses[i]
        # The others still compare with this one's first choice: what it falls back on goes to its second row.
        for i in range(n):
            second[i] = second[i] if loses[i] > f4(0.0) else best[i]
            other[i] = other[i] if loses[i] > f4(0.0) else who[i]
    for m in range(count):
        best, second, who, other = scratch[m, 0], scratch[m, 1], scratch[m, 2], scratch[m, 3]
        for i in range(n):
            best[i] = second[i]
            who[i] = other[i] if second[i] > f4(NONE_FITS) else f4(-1.0)


@kernel
def add_matched(
    log_weights: Array32,
    states: Array32,
    marks: Array32,
    candidates: Any,
    detections: Any,
    floor: Any,
    exponents: Any,
    scratch: Array32,
) -> None:
    """``MatchedLandmarks``: each particle weighs every candidate for every detection, one to one.

    ``candidates`` (R, C) are each run's, ``exponents`` (R,) temper; the rest as in ``choose``.
    """
    few = f4(floor)
    for r in range(states.shape[1]):
        choose(states[0, r], states[1, r], states[4, r], marks, candidates[r], detections, scratch)
        lw, power = log_weights[r], f4(exponents[r])
        for m in range(detections.shape[0]):
            best = scratch[m, 0]
            for i in range(lw.size):
                lw[i] += power * log_positive((f4(1.0) - few) * exp_negative(best[i]) + few)


@kernel
def measure_matched(
    states: Array32,
    marks: Array32,
    detections: Any,
    floor: Any,
    exponent: Any,
    violation: Array32,
    log_probability: Array32,
) -> None:
    """Both values (N,) of ``MatchedLandmarks`` for ``states`` (3, N: x, y, heading); all ``marks`` are candidates."""
    few, power = f4(floor), f4(exponent)
    count, candidates = detections.shape[0], np.arange(marks.shape[0])
    for begin in range(0, states.shape[1], BLOCK):
        x, y, heading = states[0, begin : begin + BLOCK], states[1, begin : begin + BLOCK], states[2, begin:]
        n = x.size
        block = np.empty((count, 4, n), f4)
        choose(x, y, heading[:n], marks, candidates, detections, block)
        miss, total = violation[begin : begin + n], log_probability[begin : begin + n]
        miss[:] = f4(0.0)
        total[:] = f4(0.0)
        for m in range(count):
            best, who, mu = block[m, 0], block[m, 2], f4(detections[m, 0])
            for i in range(n):
                total[i] += power * log_positive((f4(1.0) - few) * exp_negative(best[i]) + few)
            for c in range(marks.shape[0]):
                lx, ly, mark = marks[c, 0], marks[c, 1], f4(c)
                for i in range(n):
                    dx, dy = lx - x[i], ly - y[i]
                    miss[i] += abs(np.sqrt(dx * dx + dy * dy) - mu) if who[i] == mark else f4(0.0)
