"""The pace: frames when they are due, late ones dropped or not, on a clock that the test turns."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from scpf.replay.pace import Pace, PaceSettings
from scpf.replay.step import Frame

PERIOD_NS = 100_000_000


class Clock:
    """A clock that stands still unless somebody sleeps or works."""

    def __init__(self) -> None:
        self.now = 50.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.now += seconds


def frames(count: int) -> Iterator[Frame]:
    for k in range(count):
        yield Frame(k, k * PERIOD_NS, b"", "jpeg", None, 0.1 if k else 0.0, None, None, 9.0)


def run(settings: PaceSettings, work_s: float, count: int = 21) -> tuple[Clock, Pace, list[Frame]]:
    clock = Clock()
    pace, seen = Pace(settings, clock, clock.sleep), []
    for frame in pace.frames(frames(count)):
        clock.now += work_s
        pace.finished(frame)
        seen.append(frame)
    return clock, pace, seen


@pytest.mark.parametrize(("factor", "seconds"), [(1.0, 2.0), (2.0, 1.0), (0.5, 4.0)])
def test_frames_come_at_their_time(factor: float, seconds: float) -> None:
    clock, pace, seen = run(PaceSettings(factor), 0.01)
    assert len(seen) == 21 and pace.dropped == 0
    assert clock.now - 50.0 == pytest.approx(seconds + 0.01)
    report = pace.report()
    assert report["latency_max_ms"] == pytest.approx(10.0) == report["latency_median_ms"]


def test_at_full_speed_nobody_sleeps_and_nothing_is_dropped() -> None:
    clock, pace, seen = run(PaceSettings(math.inf, "drop"), 0.3)
    assert [frame.index for frame in seen] == list(range(21))
    assert clock.now - 50.0 == pytest.approx(21 * 0.3)
    assert pace.report() == {}


def test_a_late_frame_is_dropped_and_its_interval_counted() -> None:
    clock, pace, seen = run(PaceSettings(1.0, "drop"), 0.25)
    assert pace.dropped == 21 - len(seen) > 8
    assert sum(frame.dt_s for frame in seen) == pytest.approx(seen[-1].stamp_ns * 1e-9)
    assert pace.report()["latency_max_ms"] <= 100.0 + 250.0 + 1e-6
    assert clock.now - 50.0 < 2.5


def test_who_waits_falls_behind_and_says_so() -> None:
    _, pace, seen = run(PaceSettings(1.0, "wait"), 0.25)
    assert len(seen) == 21
    assert pace.report()["latency_max_ms"] == pytest.approx(21 * 250.0 - 2000.0)


def test_a_pause_makes_nothing_late() -> None:
    clock = Clock()
    pace, seen = Pace(PaceSettings(1.0, "drop"), clock, clock.sleep), []
    for frame in pace.frames(frames(21)):
        clock.now += 0.02
        pace.finished(frame)
        seen.append(frame.index)
        if frame.index == 5:  # held for three frames that are stepped through, and long waits between them
            pace.hold()
        if 5 <= frame.index < 8:
            clock.now += 30.0
        if frame.index == 8:
            pace.go_on()
    assert seen == list(range(21)) and pace.dropped == 0
    assert pace.report()["latency_max_ms"] == pytest.approx(20.0)
    # Frame 8 counts as due when frame 5 was, but for the time since; twelve intervals follow it.
    assert clock.now - 50.0 == pytest.approx(0.5 + 90.0 + 3 * 0.02 + 1.2 + 0.02)


def test_who_was_behind_before_a_pause_is_behind_after_it() -> None:
    clock = Clock()
    pace = Pace(PaceSettings(1.0, "wait"), clock, clock.sleep)
    for frame in pace.frames(frames(21)):
        clock.now += 0.25
        pace.finished(frame)
        if frame.index == 10:
            pace.hold()
            clock.now += 60.0
            pace.go_on()
    assert pace.report()["latency_max_ms"] == pytest.approx(21 * 250.0 - 2000.0)


def test_another_pace_holds_from_the_last_frame_on() -> None:
    clock = Clock()
    pace = Pace(PaceSettings(), clock, clock.sleep)
    for frame in pace.frames(frames(31)):
        if frame.index == 10:
            assert clock.now == 50.0 and not pace.live
            pace.set_factor(1.0)
        if frame.index == 20:
            assert clock.now == pytest.approx(51.0)
            pace.set_factor(0.5)
    assert clock.now == pytest.approx(53.0)


def test_who_sleeps_less_than_asked_for_is_asked_again() -> None:
    clock = Clock()
    pace = Pace(PaceSettings(1.0), clock, lambda seconds: clock.sleep(max(seconds / 2, 0.001)))
    times = [clock.now for _ in pace.frames(frames(3))]
    assert times == pytest.approx([50.0, 50.1, 50.2], abs=0.001)
