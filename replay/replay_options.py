"""What is typed after ``scpf replay``, put into the terms of the engine; what makes no sense is refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scpf.models.errors import UsageError
from scpf.replay.frames import Window
from scpf.replay.outputs import Outputs
from scpf.replay.settings import Settings


@dataclass(frozen=True)
class Job:
    """One replay of one log, with the settings and outputs of its own."""

    log: Path
    outputs: Outputs
    settings: Settings


def given(**values: Any) -> dict[str, Any]:
    """Those of the values that were typed."""
    return {name: value for name, value in values.items() if value is not None}


def interval(text: str) -> tuple[float, float]:
    """The interval of ``A:B`` in seconds."""
    begin, _, end = text.partition(":")
    try:
        seconds = (float(begin), float(end))
    except ValueError:
        seconds = (0.0, 0.0)
    if not seconds[0] < seconds[1]:
        raise UsageError(f"--gps-outage {text}: not an interval", "write A:B, seconds after the first image")
    return seconds


def pace_factor(text: str) -> float:
    """How many times real time the pace ``max``, ``realtime`` or a number is."""
    try:
        factor = {"max": math.inf, "realtime": 1.0}.get(text) or float(text)
    except ValueError:
        factor = 0.0
    if not factor > 0:
        raise UsageError(f"--pace {text}: not a pace", "max, realtime, or a factor such as 0.5")
    return factor


def window(start_s: float, stop_s: float, duration_s: float | None, rate_hz: float) -> Window:
    """The part of the log that the options ask for; ``stop_s`` is ∞ where none was typed."""
    if duration_s is not None:
        if not math.isinf(stop_s):
            raise UsageError(
                f"--stop {stop_s:g} --duration {duration_s:g}: both say where to end", "give one of them"
            )
        if not duration_s > 0:
            raise UsageError(f"--duration {duration_s:g}: a duration is positive")
        stop_s = start_s + duration_s
    if not 0 <= start_s < stop_s:
        raise UsageError(f"--start {start_s:g} --stop {stop_s:g}: nothing lies between them")
    if not rate_hz > 0:
        raise UsageError(f"--rate {rate_hz:g}: a rate is positive")
    return Window(start_s, stop_s, rate_hz)


def jobs(logs: Sequence[Path], output: Path, name: str, settings: Settings, passes: int) -> list[Job]:
    """The replays to run: each log ``passes`` times, from the second pass on with the next seed and a numbered name.

    The names are those of the logs, or ``name`` where there is one log.
    """
    if not logs:
        raise UsageError("which drive log?", "scpf replay LOG ...")
    if name and len(logs) > 1:
        raise UsageError(f"--name {name} for {len(logs)} logs", "each is called by its own name")
    if passes < 1:
        raise UsageError(f"--loop {passes}: how many times the drive is replayed, at least once")
    planned = list(_planned(logs, output, name, settings, passes))
    if len({job.outputs for job in planned}) < len(planned):
        raise UsageError("two logs of one name", "replay them into different folders")
    return planned


def _planned(logs: Sequence[Path], output: Path, name: str, settings: Settings, passes: int) -> Iterator[Job]:
    for number in range(passes):
        for log in logs:
            called = name or log.stem
            if number:
                called = f"{called}.{number + 1}"
            yield Job(log, Outputs.of(output, called), replace(settings, seed=settings.seed + number))
