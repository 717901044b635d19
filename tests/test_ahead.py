"""Segmentation ahead of the step: the same frames and instances in their order, whatever the workers do."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from scpf.models.instances import Instance
from scpf.replay.ahead import FAILED, Ahead
from scpf.replay.step import Frame


def frame(index: int) -> Frame:
    return Frame(index, index, b"", "jpeg", None, 0.0, None, None, 9.0)


def instance(index: int) -> Instance:
    return Instance((index, 0.0, index + 1.0, 1.0), np.ones((1, 1), bool), (index, 0), 0.95)


def unevenly(frame: Frame) -> Sequence[Instance]:
    time.sleep(0.004 * (frame.index % 3))
    return [instance(frame.index)]


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_frames_keep_their_order_and_their_instances(workers: int) -> None:
    ahead = Ahead(unevenly, workers)
    seen = [(f.index, ahead(f)[0].offset_px[0]) for f in ahead.frames(map(frame, range(20)))]
    assert seen == [(k, k) for k in range(20)]


def test_a_frame_that_fails_says_so_and_the_rest_goes_on() -> None:
    def fragile(frame: Frame) -> Sequence[Instance]:
        if frame.index == 2:
            raise ValueError("no such weight")
        return [instance(frame.index)]

    ahead = Ahead(fragile)
    problems, counts = [], []
    for f in ahead.frames(map(frame, range(5))):
        problems.append(f.problems)
        counts.append(len(ahead(f)))
    assert counts == [1, 1, 0, 1, 1]
    assert problems == [(), (), ((FAILED, "ValueError: no such weight"),), (), ()]


def test_no_more_is_read_than_is_under_way() -> None:
    read = []

    def source() -> Iterator[Frame]:
        for k in range(100):
            read.append(k)
            yield frame(k)

    frames = Ahead(unevenly, 2).frames(source())
    next(frames)
    assert len(read) == 5
    frames.close()
    assert len(read) == 5
    assert not [t for t in threading.enumerate() if t.name.startswith("segmentation")]
