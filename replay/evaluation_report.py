"""The evaluation's figures as a table for the terminal, JSON and CSV."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

from scpf.replay.evaluation import Result, pooled
from scpf.replay.evaluation_conditions import Conditions
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_presets import PRESETS

COLUMNS: Final = (
    # key, heading, format
    ("preset", "preset", "s"),
    ("case", "case", "s"),
    ("sigma_m", "σ_v m", ".3g"),
    ("runs", "runs", "d"),
    ("mean_m", "mean m", ".2f"),
    ("median_m", "median", ".2f"),
    ("rmse_m", "RMSE", ".2f"),
    ("p95_m", "95 %", ".2f"),
    ("max_m", "max", ".1f"),
    ("longitudinal_m", "along", ".2f"),
    ("lateral_m", "across", ".2f"),
    ("poles_0_m", "0 poles", ".2f"),
    ("poles_1_m", "1", ".2f"),
    ("poles_2_m", "2", ".2f"),
    ("poles_3_m", "3+", ".2f"),
    ("diverged_share", "diverged", ".0%"),
    ("nees", "NEES", ".1f"),
    ("nees_bounds", "bounds", "s"),
    ("inside_95", "in 95 %", ".2f"),
)


def as_table(plan: Plan, results: Sequence[Result]) -> str:
    """A row a preset, case and GPS deviation, drives pooled."""
    rows = [[_cell(row, key, spec) for key, _, spec in COLUMNS] for row in pooled(results)]
    heads = [head for _, head, _ in COLUMNS]
    widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    lines = []
    for row in [heads, *rows]:
        cells = [
            cell.ljust(w) if k < 2 else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    matching = "known" if plan.known_matching else "unknown"
    drives = f"{plan.drives} drives of {plan.frames} frames"
    if plan.recordings:
        drives = f"{len(plan.recordings)} recorded drives"
    lines.append(f"{drives}, {plan.runs} runs each, matching {matching}")
    said = described(plan.conditions)
    if said:
        lines.append(said)
    return "\n".join(lines)


def _cell(row: Mapping[str, Any], key: str, spec: str) -> str:
    if key == "nees_bounds":
        return f"{row['nees_low']:.1f}–{row['nees_high']:.1f}"
    return "–" if row[key] is None else format(row[key], spec)


def described(conditions: Conditions) -> str:
    """What differs from the cases, in words; empty where nothing does."""
    said = [f"no GPS from {start:g} to {end:g} s" for start, end in conditions.gps_outages_s]
    if not conditions.gps_after_start:
        said.append("no GPS after the first frame")
    if conditions.drop_out > 0.0:
        said.append(f"{100 * conditions.drop_out:g} % of the detections lost")
    if conditions.map_error_m is not None:
        said.append("map {:g}–{:g} m off".format(*conditions.map_error_m))
    if conditions.range_error_m is not None:
        said.append("range errors {:g} m close and {:g} m far".format(*conditions.range_error_m))
    if conditions.correlated is not None:
        said.append(f"range errors {'that last for a second' if conditions.correlated else 'white'}")
    return "; ".join(said)


def as_json(plan: Plan, results: Sequence[Result]) -> str:
    """Plan, settings of its presets, pooled figures and those of each drive."""
    from importlib.metadata import version

    document: dict[str, Any] = {
        "scpf": version("scpf"),
        "plan": asdict(plan),
        "presets": {name: asdict(PRESETS[name]) for name in plan.presets},
        "pooled": pooled(results),
        "drives": [result.as_row() for result in results],
    }
    return json.dumps(document, indent=1, allow_nan=False)


def as_csv(results: Sequence[Result]) -> str:
    """One line a preset, case, GPS deviation and drive."""
    buffer = io.StringIO()
    rows = [result.as_row() for result in results]
    writer = csv.DictWriter(buffer, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()
