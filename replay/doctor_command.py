"""``scpf doctor``: what is wrong with a log, or with the machine, and what to do about it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from scpf.ingest.findings import Finding


def doctor(
    log: Path | None = None,
    *,
    deep: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Examine a log, or, without one, this machine: every finding, how bad it is, and what to do.

    An error keeps a replay from working, a warning makes its figures worse, a note is good to know. Exit codes:
    0 fine (notes apart), 3 something was found, 1 the log cannot be opened.

    Examples:

        scpf doctor drive.mcap --deep

        scpf doctor

    Parameters
    ----------
    log
        A drive log, or any MCAP file.
    deep
        Decode every image, instead of reading its header alone.
    quiet
        No progress.
    format
        Form of the report on stdout.
    """
    return _machine(format) if log is None else _log(log, deep, quiet, format)


def _log(path: Path, deep: bool, quiet: bool, format: str) -> int:
    from dataclasses import asdict

    from scpf.ingest.doctor import examine
    from scpf.replay.ingest_reports import Counter

    found = examine(path, deep=deep, progress=None if quiet else Counter("messages"))
    if format == "json":
        print(json.dumps({**asdict(found), "fine": found.fine}, indent=1))
    else:
        images = "every image decoded" if deep else "images by their headers (--deep decodes them)"
        print(f"{found.path}: {found.messages} messages of {found.topics} topics, {images}")
        _print(found.findings)
    return 0 if found.fine else 3


def _machine(format: str) -> int:
    from dataclasses import asdict

    from scpf.replay.machine import TESTED, examine_machine

    found = examine_machine()
    if format == "json":
        print(json.dumps({**asdict(found), "fine": found.fine}, indent=1))
    else:
        print(f"Python {found.python} on {found.platform}, {found.cpus} CPUs")
        for name, installed in found.versions.items():
            tested = f"tested {TESTED[name]}" if name in TESTED else ""
            print(f"  {name:24} {installed or 'missing':14} {tested}".rstrip())
        _print(found.findings)
    return 0 if found.fine else 3


def _print(findings: Sequence[Finding]) -> None:
    from scpf.replay.ingest_reports import plain

    if not findings:
        print("  nothing found")
    for finding in findings:
        about = f"{plain(finding.about)}: " if finding.about else ""
        print(f"  {finding.severity:8} {about}{_whole(finding.message)}")
        if finding.remedy:
            print(f"  {'':8} → {_whole(finding.remedy)}")


def _whole(text: str) -> str:
    """Text with nothing in it that a terminal would obey, in full: a remedy that is cut short is none."""
    return "".join(sign if sign.isprintable() else "\N{REPLACEMENT CHARACTER}" for sign in text)
