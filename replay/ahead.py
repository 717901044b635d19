"""Segmentation of the frames to come, while the frame at hand is estimated and recorded.

The network takes most of a replay's time and lets go of Python's lock while it computes: two single-threaded workers
on two cores finish nearly twice as many frames as one with two threads. Frames come out in the order in which they
went in, and each one's instances depend on it alone, so that results are the same for any number of workers.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from typing import Final, NamedTuple

from scpf.models.instances import Instance
from scpf.replay.pipeline import Segment
from scpf.replay.stages import failure
from scpf.replay.step import Frame

FAILED: Final = "segmentation that failed"


class _Segmented(NamedTuple):
    instances: Sequence[Instance]
    seconds: float
    failure: str = ""


class Ahead:
    """A segmenter for `Pipeline` whose work on a frame is done by the time that `frames` hands the frame out.

    ``workers`` frames at most are under way, and ``depth`` at most are read ahead: memory stays bounded however slow
    the reader is, and a small depth keeps the latency low where the frames come at their own time. The depth may change
    on the way.
    A frame whose segmentation fails has no instances and says so in its ``problems``.
    """

    def __init__(self, segment: Segment, workers: int = 2, depth: int = 4) -> None:
        self._segment = segment
        self._workers, self.depth = workers, depth
        self._current = _Segmented((), 0.0)

    def frames(self, frames: Iterable[Frame]) -> Generator[Frame, None, None]:
        """The same frames in their order, each segmented."""
        under_way: deque[tuple[Frame, Future[_Segmented]]] = deque()
        with ExitStack() as cleanup:
            pool = cleanup.enter_context(ThreadPoolExecutor(self._workers, "segmentation"))
            cleanup.callback(lambda: [future.cancel() for _, future in under_way])
            for frame in frames:
                under_way.append((frame, pool.submit(self._run, frame)))
                while len(under_way) > self.depth:
                    yield self._finished(*under_way.popleft())
            while under_way:
                yield self._finished(*under_way.popleft())

    def __call__(self, frame: Frame) -> Sequence[Instance]:
        """The instances of the frame that `frames` handed out last."""
        return self._current.instances

    @property
    def seconds(self) -> float:
        """What the segmentation of that frame took its worker, s."""
        return self._current.seconds

    def _finished(self, frame: Frame, future: Future[_Segmented]) -> Frame:
        self._current = future.result()
        if not self._current.failure:
            return frame
        return replace(frame, problems=(*frame.problems, (FAILED, self._current.failure)))

    def _run(self, frame: Frame) -> _Segmented:
        begun = time.perf_counter()
        try:
            instances, failed = self._segment(frame), ""
        except Exception as error:  # one bad frame, whatever is wrong with it, must not end the replay
            instances, failed = (), failure(error)
        return _Segmented(instances, time.perf_counter() - begun, failed)
