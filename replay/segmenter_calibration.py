"""``scpf train segmenter --calibrate``: the score of weights fitted anew, to the pictures of another site."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from scpf.ingest.labelled_folders import labelled_images
from scpf.models import polenet
from scpf.models.errors import InputError, UsageError
from scpf.models.labelled_images import LabelledImage
from scpf.models.polenet_inference import for_inference
from scpf.models.polenet_validation import FITTED, REST, judge
from scpf.replay.segmenter_data import PaintedScenes, paint_to_weigh, told

FEWEST_TO_WEIGH = 100
"""Candidates without which six weights are not to be told: the order of the scores then stays as it was."""


def calibrate_segmenter(
    weights: Path,
    data: Sequence[Path],
    classes: Sequence[str],
    output: Path,
    painted: PaintedScenes,
    say: Callable[[str], None],
) -> polenet.WeightsInfo:
    """Writes ``weights`` to ``output`` with a score fitted to every other picture of ``data``; figures of the rest.

    ``painted``: weighs the evidence on street scenes, and fits only slope and constant to ``data``: where pictures hold
    few false candidates, these teach more. Without them, fewer candidates than `FEWEST_TO_WEIGH` set slope and constant
    alone, too. Raises UsageError where fewer than two pictures are given, InputError where the weights find no pole in
    those fitted to, and what loading and reading raise.
    """
    images: list[LabelledImage] = [image for path in data for image in labelled_images(path, classes)]
    if len(images) < 2:
        raise UsageError("fewer than two pictures to fit the score to", "name folders of labelled pictures")
    net, info = polenet.load(weights)
    folded = for_inference(net)
    names = ", ".join(path.name for path in data)
    fitted_to = f"score fitted to {(len(images) + 1) // 2} pictures of {names}"
    judged = judge(folded, told(images, say))
    right = [verdict.detected for verdict in judged.verdicts(FITTED)]
    if not any(right):
        text = f"{names}: none of the {len(right)} candidates in every other picture is a labelled pole"
        raise InputError(text, "label more pictures, or train with --start")
    if weighing := paint_to_weigh(painted, say):
        calibration = judged.calibration(judge(folded, told(weighing, say)), FITTED)
        fitted_to += f", its evidence weighed on {len(weighing)} painted scenes"
    elif len(right) < FEWEST_TO_WEIGH:
        calibration = judged.fit_scale(info.calibration, FITTED)
        fitted_to += f", {len(right)} candidates: slope and constant alone"
        say(f"{fitted_to} (more pictures, or --weigh-scenes 600, weigh the evidence anew)")
    else:
        calibration = judged.fit_calibration(FITTED)
    fitted = replace(
        info,
        calibration=calibration,
        figures=judged.figures(calibration, REST),
        trained_on=f"{info.trained_on}; {fitted_to}",
    )
    polenet.save(output, net, fitted)
    return fitted
