"""PoleNet through ONNX Runtime: the same instances in single precision, nearly the same in 8 bits."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from scpf.models import polenet, segmentation
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.instances import Image, Instance
from scpf.sample_logs.street_scenes import scene

pytest.importorskip("onnxruntime", reason="needs scpf[onnx]")
pytest.importorskip("onnxscript", reason="needs scpf[onnx]")
onnx = pytest.importorskip("onnx", reason="needs scpf[onnx]")

from scpf.models.onnx_export import export, quantise  # noqa: E402
from scpf.replay import network_export  # noqa: E402
from scpf.replay.cli import run  # noqa: E402

WEIGHTS = polenet.weights_path("polenet")
THRESHOLD = 0.5


def picture(seed: int, size_px: tuple[int, int] | None = None) -> Image:
    return np.ascontiguousarray(scene(seed, size_px)[0][:, :, ::-1])


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("onnx")
    net, info = polenet.load(WEIGHTS)
    paths = {name: folder / f"{name}.onnx" for name in ("float32", "int8")}
    export(net, info, paths["float32"])
    quantise(paths["float32"], paths["int8"], [picture(700_000 + k, (640, 480)) for k in range(4)])
    return paths


def found(name: str | Path, image: Image) -> list[Instance]:
    return segmentation.load(name, threads=1, threshold=THRESHOLD)(image)


@pytest.mark.parametrize("seed", [900_002, 900_009])
def test_single_precision_finds_the_same(seed: int, exported: dict[str, Path]) -> None:
    image = picture(seed)
    ours, theirs = found("polenet", image), found(exported["float32"], image)
    assert len(ours) == len(theirs) > 0
    for one, other in zip(ours, theirs, strict=True):
        assert one.box_px == other.box_px
        assert one.score == pytest.approx(other.score, abs=1e-3)
        assert (one.mask != other.mask).sum() <= 2


def test_eight_bits_find_nearly_the_same(exported: dict[str, Path]) -> None:
    assert exported["int8"].stat().st_size < 0.4 * exported["float32"].stat().st_size
    near = []
    for image in (picture(900_000 + k) for k in (0, 1, 2, 7)):
        ours, theirs = found("polenet", image), found(exported["int8"], image)
        assert abs(len(ours) - len(theirs)) <= 1
        near += [
            min(max(abs(a - b) for a, b in zip(one.box_px, other.box_px, strict=True)) for other in theirs)
            for one in ours
        ]
    assert len(near) >= 12
    assert np.median(near) <= 3


def test_the_description_travels(exported: dict[str, Path]) -> None:
    told = replace(polenet.load(WEIGHTS)[1], tile_gate=None)  # which its graph does not use
    for path in exported.values():
        assert segmentation.load(path).info == told  # type: ignore[attr-defined]


def test_any_size_of_picture_goes_in(exported: dict[str, Path]) -> None:
    assert found(exported["int8"], np.full((37, 61, 3), 128, np.uint8)) == []
    assert found(exported["float32"], np.full((1536, 2048, 3), 128, np.uint8)) == []


def test_damaged_and_foreign_networks_are_refused(exported: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "n.onnx"
    with pytest.raises(MissingError, match="no such network"):
        segmentation.load(path)

    def refused(content: bytes) -> str:
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            segmentation.load(path)
        assert str(path) in caught.value.message
        return caught.value.message

    whole = exported["float32"].read_bytes()
    assert "not an ONNX network" in refused(whole[: len(whole) // 2])
    assert "not an ONNX network" in refused(b"")
    model = onnx.load(exported["float32"])
    properties = {each.key: each.value for each in model.metadata_props}
    for change, reason in (
        ({"format": "yolo"}, "not PoleNet"),
        ({"format_version": "9"}, "format 9"),
        ({"info": "{}"}, "description"),
    ):
        onnx.helper.set_model_props(model, {**properties, **change})
        assert reason in refused(model.SerializeToString())
    onnx.helper.set_model_props(model, properties)
    model.graph.output[0].name, model.graph.output[1].name = "centre", "mask"
    assert "inputs and outputs" in refused(model.SerializeToString())


def test_without_the_extra_it_says_what_to_install(
    exported: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingError, match="needs ONNX Runtime") as caught:
        segmentation.load(exported["int8"])
    assert "scpf[onnx]" in caught.value.hint
    net, info = polenet.load(WEIGHTS)
    with pytest.raises(MissingError, match="exporting needs"):
        export(net, info, exported["int8"].with_name("x.onnx"))
    with pytest.raises(MissingError, match="exporting needs"):
        quantise(exported["float32"], exported["int8"].with_name("x.onnx"), [])


def test_eight_bits_need_pictures(exported: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="pictures or more"):
        quantise(exported["float32"], tmp_path / "x.onnx", [])


def test_the_command_exports(
    exported: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for k in range(4):
        cv2.imwrite(str(tmp_path / f"{k}.jpg"), picture(k, (320, 256)))
    # Tracing the network takes most of the time, and is tested above.
    monkeypatch.setattr(
        network_export,
        "export",
        lambda net, info, output: output.write_bytes(exported["float32"].read_bytes()),
    )
    output = tmp_path / "n.onnx"
    command = ["export", "polenet", "--onnx", str(output), "--pictures", str(tmp_path)]
    assert run(command) == 0
    assert "8 bits, by the ranges of 4 pictures" in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.glob("*n*")) == ["n.onnx"]
    assert segmentation.load(output).info.classes == ("light_pole",)  # type: ignore[attr-defined]
    assert run(command) == 1
    assert run([*command, "--overwrite", "--precision", "float32"]) == 0
    assert output.read_bytes() == exported["float32"].read_bytes()
    assert run(["export", "polenet", "--onnx", str(tmp_path / "n.txt")]) == 2
    assert run(["export", "polenet"]) == 2
    assert run(["export", "drive.mcap", "--trajectory", "a.tum", "--onnx", str(output)]) == 2
