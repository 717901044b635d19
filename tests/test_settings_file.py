"""Settings in a file: what is written comes back, a slip is named, what is typed counts more."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from scpf.models.errors import UsageError
from scpf.models.particle_filter import FilterSettings
from scpf.replay.cli import run
from scpf.replay.settings import PRESETS, GpsSettings, Settings
from scpf.replay.settings_file import read_settings, to_toml


@pytest.mark.parametrize("name", PRESETS)
def test_what_is_written_comes_back(name: str, tmp_path: Path) -> None:
    settings = replace(
        PRESETS[name],
        seed=7,
        gps=GpsSettings("emulated", 1.5, ((3.0, 4.0), (8.0, 9.5))),
        filter=FilterSettings(particles=123),
    )
    path = tmp_path / "settings.toml"
    path.write_text(to_toml(settings))
    assert read_settings(path) == settings


def test_the_json_of_a_replay_is_a_settings_file(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_text(json.dumps({"frames": 3, "settings": PRESETS["default"].as_dict()}))
    assert read_settings(path) == PRESETS["default"]


def test_only_what_differs_needs_to_be_written(tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text('preset = "default"\nseed = 3\n[filter]\nparticles = 900\n')
    expected = PRESETS["default"]
    assert read_settings(path) == replace(expected, seed=3, filter=replace(expected.filter, particles=900))
    assert read_settings(path, "paper").heading is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sed = 3", "did you mean seed?"),
        ("[filter]\nparticels = 3", "did you mean filter.particles?"),
        ("[filter]\nparticles = 3.5", "filter.particles = 3.5 is not int"),
        ("[filter]\nparticles = true", "filter.particles = True is not int"),
        ("q_m2ps3 = inf", "q_m2ps3 = inf is not float"),
        ("filter = 3", "filter = 3 is not a table"),
        ('[gps]\nsource = "galileo"', "one of auto, log, emulated, none"),
        ("[gps]\noutages_s = [[1]]", "gps.outages_s = [1] is not a list of numbers"),
        ('preset = "best"', "no preset 'best'"),
        ("preset = 4", "preset is not a name"),
        ("seed = ", "settings.toml"),
    ],
)
def test_a_slip_of_the_pen_is_named(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text(text)
    with pytest.raises(UsageError) as caught:
        read_settings(path)
    assert said in f"{caught.value.message} {caught.value.hint}"


@pytest.mark.parametrize("data", [b"[1]", b"{}", b'{"settings": 3}', b"\xff\xfe", b"[" * 100_000])
def test_a_file_that_is_none_is_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    path.write_bytes(data)
    with pytest.raises(UsageError):
        read_settings(path)


def test_what_is_typed_counts_more(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "settings.toml"
    path.write_text("seed = 3\n[gps]\nsigma_m = 5.0\n")
    options = ["--config", str(path), "--gps", "emulated", "--preset", "default", "--seed", "9"]
    assert run(["replay", *options, "--show-config"]) == 0
    shown = tomllib.loads(capsys.readouterr().out)
    assert (shown["preset"], shown["seed"]) == ("default", 9)
    assert (shown["gps"]["source"], shown["gps"]["sigma_m"]) == ("emulated", 5.0)
    assert shown["heading"]["floor"] == PRESETS["default"].heading.floor  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "text", ["seed = -1", "score_threshold = 1.5", "[gps]\nsigma_m = 0.0", "[filter]\nparticles = 0"]
)
def test_numbers_that_mean_nothing_are_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "settings.toml"
    path.write_text(text)
    assert run(["replay", "--config", str(path), "--show-config"]) == 2
    assert "has to lie between" in capsys.readouterr().err


def test_the_defaults_are_the_paper_s(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["replay", "--show-config"]) == 0
    assert capsys.readouterr().out == to_toml(Settings())
