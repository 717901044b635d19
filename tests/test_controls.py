"""What each key does to a replay, with keys out of a list."""

from __future__ import annotations

import math

import pytest

from scpf.replay.controls import Controls
from scpf.replay.keys import Keyboard
from scpf.replay.pace import Pace, PaceSettings


class Typist(Keyboard):
    """Presses the given keys; None is a moment without one. At the end the terminal goes away."""

    def __init__(self, keys: list[str | None]) -> None:
        super().__init__(-1)
        self.present = True
        self.keys = list(keys)

    def read(self, timeout_s: float | None) -> str:
        if not self.keys:
            self.present = False
            return ""
        return self.keys.pop(0) or ""


def governed(
    keys: list[str | None], factor: float = math.inf, stepping: bool = False
) -> tuple[Controls, Pace]:
    pace, controls = Pace(PaceSettings(factor)), Controls(Typist(keys), stepping)
    controls.govern(pace)
    return controls, pace


def test_one_key_one_frame() -> None:
    controls, _ = governed(["z", "n", "n", "\n", "q"], stepping=True)
    assert [controls.goes_on() for _ in range(4)] == [True, True, True, False]
    assert controls.ended and controls.state() == "paused"


def test_space_pauses_until_space() -> None:
    controls, pace = governed([None, " ", None, None, " ", None], factor=1.0)
    assert controls.goes_on() and not controls.paused and pace.live
    assert controls.goes_on() and not controls.paused and pace.live
    assert controls.waited_s >= 0.0


def test_a_pause_in_the_middle_of_a_sleep_holds_the_pace() -> None:
    controls, pace = governed([" ", "q"], factor=1.0)
    controls.sleep(100.0)
    assert controls.paused and not pace.live
    assert not controls.goes_on()


def test_the_end_may_come_in_the_middle_of_a_sleep() -> None:
    controls, pace = governed(["q"], factor=0.001)
    controls.sleep(100.0)
    assert not pace.live and not controls.goes_on()


@pytest.mark.parametrize(
    ("factor", "keys", "expected"),
    [
        (1.0, "+", 2.0),
        (1.0, "--", 0.25),
        (16.0, "+", math.inf),
        (math.inf, "-", 1.0),
        (math.inf, "+", math.inf),
        (1 / 16, "-", 1 / 16),
    ],
)
def test_the_pace_doubles_and_halves(factor: float, keys: str, expected: float) -> None:
    controls, pace = governed([*keys, None], factor)
    assert controls.goes_on()
    assert pace.factor == expected
    later = Pace(PaceSettings(factor))
    controls.govern(later)
    assert later.factor == expected, "the next log goes on at that pace"


def test_a_paused_replay_ends_when_its_terminal_goes() -> None:
    controls, _ = governed([" "])
    assert not controls.goes_on() and controls.ended


def test_without_a_keyboard_everything_goes_on() -> None:
    controls = Controls()
    controls.govern(Pace(PaceSettings()))
    assert controls.goes_on() and controls.state() == "" and controls.waited_s == 0.0
