"""Which topics and which time of a recording are wanted."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import Final

from scpf.models.errors import UsageError

REGEX: Final = "re:"


def matcher(pattern: str) -> Callable[[str], bool]:
    """Whether a topic matches: a glob such as ``/camera/*``, or ``re:`` and a regular expression for all of it.

    UsageError for a regular expression that is none.
    """
    if not pattern.startswith(REGEX):
        return lambda topic: fnmatchcase(topic, pattern)
    try:
        expression = re.compile(pattern[len(REGEX) :])
    except re.error as error:
        raise UsageError(f"{pattern!r} is not a regular expression ({error})") from error
    return lambda topic: expression.fullmatch(topic) is not None


class TopicChoice:
    """``include`` (all topics, where empty) without ``exclude``."""

    def __init__(self, include: Sequence[str], exclude: Sequence[str]) -> None:
        self._include = {pattern: matcher(pattern) for pattern in include}
        self._exclude = {pattern: matcher(pattern) for pattern in exclude}

    def __call__(self, topic: str) -> bool:
        """Whether a topic is wanted."""
        wanted = not self._include or any(match(topic) for match in self._include.values())
        return wanted and not any(match(topic) for match in self._exclude.values())

    def unmatched(self, topics: Sequence[str]) -> list[str]:
        """Patterns that match none of the topics."""
        patterns = [*self._include.items(), *self._exclude.items()]
        return [pattern for pattern, match in patterns if not any(match(topic) for topic in topics)]

    def __str__(self) -> str:
        return " ".join(self._include) or "what --exclude leaves"
