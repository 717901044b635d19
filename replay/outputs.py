"""The files that a replay leaves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scpf.models.errors import InputError
from scpf.models.whole_files import whole


@dataclass(frozen=True)
class Outputs:
    """``NAME.rrd``, ``NAME.results.mcap`` and ``NAME.json``."""

    recording: Path
    results: Path
    summary: Path

    @staticmethod
    def of(directory: Path, name: str) -> Outputs:
        """The three paths for ``name`` in ``directory``."""
        return Outputs(
            directory / f"{name}.rrd", directory / f"{name}.results.mcap", directory / f"{name}.json"
        )

    def refuse_existing(self) -> None:
        """Raise InputError where one of the files is there already."""
        for path in (self.recording, self.results, self.summary):
            if path.exists():
                raise InputError(f"{path} exists", "use --overwrite, or another --output or --name")

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write ``NAME.json``, whole or not at all."""
        with whole(self.summary) as partial:
            partial.write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n")
