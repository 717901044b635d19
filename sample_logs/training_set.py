"""A simulated training set from settings to a folder of labelled pictures: rendered, resumed, and written whole."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from scpf.ingest.drive_log import library_name
from scpf.models.errors import InputError, UsageError
from scpf.models.road_map import RoadMap
from scpf.sample_logs.drive_frames import check_pictures
from scpf.sample_logs.finished_frames import FinishedFrame
from scpf.sample_logs.labels_out import LabelFormat, write_labels
from scpf.sample_logs.render_jobs import open_folder, render_all
from scpf.sample_logs.renderer import warm_up
from scpf.sample_logs.simulated_log import versions
from scpf.sample_logs.simulated_road import simulated_road
from scpf.sample_logs.simulation import Report, frames_folder, identity, stored
from scpf.sample_logs.training_places import PICTURES_AT_A_PLACE, SetSettings, TrainingPictures

MOST_PICTURES = 1_000_000
WRITTEN = ("about.json", "instances.json")
"""One of these stands in every training set."""


@dataclass(frozen=True)
class SetReport:
    """What became of a training set."""

    path: str
    pictures: int
    rendered: int
    """By this run; the rest was there."""
    poles: int
    weathers: dict[str, int]
    """Pictures of each."""


def simulate_set(
    output: Path,
    settings: SetSettings,
    labels: LabelFormat,
    report: Report,
    *,
    road_map: RoadMap | None = None,
    workers: int = 1,
    overwrite: bool = False,
) -> SetReport:
    """Render labelled pictures from random places of ``road_map`` (None: the Ring Road) into the folder ``output``.

    Finished pictures lie in a folder beside it, see ``frames_folder``, until the set is whole: a later call with equal
    settings goes on with them. The bytes depend on the settings alone. Raises UsageError and InputError before
    anything is rendered.
    """
    check_pictures(settings.weather, settings.width_px, settings.quality)
    if not 1 <= settings.count <= MOST_PICTURES:
        raise UsageError(f"{settings.count} pictures", f"give 1 to {MOST_PICTURES}")
    if settings.seed < 0:
        raise UsageError("a negative seed")
    _check_output(output, overwrite)
    attribution = simulated_road(road_map, seed=0).attribution
    folder = frames_folder(output)
    open_folder(folder, identity(settings, road_map), overwrite=overwrite)
    warm_up(report.say)
    pictures = TrainingPictures(settings, road_map)
    rendered = render_all(
        folder,
        settings.count,
        pictures,
        workers=workers,
        together=PICTURES_AT_A_PLACE,
        progress=report.frame,
    )
    about = {
        "made_by": library_name(),
        "settings": asdict(settings),
        "map": attribution,
        "versions": versions(),
    }
    weathers: Counter[str] = Counter()

    def named() -> Iterator[tuple[str, FinishedFrame]]:
        for index, frame in enumerate(stored(folder, settings.count)):
            weathers[str(frame.facts["weather"])] += 1
            yield f"{index:06d}", frame

    whole = folder / "set"
    shutil.rmtree(whole, ignore_errors=True)
    poles = write_labels(whole, named(), labels, about)
    shutil.rmtree(output, ignore_errors=True)  # empty, or an earlier set, see _check_output
    whole.replace(output)
    shutil.rmtree(folder)
    return SetReport(str(output), settings.count, rendered, poles, dict(sorted(weathers.items())))


def _check_output(output: Path, overwrite: bool) -> None:
    if not output.parent.is_dir():
        raise InputError(f"{output}: there is no folder {output.parent}")
    if not output.exists() or (output.is_dir() and not any(output.iterdir())):
        return
    if not overwrite:
        raise InputError(f"{output} exists", "choose another name, or give --overwrite")
    if not any((output / name).is_file() for name in WRITTEN):
        # Never empty a folder that this program did not fill.
        raise InputError(f"{output} exists and holds no simulated training set", "choose another output")
