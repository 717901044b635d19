"""What each set of features is worth: the table of docs/DISTANCES.md, on simulated instances or those of a log.

python -m scpf.replay.distance_study
python -m scpf.replay.distance_study sample_logs/ring_road.mcap
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from scpf.models.distance_settings import PRESETS, DistanceSettings
from scpf.models.features import BOX
from scpf.replay.distance_comparisons import compare
from scpf.replay.distance_evaluation import Figures, Residuals, hold_out
from scpf.replay.distance_report import comparison_lines
from scpf.replay.distance_simulation import simulate
from scpf.replay.distance_training import RECORDED, Samples, gather, train

DEFAULT: Final = PRESETS["default"]
MIXTURES: Final = {
    "box": DistanceSettings(close=BOX, far=BOX),
    "box + thickness": DistanceSettings(close=(*BOX, "thickness"), far=(*BOX, "thickness")),
    "`default`, not warped": replace(DEFAULT, warped=False),
    "`default`": DEFAULT,
}
SINGLES: Final = {name: replace(MIXTURES[name], experts=1) for name in ("box + thickness", "`default`")}


@dataclass(frozen=True)
class Row:
    """Figures of one expert with one set of features: training part, and held out at random and by pole."""

    expert: str
    inputs: str
    train: Figures
    random: Figures
    by_pole: Figures


def study(samples: Samples, repetitions: int, seed: int) -> list[Row]:
    """A row for each expert and set of features, the experts together ("mixture"), and a single expert."""
    rows: list[Row] = []
    for name, settings in MIXTURES.items():
        rows += _rows(samples, settings, name, repetitions, seed)
    order = {expert: k for k, expert in enumerate(dict.fromkeys(row.expert for row in rows))}
    rows.sort(key=lambda row: order[row.expert])
    for name, settings in SINGLES.items():
        rows += [row for row in _rows(samples, settings, name, repetitions, seed) if row.expert == "single"]
    return rows


def markdown(rows: list[Row]) -> str:
    """The rows as a table: mean absolute errors (m), and shares in the 95 % band (of the latent variance alone)."""
    lines = [
        "| expert | inputs | training | at random | by pole | covered at random | covered by pole |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        maes = " | ".join(f"{each.mae_m:.2f}" for each in (row.train, row.random, row.by_pole))
        covered = " | ".join(
            f"{100 * each.coverage:.0f} % ({100 * each.function_coverage:.0f} %)"
            for each in (row.random, row.by_pole)
        )
        lines.append(f"| {row.expert} | {row.inputs} | {maes} | {covered} |")
    return "\n".join(lines)


def _rows(
    samples: Samples, settings: DistanceSettings, inputs: str, repetitions: int, seed: int
) -> Iterator[Row]:
    model = train(samples, settings, seed)
    random = hold_out(samples, model, settings, repetitions, seed, by_pole=False)
    poles = hold_out(samples, model, settings, repetitions, seed + 1, by_pole=True)
    parts = (random.train, random.validation, poles.validation)
    for k, name in enumerate(model.names):
        figures = [_of_expert(part, k) for part in parts]
        yield Row(name, inputs, *figures)
    if len(model.names) > 1:
        yield Row("mixture", inputs, *(_of_expert(part, None) for part in parts))


def _of_expert(part: Residuals, expert: int | None) -> Figures:
    found = part.figures(None if expert is None else part.expert == expert)
    nan = float("nan")
    return found or Figures(0, nan, nan, nan, nan, nan, nan)


def main(
    log: Path | None = None,
    *,
    segmenter: str = RECORDED,
    threshold: float = 0.9,
    map_error_m: tuple[float, float] = (0.0, 0.0),
    repetitions: int = 100,
    seed: int = 1,
) -> None:
    """Print the table for the instances of a drive log, or for simulated ones.

    Parameters
    ----------
    log
        A drive log with calibration, reference trajectory and map; without it, instances are simulated.
    segmenter
        As for `scpf train distance`; `recorded` takes the log's own masks.
    threshold
        Detections of a lower score are left out.
    map_error_m
        How far the simulated map is off for each pole, least and most (m).
    repetitions
        Repetitions of each hold-out.
    seed
        Seed of simulation, gate and hold-outs.
    """
    if log is None:
        samples = simulate(np.random.default_rng(seed), map_error_m=map_error_m)
    else:
        samples = gather([log], segmenter, threshold)
    poles = len(np.unique(samples.landmark_ids))
    print(f"{len(samples)} instances of {poles} poles, {repetitions} repetitions\n")
    print(markdown(study(samples, repetitions, seed)), end="\n\n")
    model = train(samples, PRESETS["paper"], seed)
    for by_pole in (False, True):
        for name, found in compare(
            samples, model, PRESETS["paper"], seed, repetitions, by_pole=by_pole
        ).items():
            print(*comparison_lines(f"{'by pole' if by_pole else 'at random'}, {name}", found), sep="\n")


if __name__ == "__main__":
    import cyclopts

    cyclopts.run(main)
