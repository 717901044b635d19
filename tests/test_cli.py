"""The command line: streams, exit codes, errors in one line, help for every command."""

from __future__ import annotations

import json
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
