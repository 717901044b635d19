"""What an examination finds: how bad, what it is about, what was seen, and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

Severity = Literal["error", "warning", "note"]
SEVERITIES: Final[tuple[Severity, ...]] = ("error", "warning", "note")
"""An error keeps a replay from working, a warning makes its figures worse, a note is good to know."""


@dataclass(frozen=True)
class Finding:
    """One finding; ``about`` is a topic, an attachment, a package."""

    severity: Severity
    about: str
    message: str
    remedy: str


def counted(count: int, what: str) -> str:
    """``1 gap``, ``2 gaps``."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
