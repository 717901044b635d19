"""Applanix logs: the table of formats, and which of them a file is.

>>> read(Path("sbet.out"), ReadOptions(week=2162))
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from scpf.ingest import pcap
from scpf.ingest.byte_streams import PROBE_BYTES, map_file
from scpf.ingest.navigation import Navigation
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import InputError, UsageError


class Format(NamedTuple):
    """Where a format's reader and probe are (``module:function``), and what it is."""

    read: str
    probe: str
    about: str
    streamed: bool = False
    """Whether it may come inside a network capture."""


FORMATS: Final[dict[str, Format]] = {
    "grp": Format("scpf.ingest.pos_grp:read", "scpf.ingest.pos_grp:probe", "POS LV/MV $GRP messages", True),
    "gsof": Format("scpf.ingest.gsof:read", "scpf.ingest.gsof:probe", "Trimble GSOF (POS LVX)", True),
    "nmea": Format("scpf.ingest.nmea:read", "scpf.ingest.nmea:probe", "NMEA 0183 sentences", True),
    "boreas": Format("scpf.ingest.boreas:read", "scpf.ingest.boreas:probe", "CSV poses, Boreas style"),
    "pospac": Format("scpf.ingest.pospac:read", "scpf.ingest.pospac:probe", "POSPac ASCII export"),
    "sbet": Format("scpf.ingest.sbet:read", "scpf.ingest.sbet:probe", "POSPac SBET"),
    "smrmsg": Format("scpf.ingest.sbet:refuse_smrmsg", "scpf.ingest.sbet:probe_smrmsg", "POSPac SMRMSG"),
}
"""In the order in which they are tried: checksums first, then names of columns, then ranges of numbers."""


class Recognised(NamedTuple):
    """A format's name, and why the file is taken for it."""

    name: str
    why: str


def recognise(path: Path) -> Recognised:
    """The format of a file, by its content. Raises InputError where it is none of the table's."""
    data = map_file(path)
    head = bytes(data[:PROBE_BYTES])
    if pcap.is_capture(head):
        return _in_capture(path, pcap.survey(data))
    for name, entry in FORMATS.items():
        why = _probe(entry)(head, len(data))
        if why is not None:
            return Recognised(name, why)
    known = ", ".join(f"{name} ({entry.about})" for name, entry in FORMATS.items())
    raise InputError(f"{path}: byte 0: not a log of a known format", f"known: {known}; or name the format")


def _in_capture(path: Path, capture: pcap.Capture) -> Recognised:
    flows = sorted(capture.flows.items(), key=lambda item: -item[1].payload_bytes)
    for name, entry in FORMATS.items():
        if entry.streamed:
            for flow, summary in flows:
                why = _probe(entry)(bytes(summary.head), summary.payload_bytes)
                if why is not None:
                    return Recognised(name, f"network capture, {flow}: {why}")
    seen = "; ".join(str(flow) for flow, _ in flows[:5]) or "none"
    raise InputError(f"{path}: a network capture without a known stream (flows: {seen})", "name the format")


def read(path: Path, options: ReadOptions | None = None, format: str | None = None) -> Navigation:
    """The navigation of a log, of the format given or recognised; its report says which and why.

    Raises InputError and MissingError as the format's reader does, UsageError for a format not in the table.
    """
    recognised = Recognised(format, "named by the user") if format is not None else recognise(path)
    if recognised.name not in FORMATS:
        raise UsageError(f"{recognised.name!r} is not a log format", f"known: {', '.join(FORMATS)}")
    reader: Callable[[Path, ReadOptions], Navigation] = _function(FORMATS[recognised.name].read)
    navigation = reader(path, options or ReadOptions())
    navigation.report.notes.insert(0, f"{recognised.name}: {recognised.why}")
    return navigation


def _probe(entry: Format) -> Callable[[bytes, int], str | None]:
    probe: Callable[[bytes, int], str | None] = _function(entry.probe)
    return probe


def _function(place: str) -> Callable[..., Any]:
    module, name = place.split(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function
