"""Which landmarks of a foreign map one takes: by class, by id; each with an id that no other has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

from scpf.ingest.map_source import MapSource, SourcePoint, printable
from scpf.models.errors import InputError


@dataclass
class Choice:
    """The landmarks taken, with their ids, and what was not: by class, and by id."""

    points: list[SourcePoint] = field(default_factory=list)
    ids: list[str] = field(default_factory=list)
    other_class: Counter[str] = field(default_factory=Counter)
    not_selected: int = 0
    notes: list[str] = field(default_factory=list)


def choose(
    source: MapSource,
    classes: Collection[str] | None = None,
    select: Collection[str] = (),
    exclude: Collection[str] = (),
) -> Choice:
    """The landmarks of ``classes`` (None: those that the source takes), of ``select`` (empty: all), less ``exclude``.

    Where landmarks share an id, #2, #3, … is added. Raises InputError for an id that no landmark has.
    """
    choice = Choice()
    wanted = source.classes if classes is None else frozenset(classes)
    present = {point.landmark_class for point in source.points}
    if classes is not None and (unknown := set(classes) - present):
        found = ", ".join(map(printable, sorted(present)[:10])) or "none"
        choice.notes.append(f"no landmark of class {', '.join(sorted(unknown))} (found: {found})")
    ids = list(_unique(source.points))
    if missing := (set(select) | set(exclude)) - set(ids):
        raise InputError(f"{source.path}: no landmark has the id {min(missing)!r}")
    renamed = sum(name != point.id for name, point in zip(ids, source.points, strict=True))
    if renamed:
        choice.notes.append(f"{renamed} landmarks shared an id: #2, #3, … was added")
    for name, point in zip(ids, source.points, strict=True):
        if wanted is not None and point.landmark_class not in wanted:
            choice.other_class[point.landmark_class] += 1
        elif (select and name not in select) or name in exclude:
            choice.not_selected += 1
        else:
            choice.points.append(point)
            choice.ids.append(name)
    return choice


def _unique(points: Collection[SourcePoint]) -> Iterator[str]:
    """Each point's id, with ``#2``, ``#3``, … where an earlier one has it."""
    used: set[str] = set()
    counts: Counter[str] = Counter()
    for point in points:
        name = point.id
        while name in used:
            counts[point.id] += 1
            name = f"{point.id}#{counts[point.id] + 1}"
        used.add(name)
        yield name
