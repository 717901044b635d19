"""Compiled kernels of the batched filter: random numbers, motion, weights, resampling.

Particles of R runs lie in one array (D, R, N), float32, run by run; what differs between runs is an array (R,).
``log_weights`` (R, N) are added to in place. Each kernel states the numpy class whose values it computes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scpf.models.compiled import (
    Array32,
    exp_negative,
    f4,
    hashed,
    i4,
    kernel,
    log_positive,
    sin_cos_turns,
    u4,
)


@kernel
def fill_normals(normals: Array32, keys: Any, step: Any) -> None:
    """Standard normal numbers (4, R, N): a pure function of each run's key (R,), the step and the place.

    Box and Muller's transform of hashed counters: the same run draws the same numbers in any batch.
    """
    _, runs, n = normals.shape
    for r in range(runs):
        one, two, three, four = normals[0, r], normals[1, r], normals[2, r], normals[3, r]
        key = u4(keys[r])
        # Key and step together: a bare step would meet a small key's counters and draw extremes too often.
        mixed = hashed(u4(hashed(u4(step + u4(0x9E3779B9))) ^ key))
        for i in range(n):
            c = u4(u4(i) * u4(4))
            a = hashed(u4(hashed(u4(c + key)) ^ mixed))
            b = hashed(u4(hashed(u4(u4(c + u4(1)) + key)) ^ mixed))
            d = hashed(u4(hashed(u4(u4(c + u4(2)) + key)) ^ mixed))
            e = hashed(u4(hashed(u4(u4(c + u4(3)) + key)) ^ mixed))
            radius = np.sqrt(f4(-2.0) * log_positive((f4(i4(a >> u4(8))) + f4(0.5)) * f4(5.9604645e-08)))
            sine, cosine = sin_cos_turns(f4(i4(b)) * f4(2.3283064e-10))
            one[i] = radius * sine
            two[i] = radius * cosine
            radius = np.sqrt(f4(-2.0) * log_positive((f4(i4(d >> u4(8))) + f4(0.5)) * f4(5.9604645e-08)))
            sine, cosine = sin_cos_turns(f4(i4(e)) * f4(2.3283064e-10))
            three[i] = radius * sine
            four[i] = radius * cosine


@kernel
def move_constant_velocity(states: Array32, normals: Array32, dt: Any, root: Any) -> None:
    """``ConstantVelocity.propagate``; ``root`` (3,) is the lower Cholesky factor (pp, vp, vv) of its noise."""
    pp, vp, vv = f4(root[0]), f4(root[1]), f4(root[2])
    step = f4(dt)
    for r in range(states.shape[1]):
        x, y, vx, vy = states[0, r], states[1, r], states[2, r], states[3, r]
        n1, n2, n3, n4 = normals[0, r], normals[1, r], normals[2, r], normals[3, r]
        for i in range(x.size):
            x[i] += step * vx[i] + pp * n1[i]
            y[i] += step * vy[i] + pp * n2[i]
            vx[i] += vp * n1[i] + vv * n3[i]
            vy[i] += vp * n2[i] + vv * n4[i]


@kernel
def move_constant_turn_rate(
    states: Array32, normals: Array32, dt: Any, along: Any, turn: Any, decay: Any, carried: Any
) -> None:
    """``ConstantTurnRate.propagate``; ``along`` and ``turn`` (3,) are the Cholesky factors of its two noises.

    ``decay`` is the turn rate's share that is left after ``dt``, ``carried`` (s) its integral.
    """
    ss, vs, vv = f4(along[0]), f4(along[1]), f4(along[2])
    hh, wh, ww = f4(turn[0]), f4(turn[1]), f4(turn[2])
    step, left, lever = f4(dt), f4(decay), f4(carried)
    for r in range(states.shape[1]):
        x, y, vx, vy = states[0, r], states[1, r], states[2, r], states[3, r]
        heading, rate = states[4, r], states[5, r]
        n1, n2, n3, n4 = normals[0, r], normals[1, r], normals[2, r], normals[3, r]
        for i in range(x.size):
            sine, cosine = sin_cos_turns(heading[i] * f4(0.15915494309))
            speed = vx[i] * cosine + vy[i] * sine
            length = step * speed + ss * n1[i]
            speed = speed + vs * n1[i] + vv * n3[i]
            turned = lever * rate[i] + hh * n2[i]
            rate[i] = left * rate[i] + wh * n2[i] + ww * n4[i]
            sine, cosine = sin_cos_turns((heading[i] + f4(0.5) * turned) * f4(0.15915494309))
            chord = length * (f4(1.0) - turned * turned * f4(1.0 / 24.0))
            x[i] += chord * cosine
            y[i] += chord * sine
            heading[i] += turned
            sine, cosine = sin_cos_turns(heading[i] * f4(0.15915494309))
            vx[i] = speed * cosine
            vy[i] = speed * sine


@kernel
def normalise(log_weights: Array32, weights: Array32, peak: Any) -> None:
    """Weights (R, N) of unit sum; ``peak`` (R,): the largest log-weight."""
    for r in range(log_weights.shape[0]):
        lw, w = log_weights[r], weights[r]
        top = f4(-3.0e38)
        for i in range(lw.size):
            top = max(top, lw[i])
        total = f4(0.0)
        for i in range(lw.size):
            w[i] = exp_negative(lw[i] - top)
            total += w[i]
        inverse = f4(1.0) / total
        for i in range(lw.size):
            w[i] *= inverse
        peak[r] = top


@kernel
def summarise(states: Array32, weights: Array32, mean: Any, covariance: Any, ess: Any) -> None:
    """Weighted ``mean`` (R, D), position ``covariance`` (R, 3: xx, xy, yy), effective sample size (R,)."""
    size, runs, n = states.shape
    for r in range(runs):
        w = weights[r]
        squares = f4(0.0)
        for i in range(n):
            squares += w[i] * w[i]
        ess[r] = f4(1.0) / squares
        for d in range(size):
            column = states[d, r]
            # Sums about the first particle: what is left to add is small, so float32 keeps its digits.
            base = column[0]
            total = f4(0.0)
            for i in range(n):
                total += w[i] * (column[i] - base)
            mean[r, d] = base + total
        x, y = states[0, r], states[1, r]
        cx, cy = f4(mean[r, 0]), f4(mean[r, 1])
        xx, xy, yy = f4(0.0), f4(0.0), f4(0.0)
        for i in range(n):
            dx, dy = x[i] - cx, y[i] - cy
            xx += w[i] * dx * dx
            xy += w[i] * dx * dy
            yy += w[i] * dy * dy
        covariance[r, 0], covariance[r, 1], covariance[r, 2] = xx, xy, yy


@kernel
def resample(states: Array32, target: Array32, weights: Array32, chosen: Any, keys: Any, step: Any) -> None:
    """Systematic resampling of every run from ``states`` into ``target`` (D, R, N); ``chosen`` (N + 1,) is scratch."""
    size, runs, n = states.shape
    for r in range(runs):
        w = weights[r]
        offset = (hashed(u4(hashed(u4(keys[r] + u4(77))) ^ hashed(u4(step)))) >> u4(8)) * 5.9604645e-08
        # Each particle's number is put where its copies begin, over those that have none, and spreads from there:
        # no branch whose way depends on the weights.
        chosen[:] = 0
        total, begin = 0.0, 0
        for j in range(n):
            chosen[begin] = j
            total += w[j] * n
            begin = min(int(total + (1.0 - offset)), n)
        last = 0
        for i in range(n):
            last = max(last, chosen[i])
            chosen[i] = last
        for d in range(size):
            source, sink = states[d, r], target[d, r]
            for i in range(n):
                sink[i] = source[chosen[i]]


def conclude(
    log_weights: Array32,
    weights: Array32,
    states: Array32,
    target: Array32,
    chosen: Any,
    keys: Any,
    step: Any,
    below: Any,
    mean: Any,
    covariance: Any,
    ess: Any,
    peak: Any,
) -> bool:
    """``normalise``, ``summarise`` and, where a run's ESS/N is not above ``below``, ``resample``; whether it did.

    Log-weights are 0 after a resampling. Not compiled as one: the compiler would merge the three when they are new, but
    not when they come from its cache, and fast mathematics then rounds otherwise, the same seed or not.
    """
    normalise(log_weights, weights, peak)
    summarise(states, weights, mean, covariance, ess)
    wanted = bool(below >= 1.0 or (ess < below * states.shape[2]).any())
    if wanted:
        # In lock-step: where one run needs it all are resampled, which changes no distribution.
        resample(states, target, weights, chosen, keys, step)
        log_weights[:] = f4(0.0)
    return wanted
