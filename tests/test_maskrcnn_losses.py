"""The training losses are the originals' (golden/maskrcnn.npz), and so are their gradients; a step makes them less."""

from __future__ import annotations

import maskrcnn_rule as rule
import numpy as np
import pytest
import torch
from maskrcnn_goldens import golden_of, tensors_of

from scpf.models import maskrcnn_losses
from scpf.models.checkpoint_keys import recognise
from scpf.models.maskrcnn import MaskRCNN
from scpf.models.maskrcnn_conventions import CheckpointSettings
from scpf.models.maskrcnn_losses import Target, draw, losses, match
from scpf.models.maskrcnn_segmenter import build

SAME = {  # what a tensor of torchvision is called here
    "backbone.body.layer3.0.conv2.weight": "backbone.bottom_up.res4.0.conv2.weight",
    "backbone.fpn.inner_blocks.1.0.weight": "backbone.fpn_lateral3.weight",
    "rpn.head.bbox_pred.weight": "proposal_generator.rpn_head.anchor_deltas.weight",
    "roi_heads.box_head.fc6.weight": "roi_heads.box_head.fc1.weight",
    "roi_heads.mask_head.0.0.weight": "roi_heads.mask_head.mask_fcn1.weight",
}


def network(name: str) -> MaskRCNN:
    return build(recognise(tensors_of(name), "golden"), CheckpointSettings(), "golden")[0].train()


def batch() -> tuple[torch.Tensor, list[Target]]:
    images = torch.from_numpy(rule.pictures()).permute(0, 3, 1, 2)
    targets = [
        Target(torch.from_numpy(boxes), torch.tensor(classes), torch.from_numpy(masks))
        for boxes, classes, masks in zip(
            rule.target_boxes(), rule.TARGET_CLASSES, rule.target_masks(), strict=True
        )
    ]
    return images, targets


@pytest.mark.parametrize("name", ["torchvision", "detectron2"])
def test_losses_and_gradients_are_the_originals(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "randperm", lambda n, **_: torch.arange(n))  # as the originals were asked
    torch.set_num_threads(1)
    golden = golden_of(name)
    net = network(name)
    images, targets = batch()
    found = losses(net, net.normalise(images), targets)
    assert {f"loss.{kind}" for kind in found} == {key for key in golden if key.startswith("loss.")}
    for kind, loss in found.items():
        assert loss.item() == pytest.approx(float(golden[f"loss.{kind}"]), rel=1e-4), kind
    torch.stack(list(found.values())).sum().backward()
    parameters = dict(net.named_parameters())
    gradients = [key for key in golden if key.startswith("gradient.")]
    assert len(gradients) == 5
    for key in gradients:
        original = key.removeprefix("gradient.")
        gradient = parameters[SAME.get(original, original)].grad
        assert gradient is not None
        assert float(gradient.norm()) == pytest.approx(float(golden[key]), rel=1e-3), key


def test_what_is_frozen_has_no_gradient_and_the_rest_learns() -> None:
    torch.set_num_threads(1)
    net = network("detectron2")
    maskrcnn_losses.freeze_first_stages(net)
    images, targets = batch()
    normalised = net.normalise(images)[:1]
    optimizer = torch.optim.SGD([p for p in net.parameters() if p.requires_grad], 1e-5)
    totals = []
    for _ in range(2):
        found = losses(net, normalised, targets[:1], torch.Generator().manual_seed(5))
        total = torch.stack(list(found.values())).sum()
        optimizer.zero_grad()
        total.backward()
        optimizer.step()
        totals.append(total.item())
    assert totals[1] < totals[0]
    for name, parameter in net.named_parameters():
        frozen = ".stem." in name or ".res2." in name
        assert (parameter.grad is None) == frozen, name


def test_a_picture_without_objects_teaches_background() -> None:
    torch.set_num_threads(1)
    net = network("torchvision")
    images, _ = batch()
    none = Target(
        torch.zeros(0, 4), torch.zeros(0, dtype=torch.long), torch.zeros(0, 121, 203, dtype=torch.bool)
    )
    found = losses(net, net.normalise(images[:1]), [none], torch.Generator().manual_seed(5))
    assert [found[kind].item() for kind in ("proposal_box", "box", "mask")] == [0, 0, 0]
    assert found["objectness"].item() > 0
    assert found["class"].item() > 0
    torch.stack(list(found.values())).sum().backward()  # which needs every loss to depend on the network


def test_matches() -> None:
    truth = torch.tensor([[0.0, 0, 10, 10], [100, 100, 110, 140]])
    boxes = torch.tensor([
        [0.0, 0, 10, 10], [0, 0, 10, 20], [0, 0, 10, 40], [100, 100, 110, 110], [200, 200, 210, 210],
    ])  # fmt: skip
    labels, which = match(boxes, truth, 0.3, 0.7)
    assert labels.tolist() == [1, -1, 0, 0, 0]
    assert which[:4].tolist() == [0, 0, 0, 1]
    assert match(boxes, truth, 0.3, 0.7, best_too=True)[0].tolist() == [1, -1, 0, 1, 0]
    assert match(boxes, truth[:0], 0.3, 0.7)[0].tolist() == [0] * 5


def test_draws() -> None:
    labels = torch.tensor([1] * 10 + [0] * 100 + [-1] * 50)
    positive, negative = draw(labels, 16, 0.25, torch.Generator().manual_seed(1))
    assert len(positive) == 4 and len(negative) == 12
    assert bool((labels[positive] == 1).all() and (labels[negative] == 0).all())
    again = draw(labels, 16, 0.25, torch.Generator().manual_seed(1))
    assert torch.equal(positive, again[0]) and torch.equal(negative, again[1])
    few = draw(labels[8:], 16, 0.25, None)
    assert len(few[0]) == 2 and len(few[1]) == 14


@pytest.mark.parametrize("name", ["torchvision", "detectron2"])
def test_mask_targets_of_a_box_show_its_mask(name: str) -> None:
    with torch.device("meta"):
        net = MaskRCNN(1, recognise(tensors_of(name), "golden").convention)
    mask = torch.zeros(1, 56, 56, dtype=torch.bool)
    mask[0, :, 14:28] = True
    box, first = torch.tensor([[0.0, 0, 56, 56]]), torch.zeros(1, dtype=torch.long)
    cells = maskrcnn_losses.mask_targets(mask, box, first, net)[0]
    expected = np.zeros((28, 28))
    expected[:, 7:14] = 1
    assert np.abs(cells.numpy() - expected).max() <= 0.5
    assert np.abs(cells.numpy() - expected).mean() < 0.04
