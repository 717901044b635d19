"""Compiled matching around the estimate, and the innovations that show what lasts of the detections' errors.

For ``consider.py``; arrays as in ``consider_kernels.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scpf.models.compiled import inlined, kernel


@inlined
def seen_variance(covariance: Any, h0: Any, h1: Any) -> Any:
    """Variance of a bearing of slope (h0, h1, −1, 0, 0) for a state's covariance (5, 5)."""
    placed = h0 * h0 * covariance[0, 0] + h1 * h1 * covariance[1, 1] + 2.0 * h0 * h1 * covariance[0, 1]
    return placed + covariance[2, 2] - 2.0 * (h0 * covariance[0, 2] + h1 * covariance[1, 2])


@kernel
def look(
    means: Any,
    tracked: Any,
    marks: Any,
    detections: Any,
    noise: Any,
    gate: Any,
    which: Any,
    innovations: Any,
    expected: Any,
) -> None:
    """Match every detection (M, 4: distance, its deviation, bearing, its deviation) around ``means`` (R, 5).

    ``marks`` (L, 3): x, y, the variance of each axis.

    ``which`` (M, R): the landmark that fits best, −1 where it fits worse than ``gate`` (squared) or is taken;
    ``innovations`` (M, R, 2) of range (m) and bearing (rad). Of the latter, ``expected`` (M, R, 2) has the variance
    that the state's error and the detector's ``noise`` (rad²) make, and what each m² of the places' variance adds.
    """
    _, plain, placed, cross, _ = tracked
    for r in range(means.shape[0]):
        x, y, heading = means[r, 0], means[r, 1], means[r, 2]
        for m in range(detections.shape[0]):
            distance, angle = detections[m, 0], heading + detections[m, 2]
            c, s = np.cos(angle), np.sin(angle)
            in_range = detections[m, 1] ** 2
            in_bearing = (detections[m, 3] * max(distance, 1.0)) ** 2
            best, least = -1, gate
            for k in range(marks.shape[0]):
                dx, dy = marks[k, 0] - x, marks[k, 1] - y
                along, across = dx * c + dy * s - distance, dy * c - dx * s
                own = marks[k, 2]
                misfit = along * along / (in_range + own) + across * across / (in_bearing + own)
                if misfit < least:
                    best, least = k, misfit
            for earlier in range(m):
                if which[earlier, r] == best:
                    best = -1
            which[m, r] = best
            if best < 0:
                continue
            dx, dy = marks[best, 0] - x, marks[best, 1] - y
            squared = max(dx * dx + dy * dy, 1.0)
            innovations[m, r, 0] = distance - np.sqrt(squared)
            innovations[m, r, 1] = np.arctan2(c * dy - s * dx, c * dx + s * dy) * -1.0
            h0, h1 = dy / squared, -dx / squared
            east, north = cross[r, best, 1], cross[r, best, 2]
            expected[m, r, 0] = noise + seen_variance(plain[r], h0, h1)
            expected[m, r, 1] = h0 * h0 + h1 * h1 + seen_variance(placed[r], h0, h1)
            for h, row in ((h0, east), (h1, north)):
                expected[m, r, 1] -= 2.0 * h * (h0 * row[0] + h1 * row[1] - row[2])
