"""Rows of a recording, sent many at a time: a call to Rerun costs a tenth of a millisecond, a row next to nothing."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

Columns = Callable[..., rr.ComponentColumnList]


class RowBatches:
    """Collects one row a frame for each entity and archetype, and sends all rows of one as one chunk.

    A row holds any number of instances; one of none shows nothing, as a cleared one. What is collected and not yet sent
    is lost when the process is killed, as what is not yet flushed is.
    """

    def __init__(self, rec: rr.RecordingStream) -> None:
        self._rec = rec
        self._batches: dict[tuple[str, Columns], _Batch] = {}
        self._styled: set[str] = set()
        self._frame, self._stamp_ns = 0, 0

    def at(self, frame: int, stamp_ns: int) -> None:
        """The frame that the rows to come belong to."""
        self._frame, self._stamp_ns = frame, stamp_ns

    def add(self, entity: str, columns: Columns, **values: Sequence[Any] | NDArray[Any]) -> None:
        """One row of ``entity``: ``columns`` of its archetype, ``values`` each component's instances, equally many.

        An array's instances lie along its first axis.
        """
        batch = self._batches.setdefault((entity, columns), _Batch())
        batch.frames.append(self._frame)
        batch.stamps_ns.append(self._stamp_ns)
        batch.lengths.append(len(next(iter(values.values()))))
        for name, instances in values.items():
            batch.values[name].append(instances)

    def number(self, entity: str, value: float | None) -> None:
        """One point of a line; a gap in it where there is none."""
        if value is None or not np.isfinite(value):
            self._rec.log(entity, rr.Clear(recursive=False))
        else:
            self.add(entity, rr.Scalars.columns, scalars=[value])

    def style_once(self, entity: str, style: rr.AsComponents) -> None:
        """Name and colour of a line that is known only when its first value comes."""
        if entity not in self._styled:
            self._styled.add(entity)
            self._rec.log(entity, style, static=True)

    def send(self) -> None:
        """Send all that was collected."""
        for (entity, columns), batch in self._batches.items():
            stamps = np.array(batch.stamps_ns, dtype="datetime64[ns]")
            indexes = [rr.TimeColumn("frame", sequence=batch.frames), rr.TimeColumn("time", timestamp=stamps)]
            values = {name: _joined(rows) for name, rows in batch.values.items()}
            self._rec.send_columns(entity, indexes, columns(**values).partition(batch.lengths))
        self._batches.clear()


@dataclass
class _Batch:
    """Rows of one entity and archetype that wait to be sent."""

    frames: list[int] = field(default_factory=list)
    stamps_ns: list[int] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    values: dict[str, list[Any]] = field(default_factory=lambda: defaultdict(list))


def _joined(rows: list[Any]) -> Sequence[Any] | NDArray[Any]:
    """All rows' instances one after the other."""
    if isinstance(rows[0], np.ndarray):
        return np.concatenate(rows)
    return [instance for row in rows for instance in row]
