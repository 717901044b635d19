"""A log file as a stream of messages: the file itself, or the one flow of a capture that carries them."""

from __future__ import annotations

import mmap
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

from scpf.ingest import pcap
from scpf.ingest.read_report import ReadReport
from scpf.models.errors import DamagedError, InputError

Buffer = bytes | mmap.mmap
Probe = Callable[[bytes, int], str | None]

PROBE_BYTES: Final = 1 << 16


class ByteStream(NamedTuple):
    """``data``, and when its capture began (Unix s), where it comes from a capture that knows."""

    data: Buffer
    captured_unix_s: float | None


def map_file(path: Path) -> Buffer:
    """The file's bytes, mapped rather than loaded. Raises InputError where it cannot be read."""
    try:
        with path.open("rb") as file:
            if path.stat().st_size == 0:
                raise DamagedError(f"{path} is empty (0 bytes)", "copy or record it again")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path} cannot be read ({reason})") from error


def open_stream(path: Path, report: ReadReport, probe: Probe) -> ByteStream:
    """The messages of a file. Of a capture: the flow with most bytes among those that ``probe`` recognises.

    What the capture lost, and the flows left aside, are counted in ``report``. Raises DamagedError where no flow
    is recognised.
    """
    data = map_file(path)
    report.total_bytes = len(data)
    if not pcap.is_capture(data[:4]):
        return ByteStream(data, None)
    capture = pcap.survey(data)
    matching = {
        flow: summary.payload_bytes
        for flow, summary in capture.flows.items()
        if probe(bytes(summary.head), summary.payload_bytes)
    }
    if not matching:
        seen = "; ".join(str(flow) for flow in list(capture.flows)[:5]) or "none"
        odd = "; ".join(f"{reason}: {count}" for reason, count in capture.odd.items())
        text = f"{path}: no flow of the capture carries {report.format} (flows: {seen}; packets set aside: {odd or 0})"
        raise DamagedError(text, "name another format, or capture the port that the unit sends to")
    chosen = max(matching, key=lambda flow: matching[flow])
    stream = pcap.extract(data, chosen)
    report.container = f"pcap, {chosen}"
    for flow, size in matching.items():
        if flow != chosen:
            report.notes.append(f"{flow} also carries {report.format} ({size} bytes): left aside")
    others = len(capture.flows) - len(matching)
    if others:
        report.notes.append(f"{others} flows of other traffic in the capture")
    for reason, count in sorted(capture.odd.items()):
        if reason in ("not IP", "neither UDP nor TCP"):
            report.leave(f"packet: {reason}", count)
        else:
            report.drop(f"packet: {reason}", count)
    report.drop("byte of the stream that the capture lacks", stream.missing_bytes)
    if stream.repeated_bytes:
        report.notes.append(f"{stream.repeated_bytes} bytes were sent again (TCP)")
    return ByteStream(stream.data, capture.first_unix_ns * 1e-9 if capture.first_unix_ns else None)
