"""Keys on a real pseudo-terminal: read one by one, and the terminal left as it was, however the program ends."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest
from terminals import Terminal

from scpf.replay.cli import run
from scpf.replay.keys import Keyboard

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
SHOW_KEYS = """
from scpf.replay.keys import Keyboard
with Keyboard() as keyboard:
    keyboard.on_resumed = lambda seconds: print(f"resumed {seconds > 0}", flush=True)
    print("ready", flush=True)
    while (key := keyboard.read(None)) != "x":
        print(f"key {key!r}", flush=True)
    raise RuntimeError("told to")
"""
SCRIPT = [sys.executable, "-c", SHOW_KEYS]


def settled(condition: object) -> bool:
    """Whether ``condition()`` comes true within some seconds."""
    deadline_s = time.monotonic() + 20.0
    while not condition():  # type: ignore[operator]
        if time.monotonic() > deadline_s:
            return False
        time.sleep(0.02)
    return True


def test_keys_come_one_by_one_and_an_exception_puts_the_terminal_right() -> None:
    with Terminal(SCRIPT) as terminal:
        terminal.expect("ready")
        assert not terminal.collects_lines()
        terminal.press("a n")
        for key in "a n":
            terminal.expect(f"key {key!r}")
        terminal.press("x")
        assert terminal.ended() == 1
        assert terminal.modes() == terminal.at_first


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_that_ends_the_program_puts_the_terminal_right_first(number: signal.Signals) -> None:
    with Terminal(SCRIPT) as terminal:
        terminal.expect("ready")
        terminal.process.send_signal(number)
        assert terminal.ended() == -number
        assert terminal.modes() == terminal.at_first


@pytest.mark.skipif(shutil.which("bash") is None, reason="no shell with job control")
def test_suspended_the_shell_has_its_terminal_and_the_keys_come_back_with_the_program(
    tmp_path: Path,
) -> None:
    script = tmp_path / "show.py"
    script.write_text(SHOW_KEYS)
    with Terminal(["bash", "--norc", "--noediting", "-i"]) as terminal:
        terminal.press(f"{sys.executable} {script}\n")
        terminal.expect("ready\r\n")
        assert not terminal.collects_lines()
        terminal.press("\x1a")
        terminal.expect("Stopped")
        assert terminal.collects_lines()
        terminal.press("bg; echo in the back $((6 * 7))\n")  # its echo on the terminal has no 42
        terminal.expect("in the back 42")
        assert terminal.collects_lines(), "a program in the background leaves the terminal alone"
        terminal.press("fg\n")
        assert settled(lambda: not terminal.collects_lines())
        terminal.press("k")
        terminal.expect("key 'k'")
        terminal.press("\x1a")
        terminal.expect("Stopped")
        terminal.press("fg\n")
        terminal.expect("resumed True")
        terminal.press("x")
        terminal.expect("told to")
        terminal.press("exit\n")
        terminal.ended()


def test_without_a_terminal_there_are_no_keys(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    reading, writing = os.pipe()
    try:
        os.write(writing, b"q")
        with Keyboard(reading) as keyboard:
            assert not keyboard.present
            assert keyboard.read(None) == keyboard.read(0.1) == ""
    finally:
        os.close(reading)
        os.close(writing)
    out = tmp_path / "out"
    assert run(["replay", str(SAMPLE), "-o", str(out), "--step"]) == 2
    assert "--step" in capsys.readouterr().err
    assert not out.exists()


def test_a_replay_steps_pauses_and_ends_by_keys(tmp_path: Path) -> None:
    options = ["--segmenter", "recorded", "--step", "--pace", "realtime"]
    command = [sys.executable, "-c", "from scpf.replay.cli import main; main()", "replay", str(SAMPLE)]
    with Terminal([*command, "-o", str(tmp_path), *options]) as terminal:
        terminal.expect("q ends")
        terminal.expect("frame 1/")
        terminal.expect("paused")
        terminal.press("nn")
        terminal.expect("frame 3/")
        terminal.press("\n")
        terminal.expect("frame 4/")
        terminal.press(" ")
        terminal.expect("frame 2")
        terminal.press(" ")
        terminal.expect("paused")
        terminal.press("-")
        terminal.press(" ")
        terminal.expect("pace 0.5")
        terminal.press("q")
        assert terminal.ended() == 3
        assert terminal.modes() == terminal.at_first
    summary = json.loads((tmp_path / "ring_road.json").read_text())
    assert 20 <= summary["frames"] < 107 and "ended by a key" in summary["warnings"][-1]
    assert (tmp_path / "ring_road.rrd").exists()
