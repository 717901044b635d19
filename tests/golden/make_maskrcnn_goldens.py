"""Asks torchvision's and Detectron2's own Mask R-CNN what they find, and writes maskrcnn.npz.

Run once by hand, in an environment of its own (5.5 GB; the project needs neither package):

    python3.11 -m venv originals
    originals/bin/pip install torch==2.14.1 torchvision==0.29.1 setuptools wheel numpy pillow
    originals/bin/pip install fvcore iopath yacs omegaconf termcolor tabulate pycocotools cloudpickle tqdm
    originals/bin/pip download --no-deps --no-build-isolation detectron2-cdo==0.5 && tar xzf detectron2_cdo-0.5.tar.gz
    originals/bin/python tests/golden/make_maskrcnn_goldens.py detectron2_cdo-0.5

Detectron2 0.5 is not on PyPI under its own name; detectron2-cdo 0.5 is its source, packed again. Its Mask R-CNN is
Python and calls torchvision's compiled operators, so its own need not be built: an empty module stands for them.
The weights follow from a rule (maskrcnn_rule), so the file holds what came out alone:

    NAME.tensors  names and shapes of the original's state dictionary, as JSON
    NAME.boxes (D, 4) px of the picture, NAME.scores (D,), NAME.classes (D,) from 0     all detections, float32
    NAME.masks (M, 28, 28)  probabilities of the first M, times 65535, uint16
    NAME.pasted (M, H W / 8)  those masks in the picture, at least 0.5, as bits
    NAME.loss.KIND, NAME.gradient.TENSOR  losses of a batch of two, and the norms of some of their sum's gradients

NAME: torchvision or detectron2. KIND: this project's names of the five losses. TENSOR: the original's own name.
"""

from __future__ import annotations

import json
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import maskrcnn_rule as rule

MASKS = 24
LOSSES = {
    "torchvision": {
        "loss_objectness": "objectness", "loss_rpn_box_reg": "proposal_box", "loss_classifier": "class",
        "loss_box_reg": "box", "loss_mask": "mask",
    },
    "detectron2": {
        "loss_rpn_cls": "objectness", "loss_rpn_loc": "proposal_box", "loss_cls": "class", "loss_box_reg": "box",
        "loss_mask": "mask",
    },
}  # fmt: skip
GRADIENTS = {
    "torchvision": (
        "backbone.body.layer3.0.conv2.weight", "backbone.fpn.inner_blocks.1.0.weight",
        "rpn.head.bbox_pred.weight", "roi_heads.box_head.fc6.weight", "roi_heads.mask_head.0.0.weight",
    ),
    "detectron2": (
        "backbone.bottom_up.res4.0.conv2.weight", "backbone.fpn_lateral3.weight",
        "proposal_generator.rpn_head.anchor_deltas.weight", "roi_heads.box_head.fc1.weight",
        "roi_heads.mask_head.mask_fcn1.weight",
    ),
}  # fmt: skip


def main() -> None:
    torch.set_num_threads(1)
    # Which anchors and proposals a training draws must not depend on torch's random numbers.
    torch.randperm = lambda n, **_: torch.arange(n)
    golden = {**torchvision_golden(), **detectron2_golden(Path(sys.argv[1]))}
    path = Path(__file__).with_name("maskrcnn.npz")
    np.savez_compressed(path, **golden)
    print(f"{path}: {path.stat().st_size} bytes")


def names(model: torch.nn.Module) -> Any:
    """Names and shapes of the model's tensors, as the bytes of their JSON."""
    shapes = {name: list(value.shape) for name, value in model.state_dict().items()}
    return np.frombuffer(json.dumps(shapes).encode(), np.uint8)


def fill(model: torch.nn.Module) -> None:
    """Gives the model the weights of the rule."""
    for name, value in model.state_dict().items():
        if value.is_floating_point():
            value.copy_(torch.from_numpy(rule.weights(name, tuple(value.shape))))


def found(name: str, boxes: Any, scores: Any, classes: Any, masks: Any, pasted: Any) -> dict[str, Any]:
    assert len(boxes) >= MASKS
    print(name, len(boxes), "detections, scores", scores[:3], scores[-3:], "classes", classes.bincount())
    return {
        f"{name}.boxes": boxes.numpy(),
        f"{name}.scores": scores.numpy(),
        f"{name}.classes": classes.numpy().astype(np.uint8),
        f"{name}.masks": np.round(masks[:MASKS].numpy() * 65535).astype(np.uint16),
        f"{name}.pasted": np.packbits(pasted[:MASKS].numpy().reshape(MASKS, -1), axis=1),
    }


def trained(name: str, model: torch.nn.Module, losses: dict[str, Any]) -> dict[str, Any]:
    sum(losses.values()).backward()
    print(name, {key: value.item() for key, value in losses.items()})
    parameters = dict(model.named_parameters())
    return {
        **{f"{name}.loss.{LOSSES[name][key]}": np.float64(value.detach()) for key, value in losses.items()},
        **{f"{name}.gradient.{key}": np.float64(parameters[key].grad.norm()) for key in GRADIENTS[name]},
    }


def torchvision_golden() -> dict[str, Any]:
    from torchvision.models.detection import maskrcnn_resnet50_fpn

    sizes = {"min_size": rule.SHORT_SIDE_PX, "max_size": rule.LONG_SIDE_PX}
    count = rule.CLASSES["torchvision"] + 1
    plain: dict[str, Any] = {"weights": None, "weights_backbone": None, "num_classes": count}
    model = maskrcnn_resnet50_fpn(**plain, **sizes).eval()
    fill(model)
    postprocess, raw = model.transform.postprocess, []

    def keeping_masks(results: Any, *sizes: Any) -> Any:
        raw.extend(result["masks"][:, 0].clone() for result in results)
        return postprocess(results, *sizes)

    model.transform.postprocess = keeping_masks
    with torch.inference_mode():
        out = model([torch.from_numpy(rule.picture()).permute(2, 0, 1).float() / 255])[0]
    golden = found(
        "torchvision", out["boxes"], out["scores"], out["labels"] - 1, raw[0], out["masks"][:, 0] >= 0.5
    )
    golden["torchvision.tensors"] = names(model)
    model = maskrcnn_resnet50_fpn(**plain, _skip_resize=True).train()
    fill(model)
    for module in model.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.eval()  # as frozen ones, which torchvision takes where it starts from weights
    targets = [
        {
            "boxes": torch.from_numpy(boxes),
            "labels": torch.tensor(classes) + 1,
            "masks": torch.from_numpy(masks).byte(),
        }
        for boxes, classes, masks in zip(
            rule.target_boxes(), rule.TARGET_CLASSES, rule.target_masks(), strict=True
        )
    ]
    images = torch.from_numpy(rule.pictures()).permute(0, 3, 1, 2).float() / 255
    return {**golden, **trained("torchvision", model, model(list(images), targets))}


def detectron2_golden(source: Path) -> dict[str, Any]:
    sys.modules["detectron2._C"] = types.ModuleType("detectron2._C")
    sys.path.insert(0, str(source))
    from PIL import Image

    Image.LINEAR = Image.BILINEAR  # its name in the Pillow of those days
    import detectron2
    from detectron2.config import get_cfg
    from detectron2.data import transforms
    from detectron2.modeling import GeneralizedRCNN, build_model
    from detectron2.structures import BitMasks, Boxes, Instances
    from detectron2.utils.events import EventStorage

    configuration = get_cfg()
    configs = Path(detectron2.__file__).parent / "model_zoo" / "configs"
    configuration.merge_from_file(configs / "COCO-InstanceSegmentation" / "mask_rcnn_R_50_FPN_3x.yaml")
    configuration.MODEL.DEVICE = "cpu"
    configuration.MODEL.BACKBONE.FREEZE_AT = 0
    configuration.MODEL.ROI_HEADS.NUM_CLASSES = rule.CLASSES["detectron2"]
    model = build_model(configuration).eval()
    fill(model)
    bgr = rule.picture()[:, :, ::-1]
    sizes = ([rule.SHORT_SIDE_PX] * 2, rule.LONG_SIDE_PX)
    scaled = transforms.ResizeShortestEdge(*sizes).get_transform(bgr).apply_image(bgr)
    image = torch.as_tensor(scaled.astype("float32").transpose(2, 0, 1))  # as its DefaultPredictor does
    inputs = [{"image": image, "height": rule.HEIGHT_PX, "width": rule.WIDTH_PX}]
    with torch.inference_mode():
        raw = model.inference(inputs, do_postprocess=False)[0]
        whole = raw.pred_boxes.nonempty()  # the others go once the boxes are scaled
        masks = raw.pred_masks[whole, 0].clone()
        out = GeneralizedRCNN._postprocess([raw], inputs, [image.shape[-2:]])[0]["instances"]
    golden = found("detectron2", out.pred_boxes.tensor, out.scores, out.pred_classes, masks, out.pred_masks)
    golden["detectron2.tensors"] = names(model)
    size = (rule.HEIGHT_PX, rule.WIDTH_PX)
    batch = []
    for picture, boxes, classes, shapes in zip(
        rule.pictures(), rule.target_boxes(), rule.TARGET_CLASSES, rule.target_masks(), strict=True
    ):
        instances = Instances(size)
        instances.gt_boxes = Boxes(torch.from_numpy(boxes))
        instances.gt_classes = torch.tensor(classes)
        instances.gt_masks = BitMasks(torch.from_numpy(shapes))
        bgr = torch.from_numpy(np.ascontiguousarray(picture[:, :, ::-1].transpose(2, 0, 1)))
        batch.append({"image": bgr, "instances": instances, "height": size[0], "width": size[1]})
    model.train()
    with EventStorage(0):
        return {**golden, **trained("detectron2", model, model(batch))}


if __name__ == "__main__":
    main()
