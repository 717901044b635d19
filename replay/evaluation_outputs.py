"""The files of an evaluation: figures' numbers, pictures and trajectories, none of them replaced unasked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scpf.models.errors import InputError, UsageError
from scpf.models.whole_files import whole
from scpf.replay.evaluation import Result
from scpf.replay.evaluation_plan import Plan
from scpf.replay.evaluation_report import as_csv, as_json
from scpf.replay.evaluation_scenarios import Scenarios
from scpf.replay.evaluation_traces import estimate_name, truth_name, write_estimate, write_truth


@dataclass(frozen=True)
class Outputs:
    """What to write: two files, and two folders of files; None for what is not wanted."""

    json: Path | None = None
    csv: Path | None = None
    figures: Path | None = None
    tum: Path | None = None

    def check(self, plan: Plan, overwrite: bool) -> None:
        """Before the work: make the folders, so that hours of it do not end for want of one.

        UsageError for a file that is there already, InputError for a folder that cannot be made, MissingError where
        figures need matplotlib.
        """
        if self.figures is not None:
            from scpf.replay.distance_figures import check_matplotlib

            check_matplotlib()
        there = next((path for path in self.paths(plan) if path.exists()), None)
        if there is not None and not overwrite:
            raise UsageError(f"{there} exists", "choose another name, or give --overwrite")
        for folder in {path.parent for path in self.paths(plan)}:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"{folder} cannot be made ({error.strerror})") from error

    def paths(self, plan: Plan) -> list[Path]:
        """Every file that ``write`` makes."""
        paths = [path for path in (self.json, self.csv) if path is not None]
        if self.figures is not None:
            from scpf.replay.evaluation_figures import figure_paths

            paths += figure_paths(self.figures, plan)
        if self.tum is not None:
            drives = [(name, drive) for name in plan.names for drive in range(plan.drives_each)]
            names = [truth_name(*one) for one in drives]
            names += [
                estimate_name(p, *one, s) for one in drives for p in plan.presets for s in plan.sigmas_m
            ]
            paths += [self.tum / name for name in names]
        return paths

    def write(self, plan: Plan, results: Sequence[Result], scenarios: Scenarios) -> None:
        """Write them all, each whole or not at all. InputError where a place cannot be written to."""
        for path, text in ((self.json, as_json(plan, results) + "\n"), (self.csv, as_csv(results))):
            if path is not None:
                _write(path, text)
        if self.figures is not None:
            from scpf.replay.evaluation_figures import draw

            draw(self.figures, plan, results, scenarios)
        if self.tum is not None:
            for (name, drive), scenario in scenarios.items():
                write_truth(self.tum / truth_name(name, drive), scenario)
            for one in results:
                path = self.tum / estimate_name(one.preset, one.case, one.drive, one.sigma_m)
                write_estimate(path, scenarios[one.case, one.drive], one.trace)


def _write(path: Path, text: str) -> None:
    try:
        with whole(path) as partial:
            partial.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror})") from error
