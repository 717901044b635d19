"""A simulated drive from settings to files: rendered, resumed after an interruption, and written whole."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from scpf.models.errors import DamagedError, InputError
from scpf.models.road_map import RoadMap, to_geojson
from scpf.sample_logs.drive_frames import DriveSettings, SimulatedDrive, check
from scpf.sample_logs.finished_frames import FinishedFrame, load_frame
from scpf.sample_logs.render_jobs import open_folder, render_all
from scpf.sample_logs.renderer import warm_up
from scpf.sample_logs.simulated_log import ins_of, versions, write_log
from scpf.sample_logs.simulated_raw import check_raw_folder, write_raw
from scpf.sample_logs.training_places import SetSettings


class Report(Protocol):
    """Who is told how a rendering goes."""

    def say(self, line: str) -> None:
        """A line that stays."""
        ...

    def frame(self, done: int, resumed: int, count: int) -> None:
        """``done`` of ``count`` frames are finished, ``resumed`` of them by an earlier run."""
        ...


@dataclass(frozen=True)
class DriveReport:
    """What became of a simulation."""

    path: str
    frames: int
    rendered: int
    """By this run; the rest was there."""
    dropped: int
    """Frames that the simulated camera lost."""
    duration_s: float
    weather: str
    poles_shown: int
    poles_mapped: int
    left_out: list[str]
    """Raw files that could not be written, and why."""


def simulate_drive(
    output: Path,
    settings: DriveSettings,
    report: Report,
    *,
    road_map: RoadMap | None = None,
    raw: Path | None = None,
    workers: int = 1,
    overwrite: bool = False,
) -> DriveReport:
    """Render a drive along ``road_map`` (None: the Ring Road) and write it as the drive log ``output``.

    ``raw``: a new folder for the files that the log could have been ingested from.

    Finished frames lie in a folder beside it, see ``frames_folder``, until the log is whole: a later call with equal
    settings goes on with them. The bytes depend on the settings alone, not on ``workers``. Raises UsageError and
    InputError before anything is rendered.
    """
    check(settings)
    if output.exists() and not overwrite:
        raise InputError(f"{output} exists", "choose another name, or give --overwrite")
    if not output.parent.is_dir():
        raise InputError(f"{output}: there is no folder {output.parent}")
    if raw is not None:
        check_raw_folder(raw)
    drive = SimulatedDrive(settings, road_map)
    count, folder = len(drive.vehicle), frames_folder(output)
    open_folder(folder, identity(settings, road_map), overwrite=overwrite)
    warm_up(report.say)
    rendered = render_all(folder, count, replace(drive), workers=workers, progress=report.frame)
    ins, left_out = ins_of(drive), []
    if raw is not None:
        left_out = write_raw(folder / "raw", drive, ins, partial(stored, folder, count))
    shown = write_log(output, drive, ins, stored(folder, count), overwrite=overwrite)
    if raw is not None:
        shutil.rmtree(raw, ignore_errors=True)  # empty, see above
        shutil.move(folder / "raw", raw)
    shutil.rmtree(folder)
    stamps_ns = drive.vehicle.stamps_ns
    return DriveReport(
        str(output),
        count,
        rendered,
        len(drive.vehicle.dropped_numbers),
        float(stamps_ns[-1] - stamps_ns[0]) * 1e-9,
        drive.weather.name,
        shown,
        len(drive.road.poles),
        left_out,
    )


def frames_folder(output: Path) -> Path:
    """Where the finished frames of a log lie while others are still being rendered."""
    return output.with_name(f"{output.stem}.frames")


def stored(folder: Path, count: int) -> Iterator[FinishedFrame]:
    """The finished frames 0 to ``count`` - 1 of a folder. Raises DamagedError where one has gone."""
    for index in range(count):
        frame = load_frame(folder, index)
        if frame is None:
            raise DamagedError(f"{folder}: frame {index} has gone", "run the same command again")
        yield frame


def identity(settings: DriveSettings | SetSettings, road_map: RoadMap | None) -> dict[str, Any]:
    """All that a frame depends on, as JSON; frames of another program are not taken up either."""
    mapped = None if road_map is None else json.dumps(to_geojson(road_map), sort_keys=True)
    return {
        "settings": asdict(settings),
        "map": None if mapped is None else hashlib.sha256(mapped.encode()).hexdigest(),
        "versions": versions(),
        "program": program_hash(),
    }


def program_hash() -> str:
    """SHA-256 of the simulator's own source files."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
