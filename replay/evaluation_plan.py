"""What an evaluation is to do: one frozen record, saved with its figures."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from scpf.models.errors import UsageError
from scpf.replay.evaluation_conditions import Conditions
from scpf.replay.evaluation_presets import PRESETS
from scpf.replay.protocol import CASES, FRAMES

FEWEST_FRAMES: Final = 50


@dataclass(frozen=True)
class Plan:
    """What to evaluate. ``runs`` Monte Carlo runs are made on each drive.

    Drives are ``drives`` simulated ones of each case, of ``frames`` frames; or, where there are any, the
    ``recordings``: results files of replays, with ``map_path`` instead of the map attached to them.
    """

    presets: tuple[str, ...] = ("paper", "pf", "ekf", "default")
    cases: tuple[str, ...] = ("P", "S0", "S1", "S2")
    sigmas_m: tuple[float, ...] = (3.0, 10.0)
    runs: int = 50
    drives: int = 2
    frames: int = FRAMES
    known_matching: bool = False
    seed: int = 0
    conditions: Conditions = field(default_factory=Conditions)
    recordings: tuple[str, ...] = ()
    map_path: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The cases, or the recordings by name."""
        return tuple(recording_name(path) for path in self.recordings) or self.cases

    @property
    def drives_each(self) -> int:
        """Drives of each name: a recording is one."""
        return 1 if self.recordings else self.drives

    def check(self) -> None:
        """UsageError where the plan cannot be carried out."""
        for chosen, known, what in ((self.presets, PRESETS, "preset"), (self.cases, CASES, "case")):
            for name in chosen:
                if name not in known:
                    raise UsageError(f"no {what} {name!r} to evaluate", f"{what}s: {', '.join(known)}")
        if not self.presets or not self.sigmas_m or not (self.cases or self.recordings):
            raise UsageError("nothing to evaluate", "name at least one preset, case and GPS deviation")
        if min(self.sigmas_m) <= 0.0 or self.runs < 1 or self.drives < 1 or self.seed < 0:
            raise UsageError("--sigma, --runs and --drives are positive, --seed is not negative")
        if not FEWEST_FRAMES <= self.frames <= FRAMES:
            raise UsageError(f"--frames lies between {FEWEST_FRAMES} and {FRAMES}")
        self.conditions.check()
        self._check_recordings()

    def _check_recordings(self) -> None:
        if self.map_path is not None and not self.recordings:
            raise UsageError("--map is for recorded observations", "name a .results.mcap, or leave --map out")
        if not self.recordings:
            return
        if self.conditions.range_error_m is not None or self.conditions.correlated is not None:
            raise UsageError(
                "recorded observations have their own errors", "leave out --range-error and --errors"
            )
        name, count = Counter(recording_name(path) for path in self.recordings).most_common(1)[0]
        if count > 1:
            raise UsageError(
                f"{count} recordings are called {name!r}", "tables tell them apart by their names"
            )


def recording_name(path: str) -> str:
    """What tables call a recording: its file's name without endings."""
    return Path(path).name.removesuffix(".mcap").removesuffix(".results")
