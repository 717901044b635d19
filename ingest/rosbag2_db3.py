"""rosbag2's SQLite storage: a database of nobody in particular, opened read-only and within bounds."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Final

from scpf.ingest.bag_source import BagChannel, BagMessage
from scpf.models.errors import DamagedError

MAX_MESSAGE_BYTES: Final = 512 << 20
MAX_STEPS: Final = 100_000
"""Ticks of 100,000 SQLite instructions between two messages: a database built to keep us busy is given up."""
MAX_TOPICS: Final = 100_000

# sqlite3 decodes the names in its own messages, and fails at those of a damaged database.
_ERRORS: Final = (sqlite3.Error, OverflowError, UnicodeDecodeError)

_SCANS: Final = (("", "timestamp, id"), ("NOT INDEXED", "id"), ("NOT INDEXED", "id DESC"))
"""Ways through the messages: by the index of times; where that is damaged, from the first; and from the last."""


class Db3:
    """A .db3 file, opened for reading; ``stack`` closes it. Raises DamagedError for a file that is none."""

    def __init__(self, path: Path, stack: ExitStack) -> None:
        self._path = path
        self.losses: list[str] = []
        self.notes: list[str] = []
        self._steps = 0
        # Messages that a crash left in the write-ahead log are read with it; else nothing beside the file is touched.
        unfinished = path.with_name(path.name + "-wal")
        pending = unfinished.exists() and unfinished.stat().st_size > 0
        try:
            self._base = self._open(stack, pending)
            self._base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE_BYTES)
            self._base.set_progress_handler(self._tick, 100_000)
            self._base.text_factory = lambda text: text.decode(errors="replace")
            self._base.execute("PRAGMA trusted_schema=OFF")
            self._topics = self._describe()
            self.channels = [channel for _, channel in self._topics]
            self.start_ns = self._first()
        except _ERRORS as error:
            raise self._damaged(error) from error

    def messages(
        self, wanted: Collection[int], start_ns: int | None, end_ns: int | None
    ) -> Iterator[BagMessage]:
        """See BagSource."""
        numbers = {self._topics[number][0]: number for number in wanted}
        if not numbers:
            return
        marks = ",".join("?" * len(numbers))
        where, bounds = f"topic_id IN ({marks})", list(numbers)
        for bound, sign in ((start_ns, ">="), (end_ns, "<")):
            if bound is not None:
                where += f" AND timestamp {sign} ?"
                bounds.append(min(bound, 2**63 - 1))
        odd = 0
        for topic, stamp, data in self._scan("data", where, bounds):
            if not isinstance(data, bytes) or topic not in numbers or stamp < 0:
                odd += 1
                continue
            yield BagMessage(numbers[topic], stamp, stamp, None, data)
        if odd:
            self._lose(f"{odd} messages without a usable time or content")

    def _scan(self, column: str, where: str, values: Sequence[int]) -> Iterator[tuple[Any, int, Any]]:
        """Topic, time and a column of messages, by time, else as recorded.

        Where a page is damaged, what lies before it and after it in the order of recording is read as well.
        """
        reached, last = (-(2**63), 0), -(2**63)
        for attempt, (hint, order) in enumerate(_SCANS):
            query = f"SELECT id, topic_id, timestamp, {column} FROM messages {hint} WHERE {where} ORDER BY {order}"
            self._steps = 0
            try:
                for number, topic, stamp, value in self._base.execute(query, values):
                    self._steps = 0
                    if not isinstance(stamp, int) or not isinstance(number, int):
                        stamp, number = -1, 0
                    elif attempt == 2 and number <= last:
                        return
                    elif attempt and (stamp, number) <= reached:
                        last = max(last, number) if attempt == 1 else last
                        continue
                    elif attempt == 0:
                        reached = (stamp, number)
                    elif attempt == 1:
                        last = number
                    yield topic, stamp, value
                return
            except _ERRORS as error:
                self._lose(f"the database is damaged ({error}): what lies in its damaged pages is not read")

    def _open(self, stack: ExitStack, pending: bool) -> sqlite3.Connection:
        address = self._path.resolve().as_uri()
        if pending:
            try:
                base = stack.enter_context(closing(sqlite3.connect(f"{address}?mode=ro", uri=True)))
                base.execute("SELECT name FROM sqlite_schema").fetchall()
                return base
            except _ERRORS as error:
                self._lose(
                    f"messages in the write-ahead log ({self._path.name}-wal) cannot be read ({error})"
                )
        return stack.enter_context(closing(sqlite3.connect(f"{address}?immutable=1", uri=True)))

    def _describe(self) -> list[tuple[int, BagChannel]]:
        """The topics by id. What rosbag2 kept in each version of its schema is found by the columns' names."""
        tables = {row[0] for row in self._base.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")}
        if not {"topics", "messages"} <= tables:
            text = f"{self._path}: a database without the tables topics and messages"
            raise DamagedError(text, "is this a rosbag2 recording?")
        columns = {row[1] for row in self._base.execute("PRAGMA table_info(topics)")}
        definitions: dict[str, tuple[str, str]] = {}
        if "message_definitions" in tables:
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions ORDER BY id DESC"
            definitions = {str(row[0]): (str(row[1]), str(row[2])) for row in self._rows(query)}
        counts = self._counts()
        qos = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        query = f"SELECT id, name, type, serialization_format, {qos} FROM topics ORDER BY id"
        found = []
        for number, topic, kind, encoding, profiles in self._rows(query):
            how, text = definitions.get(str(kind), ("", ""))
            channel = BagChannel(
                str(topic), str(kind), str(encoding), how if text else "", text.encode(), "", str(profiles or ""),
                counts.pop(number, 0),
            )  # fmt: skip
            found.append((number, channel))
        if counts:
            self._lose(f"{sum(counts.values())} messages of topics that the recording does not describe")
        return found

    def _counts(self) -> dict[Any, int]:
        """Messages by topic; in a damaged database those that can be read."""
        try:
            return dict(self._rows("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))
        except _ERRORS:
            return Counter(topic for topic, _, _ in self._scan("0", "1", ()))

    def _first(self) -> int | None:
        """The first message's time (ns)."""
        try:
            return next((stamp for _, stamp, _ in self._scan("0", "timestamp >= 0", ())), None)
        except _ERRORS:
            return None

    def _rows(self, query: str) -> list[tuple[Any, ...]]:
        self._steps = 0
        rows = self._base.execute(query).fetchmany(MAX_TOPICS + 1)
        if len(rows) > MAX_TOPICS:
            raise DamagedError(f"{self._path}: more than {MAX_TOPICS} topics or types")
        return rows

    def _tick(self) -> int:
        self._steps += 1
        return int(self._steps > MAX_STEPS)

    def _lose(self, text: str) -> None:
        if text not in self.losses:
            self.losses.append(text)

    def _damaged(self, error: Exception) -> DamagedError:
        return DamagedError(f"{self._path}: {error}", "is this a rosbag2 recording (SQLite)?")
