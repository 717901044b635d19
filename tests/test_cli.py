"""The command line: streams, exit codes, errors in one line, help for every command."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scpf.replay.cli import COMMANDS, SUBCOMMANDS, run

ALL = [[name] for _, name, _, _ in COMMANDS] + [
    [group, name] for (group, _), *commands in SUBCOMMANDS for name, _, _ in commands
]


@pytest.mark.parametrize("command", ALL, ids=" ".join)
def test_every_command_has_help_with_examples(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*command, "--help"]) == 0
    text = capsys.readouterr().out
    assert text.count(f"scpf {' '.join(command)} ") >= 2, "a usage line and at least one example"
    assert set(re.findall(r"--(?:no|empty)-\w+", text)) <= {"--no-gps", "--no-bfloat16", "--no-surface"}


@pytest.mark.parametrize(
    "tokens",
    [["nonsense"], ["replay"], ["replay", "x.mcap", "--seed", "many"], ["replay", "x.mcap", "--frames"]],
    ids=" ".join,
)
def test_wrong_usage_is_exit_2_and_a_line(tokens: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tokens) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("scpf: ")
    assert len(captured.err.splitlines()) <= 2


def test_a_missing_file_is_exit_1_and_names_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", str(tmp_path / "no.mcap")]) == 1
    assert "no.mcap" in capsys.readouterr().err


def test_a_foreign_file_is_refused_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "picture.mcap"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    assert run(["replay", str(picture), "-o", str(tmp_path)]) == 1
    assert "picture.mcap" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.rrd"))


def test_info_in_json_is_json_alone_on_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    sample = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
    assert run(["info", str(sample), "--format", "json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert "/camera/image/compressed" in json.dumps(report)


def test_an_interrupt_is_exit_130_and_says_what_is_left(tmp_path: Path) -> None:
    """Ctrl-C in the middle of a replay: the recording so far can be opened."""
    sample = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
    command = [sys.executable, "-c", "from scpf.replay.cli import main; main()"]
    command += ["replay", str(sample), "-o", str(tmp_path), "--segmenter", "recorded"]
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # As at a prompt: tests that run in the background have Ctrl-C ignored, and so would have this.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    partial = tmp_path / "ring_road.partial.rrd"
    for _ in range(600):
        if partial.exists() and partial.stat().st_size > 1_000_000:
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, (out, err)
    assert str(partial) in err
    assert "interrupted" in err
    assert not (tmp_path / "ring_road.rrd").exists()
    rerun = Path(sys.executable).with_name("rerun")
    assert subprocess.run([rerun, "rrd", "stats", partial], capture_output=True).returncode == 0
