"""Mask R-CNN finds what torchvision's and Detectron2's own find with the same weights (golden/maskrcnn.npz)."""

from __future__ import annotations

from typing import Any

import maskrcnn_rule as rule
import numpy as np
import pytest
import torch
from maskrcnn_goldens import Golden, golden_of, tensors_of

from scpf.models import box_ops, maskrcnn_segmenter
from scpf.models.instances import BoolMask
from scpf.models.maskrcnn_conventions import CONVENTIONS, CheckpointSettings
from scpf.models.maskrcnn_heads import Detections
from scpf.models.maskrcnn_images import network_size
from scpf.models.maskrcnn_segmenter import MaskRCNNSegmenter

TOLERANCE = 1e-3  # px of boxes, and of scores and mask probabilities
NAMES = {"torchvision": ("light_pole", "sign", "tree"), "detectron2": ("light_pole", "b", "c", "d", "e")}


@pytest.fixture(scope="module", params=["torchvision", "detectron2"])
def compared(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Golden, MaskRCNNSegmenter, Detections]:
    """What the original found, the segmenter of its weights file, and what that found in the same picture."""
    name: str = request.param
    golden = golden_of(name)
    path = tmp_path_factory.mktemp("weights") / "model.pth"
    state: dict[str, Any] = tensors_of(name)
    torch.save({"model": state, "iteration": 7} if name == "detectron2" else state, path)
    settings = CheckpointSettings(
        classes=NAMES[name], short_side_px=rule.SHORT_SIDE_PX, long_side_px=rule.LONG_SIDE_PX
    )
    segmenter = maskrcnn_segmenter.load(path, threads=1, threshold=0.05, device="cpu", checkpoint=settings)
    path.unlink()
    return golden, segmenter, segmenter.detect([rule.picture()])[0]


def partners(golden: Golden, found: Detections) -> torch.Tensor:
    """For each of the original's detections the index of ours that is it."""
    same = torch.from_numpy(golden["classes"])[:, None] == found.classes[None]
    overlaps, index = (box_ops.overlaps(torch.from_numpy(golden["boxes"]), found.boxes) * same).max(1)
    assert float(overlaps.min()) > 0.99
    return index


def placed(mask: BoolMask, offset_px: tuple[int, int]) -> BoolMask:
    full = np.zeros((rule.HEIGHT_PX, rule.WIDTH_PX), bool)
    full[offset_px[1] : offset_px[1] + mask.shape[0], offset_px[0] : offset_px[0] + mask.shape[1]] = mask
    return full


def test_boxes_scores_and_masks_are_the_originals(
    compared: tuple[Golden, MaskRCNNSegmenter, Detections],
) -> None:
    golden, _, found = compared
    assert len(found.boxes) == len(golden["boxes"]) == 100
    index = partners(golden, found)
    assert len(index.unique()) == 100
    np.testing.assert_allclose(found.boxes[index], golden["boxes"], rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(found.scores[index], golden["scores"], rtol=0, atol=TOLERANCE)
    masks = golden["masks"].astype(np.float32) / 65535
    np.testing.assert_allclose(found.masks[index[: len(masks)]], masks, rtol=0, atol=TOLERANCE)


def test_instances_are_the_originals_in_the_picture(
    compared: tuple[Golden, MaskRCNNSegmenter, Detections], monkeypatch: pytest.MonkeyPatch
) -> None:
    golden, segmenter, found = compared
    monkeypatch.setattr(segmenter, "detect", lambda images: [found])
    instances = segmenter(rule.picture())
    assert [i.score for i in instances] == sorted((i.score for i in instances), reverse=True)
    assert len(instances) == 100  # none of whose masks is empty
    index = partners(golden, found)
    differing = 0
    for k, bits in enumerate(golden["pasted"]):
        instance = instances[int(index[k])]
        expected = np.unpackbits(bits, count=rule.HEIGHT_PX * rule.WIDTH_PX).astype(bool)
        actual = placed(instance.mask, instance.offset_px)
        differing += int((actual != expected.reshape(actual.shape)).sum())
        assert instance.box_px == pytest.approx(golden["boxes"][k], abs=TOLERANCE)
        assert instance.landmark_class == segmenter.classes[golden["classes"][k]]
        assert instance.mask[0].any() and instance.mask[-1].any()
        assert instance.mask[:, 0].any() and instance.mask[:, -1].any()
    assert differing <= 3  # of 20000: pixels whose probability is 0.5 to the last digits


def test_what_the_names_do_not_say_is_named(
    compared: tuple[Golden, MaskRCNNSegmenter, Detections],
) -> None:
    _, segmenter, _ = compared
    text = segmenter.description
    expected = {
        "torchvision": ("colour order RGB", "stride in the 3x3", "epsilon 1e-05", "3 classes"),
        "detectron2": ("colour order BGR", "stride in the 1x1", "5 classes"),
    }
    assert all(part in text for part in expected[segmenter.net.convention.name])


def test_the_network_sees_sizes_as_the_originals_make_them() -> None:
    golden = {"torchvision": (800, 1066), "detectron2": (800, 1067)}
    for name, size in golden.items():
        convention = CONVENTIONS[name]
        assert network_size((480, 640), 800, 1333, convention) == size
        assert network_size((1536, 2048), 800, 1333, convention) == size
        assert max(network_size((370, 1226), 800, 1333, convention)) == 1333
