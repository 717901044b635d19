"""One training of ``scpf train segmenter``: its run folder opened, trained in, and the weights put in place."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from scpf.models import polenet
from scpf.models.polenet_training import train
from scpf.models.training_settings import BEST, FINAL, LAST, STATE, TrainingSettings
from scpf.models.whole_files import whole
from scpf.replay.segmenter_data import TrainingPictures
from scpf.replay.training_run import TrainingRun


def run_training(
    gathered: TrainingPictures,
    classes: Sequence[str],
    output: Path,
    folder: Path,
    settings: TrainingSettings,
    seed: int,
    licence: str,
    say: Callable[[str], None],
    *,
    resume: bool,
    overwrite: bool,
) -> polenet.WeightsInfo:
    """Trains in ``folder``, copies the weights to ``output`` and returns what they say of themselves.

    Raises InputError and MissingError where the folder cannot be begun or gone on in.
    """
    configuration = {
        "scpf": version("scpf"),
        "seed": seed,
        "classes": classes,
        "pictures": gathered.names,
        **asdict(settings),
        "start": None if settings.start is None else str(settings.start),
        "limit_s": settings.limit_s if math.isfinite(settings.limit_s) else None,
    }
    opened = TrainingRun(
        folder, configuration, resume=resume, overwrite=overwrite, files=(BEST, LAST, FINAL, STATE)
    )
    if not opened.has_tensorboard:
        say("curves as CSV alone: TensorBoard's need scpf[train]")
    trained_on = f"{gathered.counted} (seed {seed}, at most {settings.steps} steps)"
    if settings.keep_start:
        trained_on += f"; {settings.keep_start:g} of the weights are those that it started from"
    if gathered.weighing:
        trained_on += f"; evidence weighed on {len(gathered.weighing)} painted scenes"
    about = polenet.WeightsInfo(trained_on, licence=licence)
    try:
        info = train(
            gathered.training, gathered.held_out, folder, settings, seed, about,
            resume=resume, report=say, curves=opened.curves, weighing=gathered.weighing,
        )  # fmt: skip
    except KeyboardInterrupt:
        say(f"interrupted: go on with --resume; the weights so far are {folder / settings.kept}")
        raise
    finally:
        opened.close()
    with whole(output) as partial:
        shutil.copyfile(folder / FINAL, partial)
    return info
