"""Whose weights a file holds, told by the names and shapes of its tensors; what is not Mask R-CNN's is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from maskrcnn_goldens import shapes_of

from scpf.models import maskrcnn_segmenter, segmentation
from scpf.models.checkpoint_keys import recognise
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.maskrcnn import MaskRCNN
from scpf.models.maskrcnn_conventions import DETECTRON2, TORCHVISION, CheckpointSettings, decided
from scpf.models.maskrcnn_segmenter import build, class_names

Tensors = dict[str, torch.Tensor]
PREDICTOR = "roi_heads.box_predictor.cls_score"


def originals(name: str) -> Tensors:
    """Zeros under the names, and in the shapes, of the original's state dictionary."""
    return {key: torch.zeros(shape) for key, shape in shapes_of(name).items()}


def old_torchvision() -> Tensors:
    """The names that torchvision's published file has."""
    deeper = re.compile(r"(inner_blocks\.\d|layer_blocks\.\d|rpn\.head\.conv)\.0(?:\.0)?\.")
    tensors = {}
    for key, value in originals("torchvision").items():
        old = deeper.sub(r"\1.", key)
        for k in range(4):
            old = old.replace(f"mask_head.{k}.0.", f"mask_head.mask_fcn{k + 1}.")
        if not key.endswith("num_batches_tracked"):
            tensors[old] = value
    return tensors


def with_pixels(mean: tuple[float, float, float]) -> Tensors:
    """As Detectron2's published files have them: the pixels' mean and the anchors beside the weights."""
    return {
        **originals("detectron2"),
        "pixel_mean": torch.tensor(mean).view(3, 1, 1),
        "pixel_std": torch.tensor([57.375, 57.12, 58.395]).view(3, 1, 1),
        "proposal_generator.anchor_generator.cell_anchors.0": torch.zeros(3, 4),
    }


def deep() -> Tensors:
    """A ResNet of 101 layers."""
    tensors = originals("detectron2")
    template = {key: value for key, value in tensors.items() if ".res4.5." in key}
    for block in range(6, 23):
        tensors |= {key.replace(".res4.5.", f".res4.{block}."): value for key, value in template.items()}
    return tensors


@pytest.mark.parametrize(
    ("make", "convention", "classes", "blocks"),
    [
        (lambda: originals("torchvision"), TORCHVISION, 3, (3, 4, 6, 3)),
        (old_torchvision, TORCHVISION, 3, (3, 4, 6, 3)),
        (lambda: originals("detectron2"), DETECTRON2, 5, (3, 4, 6, 3)),
        (deep, DETECTRON2, 5, (3, 4, 23, 3)),
    ],
)
def test_convention_classes_and_depth_are_in_the_names(
    make: Callable[[], Tensors], convention: object, classes: int, blocks: tuple[int, ...]
) -> None:
    for prefix in ("", "module.", "model."):
        found = recognise({prefix + name: value for name, value in make().items()}, "file")
        assert (found.convention, found.classes, found.blocks) == (convention, classes, blocks)
        with torch.device("meta"):
            expected = MaskRCNN(classes, found.convention, blocks).state_dict()
        assert {name: value.shape for name, value in found.tensors.items()} == {
            name: value.shape for name, value in expected.items()
        }


def test_the_background_goes_from_first_to_last() -> None:
    tensors = originals("torchvision")
    tensors[f"{PREDICTOR}.bias"] = torch.tensor([9.0, 1, 2, 3])
    tensors["roi_heads.box_predictor.bbox_pred.bias"] = torch.arange(16.0)
    tensors["roi_heads.mask_predictor.mask_fcn_logits.bias"] = torch.tensor([9.0, 1, 2, 3])
    found = recognise(tensors, "file").tensors
    assert found[f"{PREDICTOR}.bias"].tolist() == [1, 2, 3, 9]
    assert found["roi_heads.box_predictor.bbox_pred.bias"].tolist() == list(range(4, 16))
    assert found["roi_heads.mask_head.predictor.bias"].tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("mean", "colour"), [((103.53, 116.28, 123.675), "bgr"), ((123.675, 116.28, 103.53), "rgb")]
)
def test_the_mean_of_the_pixels_tells_their_order(mean: tuple[float, float, float], colour: str) -> None:
    found = recognise(with_pixels(mean), "file")
    assert found.convention.colour == colour
    assert found.convention.pixel_mean == pytest.approx(mean)
    assert found.convention.pixel_deviation == pytest.approx((57.375, 57.12, 58.395))


def test_a_person_may_know_better() -> None:
    plain, assumed = decided(DETECTRON2, CheckpointSettings(), trained_norms=False, pixels_known=False)
    assert plain == DETECTRON2
    assert assumed == ("colour order BGR", "stride in the 1x1 convolution")
    said = CheckpointSettings(colour="rgb", stride="3x3", batch_norm_epsilon=1e-3)
    changed, assumed = decided(DETECTRON2, said, trained_norms=False, pixels_known=False)
    assert (changed.colour, changed.stride, changed.batch_norm_epsilon) == ("rgb", "3x3", 1e-3)
    assert changed.pixel_mean == (123.675, 116.28, 103.53)
    assert assumed == ()
    known, _ = decided(DETECTRON2, CheckpointSettings(colour="rgb"), trained_norms=False, pixels_known=True)
    assert known.pixel_mean == DETECTRON2.pixel_mean


def test_torchvision_has_no_epsilon_unless_its_norms_were_trained() -> None:
    for trained, epsilon in ((False, 0.0), (True, 1e-5)):
        convention, assumed = decided(
            TORCHVISION, CheckpointSettings(), trained_norms=trained, pixels_known=False
        )
        assert convention.batch_norm_epsilon == epsilon
        assert f"batch norm epsilon {epsilon:g}" in assumed
    assert recognise(originals("torchvision"), "file").trained_norms
    assert not recognise(old_torchvision(), "file").trained_norms


def test_stride_and_colour_reach_the_network() -> None:
    said = CheckpointSettings(colour="rgb", stride="3x3")
    net, _ = build(recognise(originals("detectron2"), "file"), said, "file")
    block = net.backbone.bottom_up.res3[0]
    assert (block.conv1.stride, block.conv2.stride) == ((1, 1), (2, 2))
    red = torch.zeros(1, 3, 1, 1)
    red[0, 0] = 200
    assert net.normalise(red).flatten().tolist() == pytest.approx([200 - 123.675, -116.28, -103.53])


@pytest.mark.parametrize("said", [
    CheckpointSettings(batch_norm_epsilon=-1.0), CheckpointSettings(short_side_px=0),
    CheckpointSettings(long_side_px=700),
])  # fmt: skip
def test_what_cannot_be_meant_is_wrong_usage(said: CheckpointSettings) -> None:
    with pytest.raises(UsageError):
        decided(DETECTRON2, said, trained_norms=False, pixels_known=False)


def without(part: str, name: str = "torchvision") -> Tensors:
    return {key: value for key, value in originals(name).items() if part not in key}


def with_shape(key: str, *shape: int, name: str = "torchvision") -> Tensors:
    return {**originals(name), key: torch.zeros(shape)}


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: {"stem.conv1.weight": torch.zeros(1)}, "a ResNet alone"),
        (lambda: {"conv1.weight": torch.zeros(1), "fc.bias": torch.zeros(1)}, "a ResNet alone"),
        (lambda: {"conv1_w": torch.zeros(1)}, "a ResNet alone"),
        (lambda: {"backbone.res4.0.conv1.weight": torch.zeros(1)}, "without a feature pyramid"),
        (lambda: {"fc6_w": torch.zeros(1)}, "Detectron 1"),
        (lambda: {"transformer.weight": torch.zeros(1)}, "not a Mask R-CNN"),
        (lambda: without("mask_"), "no mask head"),
        (lambda: without("mask_", "detectron2"), "no mask head"),
        (lambda: without("layer4"), "not a ResNet's"),
        (lambda: without("cls_score"), "predicts 0 classes"),
        (lambda: with_shape(f"{PREDICTOR}.weight", 1, 1024), "predicts 0 classes"),
        (lambda: with_shape(f"{PREDICTOR}.weight", 20_000, 1), "predicts 19999 classes"),
        (lambda: with_shape("backbone.fpn.inner_blocks.0.1.weight", 256), "_v2 is another network"),
        (lambda: with_shape("roi_heads.keypoint_head.0.weight", 9), "keypoint_head"),
        (lambda: {**with_pixels((1, 2, 3)), "pixel_std": torch.zeros(3)}, "pixel_std"),
    ],
)  # fmt: skip
def test_other_networks_are_named(make: Callable[[], Tensors], reason: str) -> None:
    with pytest.raises(InputError, match=re.escape(reason)) as caught:
        recognise(make(), "file")
    assert caught.value.message.startswith("file: ")


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: without("layer1.0.conv1"), "lacks backbone.bottom_up.res2.0.conv1.weight and 0 more"),
        (lambda: without("bn1.running"), "lacks"),
        (lambda: with_shape("roi_heads.extra.weight", 1, name="detectron2"), "holds roi_heads.extra.weight, which"),
        (lambda: with_shape("backbone.body.layer1.0.conv2.weight", 64, 2, 3, 3), "(64, 2, 3, 3), not (64, 64, 3, 3)"),
        (lambda: with_shape("roi_heads.box_predictor.bbox_pred.weight", 8, 1024), "(4, 1024), not (12, 1024)"),
        (lambda: with_shape(f"{PREDICTOR}.bias"), "(), not (4,)"),
        (lambda: {**originals("torchvision"), f"{PREDICTOR}.bias": torch.full((4,), torch.nan)}, "not finite"),
        (lambda: {**originals("torchvision"), f"{PREDICTOR}.bias": torch.zeros(4, dtype=torch.int)}, "not finite"),
    ],
)  # fmt: skip
def test_tensors_that_do_not_fit_are_named(make: Callable[[], Tensors], reason: str) -> None:
    with pytest.raises(InputError, match=re.escape(reason)):
        build(recognise(make(), "file"), CheckpointSettings(), "file")


def test_names_of_classes() -> None:
    assert class_names(1, (), "file") == ("light_pole",)
    assert class_names(2, (), "file") == ("class_0", "class_1")
    assert class_names(2, ("light_pole", "sign"), "file") == ("light_pole", "sign")
    with pytest.raises(InputError, match="predicts 3 classes, 1 names"):
        class_names(3, ("light_pole",), "file")


def test_by_name_and_by_file(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="needs a weights file") as missing:
        segmentation.load("maskrcnn")
    assert "--segmenter FILE.pth" in missing.value.hint
    for name in ("a.pth", "a.pkl", "a.pt"):
        (tmp_path / name).write_bytes(b"nothing")
        with pytest.raises(InputError, match="not a whole"):
            segmentation.load(tmp_path / name)
    with pytest.raises(MissingError, match="no such weights file"):
        maskrcnn_segmenter.load(tmp_path / "none.pth")
