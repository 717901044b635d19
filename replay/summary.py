"""The summary of a replay: counts and statistics of its steps, as plain values for JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from scpf.models.association import Match
from scpf.models.observation import Distance
from scpf.replay.step import Errors, Step

WITHIN_95: Final = 1.959964
"""Standard deviations about the mean that hold 95 % of a normal distribution."""


@dataclass
class Tally:
    """What a summary needs of the steps so far: numbers, never images or particles."""

    frames: int = 0
    first_stamp_ns: int = 0
    last_stamp_ns: int = 0
    errors: list[Errors] = field(default_factory=list)
    baseline_errors: list[Errors] = field(default_factory=list)
    distances: list[tuple[Distance, float]] = field(default_factory=list)
    detected: Counter[int] = field(default_factory=Counter)
    used: Counter[int] = field(default_factory=Counter)
    unmatched: Counter[str] = field(default_factory=Counter)
    verdicts: Counter[str] = field(default_factory=Counter)
    unmeasured: int = 0
    states: Counter[str] = field(default_factory=Counter)
    notes: Counter[str] = field(default_factory=Counter)
    ess: list[float] = field(default_factory=list)
    timing_s: dict[str, list[float]] = field(default_factory=dict)

    def add(self, step: Step) -> None:
        """Count one step in."""
        if not self.frames:
            self.first_stamp_ns = step.frame.stamp_ns
        self.last_stamp_ns = step.frame.stamp_ns
        self.frames += 1
        if step.errors is not None:
            self.errors.append(step.errors)
        if step.baseline_errors is not None:
            self.baseline_errors.append(step.baseline_errors)
        truths = step.true_landmark_ids or ("",) * len(step.matches)
        for match, truth in zip(step.matches, truths, strict=True):
            self.verdicts[_verdict(match, truth)] += 1
            if not match.landmark_id:
                self.unmatched[match.reason or "no reason given"] += 1
        for observation, true_m in zip(step.observations, step.true_distances_m, strict=True):
            if true_m is not None and np.isfinite(true_m):
                self.distances.append((observation.distance, true_m))
        self.detected[len(step.observations) + len(step.unmeasured)] += 1
        self.used[sum(1 for match in step.matches if match.landmark_id)] += 1
        self.unmeasured += len(step.unmeasured)
        self.states[step.state] += 1
        self.notes.update(level.upper() for level, _ in step.notes)
        if step.belief is not None:
            self.ess.append(step.belief.ess)
        for stage, seconds in step.timing_s.items():
            self.timing_s.setdefault(stage, []).append(seconds)


def summarise(tally: Tally, configuration: Mapping[str, Any]) -> dict[str, Any]:
    """The summary: JSON-safe, with None in place of what is not finite.

    Of errors that have a sign, ``mean`` and ``median`` keep it; ``rmse``, ``p95`` and ``max`` are of absolute values.
    """
    matched = sum(n for verdict, n in tally.verdicts.items() if verdict != "unmatched")
    unmatched = sum(tally.unmatched.values())
    summary = {
        "frames": tally.frames,
        "duration_s": (tally.last_stamp_ns - tally.first_stamp_ns) * 1e-9,
        "errors": {
            **_errors("", tally.errors),
            **_errors("baseline_", tally.baseline_errors),
        },
        "distance_errors": _distance_errors(tally.distances),
        "detections": {
            "total": matched + unmatched + tally.unmeasured,
            "matched": matched,
            "matched_right": tally.verdicts["right"],
            "matched_wrong": tally.verdicts["wrong"],
            "matched_unchecked": tally.verdicts["unknown"],
            "unmatched": unmatched,
            "unmatched_reasons": dict(tally.unmatched.most_common()),
            "unmeasured": tally.unmeasured,
        },
        "poles_per_frame": _histogram(tally.detected),
        "matched_poles_per_frame": _histogram(tally.used),
        "states": dict(tally.states.most_common()),
        "ess": {"median": float(np.median(tally.ess)), "min": min(tally.ess)} if tally.ess else {},
        "timing_ms": {stage: _timing(seconds) for stage, seconds in tally.timing_s.items()},
        "notes": dict(tally.notes.most_common()),
        **configuration,
    }
    safe: dict[str, Any] = json_safe(summary)
    return safe


def statistics(values: Sequence[float]) -> dict[str, float | int]:
    """Count, mean and median (signed), rmse, 95th percentile and maximum (absolute) of finite values."""
    array = np.asarray(values, dtype=float)
    array = array[np.isfinite(array)]
    if not len(array):
        return {}
    size = np.abs(array)
    return {
        "count": len(array),
        "mean": float(array.mean()),
        "median": float(np.median(array)),
        "rmse": float(np.sqrt((array**2).mean())),
        "p95": float(np.percentile(size, 95)),
        "max": float(size.max()),
    }


def json_safe(value: Any) -> Any:
    """``value`` in plain JSON types: numbers that are not finite become None, for JSON knows neither NaN nor ∞."""
    if isinstance(value, Mapping):
        return {str(key): json_safe(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        return json_safe(value.tolist())
    if isinstance(value, (list, tuple)):
        return [json_safe(entry) for entry in value]
    if isinstance(value, np.generic):
        return json_safe(value.item())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if value is None or isinstance(value, (bool, int, str)) else str(value)


def _errors(prefix: str, errors: Sequence[Errors]) -> dict[str, Any]:
    columns = {
        "position": [error.position_m for error in errors],
        "longitudinal": [error.longitudinal_m for error in errors],
        "lateral": [error.lateral_m for error in errors],
    }
    return {f"{prefix}{name}": statistics(values) for name, values in columns.items() if values}


def _distance_errors(distances: Sequence[tuple[Distance, float]]) -> dict[str, Any]:
    """Of all distances whose truth is known, matched or not; and of each expert alone."""
    groups = {"all": list(distances)}
    for pair in distances:
        groups.setdefault(f"expert {pair[0].expert}", []).append(pair)
    return {name: _distance_group(pairs) for name, pairs in groups.items() if pairs}


def _distance_group(pairs: Sequence[tuple[Distance, float]]) -> dict[str, float | int]:
    off = np.array([distance.mean_m - true_m for distance, true_m in pairs])
    deviation = np.sqrt([distance.variance_m2 for distance, _ in pairs])
    return {
        "count": len(off),
        "mean_absolute_m": float(np.abs(off).mean()),
        "bias_m": float(off.mean()),
        "rmse_m": float(np.sqrt((off**2).mean())),
        "coverage_95": float((np.abs(off) <= WITHIN_95 * deviation).mean()),
    }


def _histogram(counts: Counter[int]) -> dict[str, int]:
    return {str(number): counts[number] for number in sorted(counts)}


def _timing(seconds: Sequence[float]) -> dict[str, float]:
    milliseconds = np.asarray(seconds) * 1e3
    return {
        "median": float(np.median(milliseconds)),
        "p95": float(np.percentile(milliseconds, 95)),
        "max": float(milliseconds.max()),
    }


def _verdict(match: Match, truth: str) -> str:
    if not match.landmark_id:
        return "unmatched"
    if not truth:
        return "unknown"
    return "right" if match.landmark_id == truth else "wrong"
