"""The folder of one training: its configuration, its curves as CSV and for TensorBoard, its weights and its state."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from scpf.models.errors import InputError, MissingError
from scpf.models.whole_files import whole

CONFIGURATION: Final = "configuration.json"
MAY_DIFFER: Final = ("device", "workers", "limit_s", "scpf", "patience")
"""What a training may go on with otherwise than it began."""


class TrainingRun:
    """A folder for one training; ``files`` are those that a training leaves there."""

    def __init__(
        self,
        folder: Path,
        configuration: Mapping[str, Any],
        *,
        resume: bool,
        overwrite: bool,
        files: tuple[str, ...],
    ) -> None:
        """Opens a new folder, or one to go on in.

        Raises InputError where another training is there, or was begun otherwise than this one shall go on, and
        MissingError where there is none to resume.
        """
        self.folder = folder
        path = folder / CONFIGURATION
        wanted = json.loads(json.dumps(configuration))
        if resume:
            if not path.is_file():
                raise MissingError(f"{folder}: no training to go on with", "leave --resume out to begin one")
            begun = json.loads(path.read_text())
            differing = [key for key in {**begun, **wanted} if begun.get(key) != wanted.get(key)]
            differing = [key for key in differing if key not in MAY_DIFFER]
            if differing:
                what = ", ".join(f"{key} {begun.get(key)!r}" for key in differing)
                raise InputError(
                    f"{folder}: that training was begun with {what}", "resume it with the same options"
                )
        elif path.exists() and not overwrite:
            raise InputError(
                f"{folder}: holds a training", "--resume it, --overwrite it, or choose another --run"
            )
        folder.mkdir(parents=True, exist_ok=True)
        if not resume:
            for name in (*files, "loss.csv", "validation.csv"):
                (folder / name).unlink(missing_ok=True)
            for events in folder.glob("events.out.tfevents.*"):
                events.unlink()
            path.write_text(json.dumps(wanted, indent=1) + "\n")
        self._rows = {kind: _read_rows(folder / f"{kind}.csv") for kind in ("loss", "validation")}
        self._board = _tensorboard(folder)

    @property
    def has_tensorboard(self) -> bool:
        """Whether TensorBoard's curves are written, too."""
        return self._board is not None

    def curves(self, kind: str, step: int, values: Mapping[str, float]) -> None:
        """Adds a row to ``loss.csv`` or ``validation.csv``; rows of later steps, lost by an interruption, go."""
        rows = [row for row in self._rows[kind] if int(row["step"]) < step]
        rows.append({"step": str(step), **{name: f"{value:.6g}" for name, value in values.items()}})
        self._rows[kind] = rows
        path = self.folder / f"{kind}.csv"
        with whole(path) as partial, partial.open("w", newline="") as file:
            names = dict.fromkeys(name for row in rows for name in row)
            writer = csv.DictWriter(file, list(names), restval="")
            writer.writeheader()
            writer.writerows(rows)
        if self._board is not None:
            for name, value in values.items():
                self._board.add_scalar(f"{kind}/{name}", value, step)
            self._board.flush()

    def close(self) -> None:
        """Closes TensorBoard's file."""
        if self._board is not None:
            self._board.close()


def _read_rows(path: Path) -> list[dict[str, str]]:
    if not path.is_file():
        return []
    with path.open(newline="") as file:
        return [row for row in csv.DictReader(file) if (row.get("step") or "").isdigit()]


def _tensorboard(folder: Path) -> Any:
    try:
        from tensorboardX import SummaryWriter
    except ImportError:  # optional: scpf[train]
        return None
    return SummaryWriter(str(folder), write_to_disk=True)
