"""``scpf train distance``: files, exit codes, and a model for each class."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from distance_logs import FEET, LENS, QUICK, write_log
from pole_scenes import pose, see

from scpf.ingest.drive_log import DriveLog
from scpf.models import distance_file, distance_settings
from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel
from scpf.models.distance_classes import DistanceByClass
from scpf.models.errors import InputError, UsageError
from scpf.replay.training_commands import train_distance


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


def test_the_command(
    log_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(distance_settings, "PRESETS", {"paper": QUICK})
    output, fitted, report = tmp_path / "m.npz", tmp_path / "c.npz", tmp_path / "r.json"
    more: dict[str, object] = {"segmenter": "recorded", "every": 3, "repetitions": 2, "folds": 3}
    pictures = tmp_path / "pictures"
    more["figures"] = pictures
    code = train_distance([log_path], output=output, cross_fitted=fitted, report=report, **more)  # type: ignore[arg-type]
    del more["figures"]
    assert code == 0
    text = capsys.readouterr()
    assert "held out by pole, all" in text.out
    assert "at random, close: box " in text.out
    assert text.err == ""
    figures = json.loads(report.read_text())
    mine = figures["classes"]["light_pole"]
    assert mine["poles"] == len(FEET)
    assert list(mine["comparisons"]["by_pole"]) == ["close", "far", "all"]
    assert DistanceModel.load(output).metadata["segmenter"] == "recorded"
    assert isinstance(distance_file.load(fitted), CrossFittedDistance)
    assert sorted(path.suffix for path in pictures.iterdir()) == [".png"] * 4
    with pytest.raises(UsageError, match=r"png exists"):
        train_distance([log_path], output=tmp_path / "other.npz", figures=pictures)
    alone = tmp_path / "single.npz"
    train_distance([log_path], output=alone, experts=1, **more)  # type: ignore[arg-type]
    assert DistanceModel.load(alone).names == ("single",)
    chosen = ("x1", "tilt")
    train_distance([log_path], output=alone, overwrite=True, experts=1, close=chosen, **more)  # type: ignore[arg-type]
    assert DistanceModel.load(alone).inputs == (chosen,)
    with pytest.raises(InputError, match="mood"):
        train_distance([log_path], output=tmp_path / "mood.npz", far=("x1", "mood"))
    with pytest.raises(UsageError, match="experts"):
        train_distance([log_path], output=alone, experts=9, overwrite=True)
    with pytest.raises(UsageError, match="exists"):
        train_distance([log_path], output=output, segmenter="recorded")
    with pytest.raises(UsageError):
        train_distance([log_path], output=output, every=0, overwrite=True)


def test_each_class_gets_its_own_model(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(distance_settings, "PRESETS", {"paper": QUICK})
    log = write_log(tmp_path / "two.mcap", signs=(1, 3, 5, 7, 9, 11), posts=(0,))
    output, fitted = tmp_path / "m.npz", tmp_path / "c.npz"
    report, pictures = tmp_path / "r.json", tmp_path / "pictures"
    code = train_distance(
        [log],
        output=output,
        cross_fitted=fitted,
        report=report,
        figures=pictures,
        segmenter="recorded",
        every=2,
        folds=3,
        repetitions=2,
    )
    assert code == 3  # the posts are too few
    assert "no model for post" in capsys.readouterr().err
    results = json.loads(report.read_text())
    assert list(results["classes"]) == ["light_pole", "sign"]
    assert results["classes"]["sign"]["poles"] == 6
    assert results["too_few_samples"]["post"] < 8
    assert len(list(pictures.iterdir())) == 8

    both = distance_file.load(output)
    assert isinstance(both, DistanceByClass)
    with pytest.raises(InputError, match="several classes"):
        DistanceModel.load(output)
    both.check_camera(LENS)
    assert both.metadata["sign: landmark_class"] == "sign"
    seen = see(LENS, pose(), (20.0, 3.0))
    assert seen is not None
    pole, sign, post = (replace(seen, landmark_class=name) for name in ("light_pole", "sign", "post"))
    found = both.for_frame(0).predict([sign, post, pole], 1024, 768)
    assert found[1] is None
    for one, name, instance in ((found[0], "sign", sign), (found[2], "light_pole", pole)):
        assert [one] == both.models[name].for_frame(0).predict([instance], 1024, 768)
    assert both.models["light_pole"].for_frame(0).predict([sign], 1024, 768) == [None]
    assert both.predict([sign, post, pole], 1024, 768) == found

    crossed = distance_file.load(fitted)
    assert isinstance(crossed, DistanceByClass)
    crossed.save(tmp_path / "again.npz")
    again = distance_file.load(tmp_path / "again.npz")
    assert isinstance(again, DistanceByClass)
    with DriveLog(log) as opened:
        stamp, instances = next(iter(opened.instances().items()))
    first = crossed.for_frame(stamp).predict(instances, 1024, 768)
    assert first == again.for_frame(stamp).predict(instances, 1024, 768)
    assert first != both.for_frame(stamp).predict(instances, 1024, 768)


def test_unreadable_frames_give_exit_code_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from scpf.models import segmentation
    from scpf.replay import distance_training, frames

    monkeypatch.setattr(distance_settings, "PRESETS", {"paper": QUICK})

    log = write_log(tmp_path / "drive.mcap", frames=70, images=True)
    with distance_training.DriveLog(log) as opened:
        truth = list(opened.instances().values())
    turn = iter(range(len(truth)))

    def decode(data: bytes, place: str) -> int:
        k = next(turn)
        if k == 4:
            raise InputError(f"{place}: the image cannot be decoded")
        return k

    monkeypatch.setattr(frames, "decode", decode)
    monkeypatch.setattr(segmentation, "load", lambda name, *, threads, threshold: lambda image: truth[image])
    code = train_distance([log], output=tmp_path / "m.npz", repetitions=1, format="json")
    assert code == 3
    text = capsys.readouterr()
    assert json.loads(text.out)["unreadable_frames"] == 1
    assert "1 of 70 frames" in text.err
