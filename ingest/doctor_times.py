"""Findings about time: gaps, times that go backwards, numbers that are missing, frames that come twice."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.assemble import GAP_FACTOR
from scpf.ingest.doctor_facts import IMAGE_TYPE, TopicFacts
from scpf.ingest.findings import Finding, counted

Stamps = NDArray[np.int64]

REGULAR_TYPES: Final = frozenset(
    f"sensor_msgs/msg/{name}" for name in ("CompressedImage", "Image", "Imu", "NavSatFix")
) | {"nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"}
"""Types that come at a rate; what happens now and then has no gaps."""
OTHER_GAP_FACTOR: Final = 3.0
CLOCKS_APART_S: Final = 1.0


def check_times(fact: TopicFacts) -> Iterator[Finding]:
    """Findings about the times of one topic, by the header's time where there is one."""
    stamps = np.array(fact.sensor_ns or fact.log_ns, dtype=np.int64)
    if len(stamps) < 2:
        return
    yield from _backwards(fact, stamps)
    yield from _sequences(fact)
    if fact.type in REGULAR_TYPES:
        yield from _gaps(fact, np.unique(stamps))
    if fact.type == IMAGE_TYPE:
        yield from _doubles(fact, stamps)
    if fact.headed and len(fact.sensor_ns) == len(fact.log_ns):
        apart_s = float(np.median(np.abs(stamps - np.array(fact.log_ns)))) * 1e-9
        if apart_s > CLOCKS_APART_S:
            text = f"times of the headers and of the log are {apart_s:.3f} s apart (median)"
            remedy = "the headers' times are used; are both clocks UTC?"
            yield Finding("warning", fact.topic, text, remedy)


def _backwards(fact: TopicFacts, stamps: Stamps) -> Iterator[Finding]:
    places = np.flatnonzero(np.diff(stamps) < 0)
    if len(places):
        worst_s = float(-np.diff(stamps).min()) * 1e-9
        text = f"the time goes backwards at {counted(len(places), 'place')}, by {worst_s:.6f} s at most"
        place = f"; first after {int(stamps[places[0]])} ns"
        remedy = "was the clock set during the drive? use the part before or after: --start, --stop"
        yield Finding("warning", fact.topic, text + place, remedy)


def _sequences(fact: TopicFacts) -> Iterator[Finding]:
    numbers = np.array(fact.sequences, dtype=np.int64)
    steps = np.diff(numbers)
    if not steps.any():  # many writers number nothing
        return
    back = int((steps <= 0).sum())
    if back:
        text = f"the sequence numbers do not increase at {counted(back, 'place')}"
        yield Finding("warning", fact.topic, text, "were several recordings merged? then this is harmless")
    else:
        missing = int((steps - 1).sum())
        if missing:
            text = f"{counted(missing, 'sequence number')} missing: messages were dropped while recording, or since"
            yield Finding("warning", fact.topic, text, "record to a faster disk, or fewer topics")


def _gaps(fact: TopicFacts, stamps: Stamps) -> Iterator[Finding]:
    if len(stamps) < 3:
        return
    steps_s = np.diff(stamps) * 1e-9
    median_s = float(np.median(steps_s))
    factor = GAP_FACTOR if fact.type == IMAGE_TYPE else OTHER_GAP_FACTOR
    places = np.flatnonzero(steps_s > factor * median_s)
    if len(places):
        widest = int(np.argmax(steps_s))
        missing = round(float((steps_s[places] / median_s - 1).sum()))
        text = f"{counted(len(places), 'gap')}, about {counted(missing, 'message')} missing; the largest of"
        at = f" {steps_s[widest]:.3f} s after {(stamps[widest] - stamps[0]) * 1e-9:.3f} s (rate {1 / median_s:.2f} Hz)"
        remedy = (
            "the filter bridges short gaps by its motion model; leave long ones out with --start and --stop"
        )
        yield Finding("warning", fact.topic, text + at, remedy)


def _doubles(fact: TopicFacts, stamps: Stamps) -> Iterator[Finding]:
    same_time = int((np.diff(np.sort(stamps)) == 0).sum())
    if same_time:
        text = f"{counted(same_time, 'time')} given to more than one image"
        yield Finding("warning", fact.topic, text, "is the time that of the frame, not of the file?")
    sums = np.array(fact.checksums, dtype=np.int64)
    same = int((np.diff(sums) == 0).sum())
    if same:
        text = f"{counted(same, 'image')} the same as the one before, byte for byte"
        remedy = "did the camera freeze? ingest again with --drop-duplicates"
        yield Finding("warning", fact.topic, text, remedy)
