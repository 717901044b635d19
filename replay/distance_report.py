"""The figures of a distance model for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def table(results: Mapping[str, Any], written: list[Path]) -> str:
    """The results of a training for the terminal, the written files on its last lines."""
    lines = [f"{results['frames']} frames"]
    lines += [f"  left out: {count} {reason}" for reason, count in results["dropped"].items()]
    for name, figures in results["classes"].items():
        lines += _of_class(name, figures)
    return "\n".join([*lines, *(f"{path}" for path in written)])


def _of_class(name: str, figures: Mapping[str, Any]) -> list[str]:
    lines = [f"{name}: {figures['samples']} samples of {figures['poles']} poles"]
    heads = (
        ("n", 7),
        ("train", 8),
        ("MAE m", 8),
        ("bias", 8),
        ("RMSE", 8),
        ("95 %", 7),
        ("(f)", 7),
        ("NLL", 8),
    )
    lines.append(" " * 34 + "".join(f"{head:>{width}}" for head, width in heads))
    blocks = (
        ("random", "held out at random"),
        ("by_pole", "held out by pole"),
        ("by_pole_searched", "… hyperparameters anew"),
    )
    for key, title in blocks:
        for expert, row in figures.get(key, {}).get("validation", {}).items():
            lines.append(_row(f"{title}, {expert}", row, figures[key]["train"].get(expert)))
    for key, title in (("by_pole_bands", "by pole"), ("cross_fitted", "cross-fitted")):
        lines += [_row(f"{title}, {name}", row) for name, row in figures.get(key, {}).items()]
    for split, title in (("random", "at random"), ("by_pole", "by pole")):
        for name, found in figures.get("comparisons", {}).get(split, {}).items():
            lines += comparison_lines(f"{title}, {name}", found)
    return lines


def _row(title: str, row: Mapping[str, Any] | None, train: Mapping[str, Any] | None = None) -> str:
    if row is None:
        return f"{title:<34}{0:>7}"
    trained = f"{train['mae_m']:8.2f}" if train else f"{'':8}"
    return (
        f"{title:<34}{row['n']:7d}{trained}{row['mae_m']:8.2f}{row['bias_m']:8.2f}{row['rmse_m']:8.2f}"
        f"{row['coverage']:7.2f}{row['function_coverage']:7.2f}{row['nll']:8.2f}"
    )


def comparison_lines(title: str, found: Mapping[str, Any] | None) -> list[str]:
    """A line for each pair of Tukey's test: means, difference with its interval, and what follows."""
    if found is None:
        return [f"{title}: too few samples to compare"]
    lines = []
    for row in found["pairs"]:
        first, second = row["pair"]
        verdict = (
            "no difference"
            if row["low_m"] <= 0.0 <= row["high_m"]
            else (f"{second} is better" if row["difference_m"] > 0.0 else f"{first} is better")
        )
        means = ", ".join(f"{name} {found['mae_m'][name]:.2f} m" for name in (first, second))
        lines.append(
            f"{title}: {means}, difference {row['difference_m']:+.3f} m "
            f"[{row['low_m']:+.3f}, {row['high_m']:+.3f}], p = {row['p']:.3g}: {verdict}"
        )
    return lines
