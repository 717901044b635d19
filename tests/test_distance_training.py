"""Training: samples from a log, held-out figures, cross-fitting that never sees a pole, and the command."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pole_scenes import camera, pose, road_map, see

from scpf.ingest.drive_log import MAP_ATTACHMENT, DriveLog, DriveLogWriter
from scpf.models import distance_file, distance_fit, distance_settings
from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel
from scpf.models.distance_classes import DistanceByClass
from scpf.models.distance_settings import DistanceSettings
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.road_map import to_geojson
from scpf.replay.distance_evaluation import evaluate, hold_out, residuals
from scpf.replay.distance_training import Samples, cross_fit, gather, train
from scpf.replay.training_commands import train_distance

LENS = camera()
QUICK = DistanceSettings(restarts=0, max_samples=120, max_search_samples=60)
START_NS = 1_700_000_000_000_000_000
FEET = tuple((15.0 + 22.0 * k, 4.5 if k % 2 else -4.0) for k in range(14))


def write_log(
    path: Path,
    *,
    frames: int = 150,
    images: bool = False,
    parts: bool = True,
    signs: Sequence[int] = (),
    posts: Sequence[int] = (),
) -> Path:
    """A drive of two metres a frame, four frames a second, past poles on both sides; some are signs or posts."""
    classes = {**dict.fromkeys(signs, "sign"), **dict.fromkeys(posts, "post")}
    poles = road_map(*FEET)
    marks = [
        replace(mark, landmark_class=classes.get(n, "light_pole")) for n, mark in enumerate(poles.landmarks)
    ]
    mapped = replace(poles, landmarks=tuple(marks))
    rng = np.random.default_rng(5)
    thick = rng.uniform(0.085, 0.095, len(FEET))
    with DriveLogWriter(path) as log:
        if parts:
            log.write_camera(START_NS, LENS)
        log.attach(MAP_ATTACHMENT, "application/geo+json", json.dumps(to_geojson(mapped)).encode())
        for k in range(frames):
            stamp, T = START_NS + k * 250_000_000, pose(2.0 * k, 0.3 * np.sin(k), 0.01 * np.cos(k))
            log.write_pose(stamp, T)
            ahead = [
                (n, see(LENS, T, foot, radius_m=thick[n]))
                for n, foot in enumerate(FEET)
                if foot[0] > 2 * k + 5
            ]
            seen = [
                replace(each, landmark_class=classes.get(n, "light_pole"))
                for n, each in ahead
                if each is not None
            ]
            log.write_instances(stamp, seen)
            if images:
                log.write_image(stamp, b"no image", "jpeg")
    return path


@pytest.fixture(scope="module")
def log_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_log(tmp_path_factory.mktemp("log") / "drive.mcap")


@pytest.fixture(scope="module")
def samples(log_path: Path) -> Samples:
    return gather([log_path], "recorded")


@pytest.fixture(scope="module")
def model(samples: Samples) -> DistanceModel:
    return train(samples, QUICK, 0, {"logs": "drive.mcap"})


def test_samples_carry_the_right_poles(samples: Samples) -> None:
    assert len(samples) > 150
    assert set(samples.landmark_ids) == {f"P{k}" for k in range(len(FEET))}
    assert samples.frames == 150
    assert samples.unreadable == 0
    for k in range(0, len(samples), 7):
        frame = (samples.stamps_ns[k] - START_NS) // 250_000_000
        foot = FEET[int(samples.landmark_ids[k][1:])]
        expected = np.hypot(foot[0] - 2.0 * frame, foot[1] - 0.3 * np.sin(frame))
        assert samples.distances_m[k] == pytest.approx(expected, abs=0.01)
    assert samples.distances_m.max() <= 60.0


def test_every_and_distance_limit(log_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    few = gather([log_path, log_path], "recorded", 0.9, 5, 30.0, lambda frames, n: seen.append((frames, n)))
    assert few.frames == 60
    assert few.distances_m.max() <= 30.0
    assert seen[-1] == (60, len(few))
    assert sum(few.dropped.values()) > 0


def test_figures(samples: Samples, model: DistanceModel) -> None:
    report = evaluate(samples, model, QUICK, 0, repetitions=4, searched_repetitions=1)
    for key in ("random", "by_pole", "by_pole_searched"):
        figures = report[key]["validation"]["all"]
        assert figures["mae_m"] < 1.5
        assert figures["mae_m"] <= figures["rmse_m"]
        assert abs(figures["bias_m"]) <= figures["mae_m"]
        assert figures["function_coverage"] <= figures["coverage"]
    assert report["random"]["train"]["all"]["mae_m"] < report["by_pole"]["validation"]["all"]["mae_m"]
    assert (
        sum(row["n"] for row in report["by_pole_bands"].values() if row)
        == (report["by_pole"]["validation"]["all"]["n"])
    )
    json.dumps(report, allow_nan=False)


def test_a_pole_is_on_one_side_of_a_hold_out_by_pole(samples: Samples, model: DistanceModel) -> None:
    one = hold_out(samples, model, QUICK, 1, 3, by_pole=True)
    held = set(samples.landmark_ids[np.isin(samples.distances_m, one.validation.distance_m)])
    trained = set(samples.landmark_ids[np.isin(samples.distances_m, one.train.distance_m)])
    assert held
    assert not held & trained


def test_cross_fitting_never_uses_the_same_pole(
    samples: Samples, model: DistanceModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    from scpf.replay import distance_training

    trained_on: list[set[str]] = []

    def spy(features, distances_m, *rest, **more):  # type: ignore[no-untyped-def]
        used = np.isin(samples.distances_m, distances_m)
        trained_on.append(set(samples.landmark_ids[used]))
        return distance_fit.fit(features, distances_m, *rest, **more)

    monkeypatch.setattr(distance_training, "fit", spy)
    fitted = cross_fit(samples, model, QUICK, 0, folds=4)
    assert len(trained_on) == 4
    poles = set(samples.landmark_ids)
    assert set.union(*(poles - used for used in trained_on)) == poles
    assert all(a == b or not (poles - a) & (poles - b) for a in trained_on for b in trained_on)
    np.testing.assert_array_equal(fitted.stamps_ns, samples.stamps_ns)
    figures = residuals(samples, fitted.held_out).figures()
    assert figures is not None
    assert figures.n == len(samples)
    assert figures.mae_m < 3.0


def test_cross_fitting_needs_poles_to_spare(samples: Samples, model: DistanceModel) -> None:
    one = samples.rows(samples.landmark_ids == samples.landmark_ids[0])
    with pytest.raises(InputError, match="left to train on"):
        cross_fit(one, model, QUICK, 0)


def test_a_log_without_calibration(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="no calibration"):
        gather([write_log(tmp_path / "bare.mcap", frames=3, parts=False)], "recorded")


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


def test_samples_of_several_classes_are_no_model(samples: Samples) -> None:
    names = np.where(np.arange(len(samples)) % 2 == 0, "sign", "light_pole")
    mixed = replace(samples, landmark_classes=names)
    with pytest.raises(InputError, match="2 landmark classes"):
        train(mixed, QUICK, 0)
    parts = mixed.by_class()
    assert {name: len(part) for name, part in parts.items()} == {
        "light_pole": len(samples) // 2,
        "sign": (len(samples) + 1) // 2,
    }


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
