"""What went wrong in a replay: told in the log lane of the frame where it did, counted for its end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import replace

from scpf.replay.step import Step


class Remarks:
    """Collects warnings about a replay as a whole, and the problems of single frames by their kind."""

    def __init__(self, warnings: list[str], known_classes: Collection[str] | None) -> None:
        """``known_classes`` are the landmark classes whose distance is predicted; None where there is no model."""
        self._warnings = list(warnings)
        self._known_classes = known_classes
        self._problems: Counter[str] = Counter()
        self._untold = list(warnings)

    def warn(self, text: str) -> None:
        """Add a warning about the replay as a whole."""
        self._warnings.append(text)

    def count(self, kind: str, times: int) -> None:
        """Add a problem that was met that many times."""
        if times:
            self._problems[kind] += times

    def noted(self, step: Step) -> Step:
        """The step with notes of its problems; the first one's tell of the whole replay's, too."""
        met = [*step.frame.problems, *self._foreign_instances(step)]
        self._problems.update(kind for kind, _ in met)
        texts = [*(f"{kind}: {particulars}" for kind, particulars in met), *self._untold]
        self._untold = []
        return replace(step, notes=(*step.notes, *(("WARN", text) for text in texts))) if texts else step

    def all(self) -> list[str]:
        """One line a warning, one a kind of problem with its number."""
        return self._warnings + [f"{count} × {kind}" for kind, count in self._problems.items()]

    def _foreign_instances(self, step: Step) -> list[tuple[str, str]]:
        """A problem for each instance of a class whose distance nothing predicts: its kind, and the particulars."""
        if self._known_classes is None:
            return []
        classes = (instance.landmark_class for instance in step.unmeasured)
        return [
            (f"instance of unknown landmark class {name!r}", "the distance model was not trained on it")
            for name in classes
            if name not in self._known_classes
        ]
