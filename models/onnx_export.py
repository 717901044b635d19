"""PoleNet as ONNX, in single precision or quantised to 8 bits (the extra ``onnx``).

Quantised statically (Jacob et al. 2018): weights as signed numbers for each channel, activations as unsigned ones whose
ranges are those seen on pictures. The last convolutions stay in single precision. Weights use 7 of their 8 bits, since
CPUs without VNNI saturate sums of products of the full range.
"""

from __future__ import annotations

import logging
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from scpf.models import polenet, polenet_inference
from scpf.models.errors import MissingError, UsageError
from scpf.models.instances import Image
from scpf.models.onnx_segmenter import FORMAT, FORMAT_VERSION, INPUT, OUTPUTS
from scpf.models.segmentation import STRIDE_PX, frame
from scpf.models.whole_files import write_whole

LEAST_PICTURES = 4
_EXAMPLE_PX = (96, 128)
_HEADS = ("mask", "centre.1", "offsets")  # the convolutions that give the outputs


class _WholePoleNet(nn.Module):
    """The network with the steps before and after it: from the framed picture to probabilities."""

    def __init__(self, net: polenet.PoleNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        x = image.permute(0, 3, 1, 2).float() / 255
        mask, centre, offsets = self.net((x - polenet.PIXEL_MEAN) / polenet.PIXEL_DEVIATION)
        return mask.sigmoid(), centre.sigmoid(), offsets


def export(net: polenet.PoleNet, info: polenet.WeightsInfo, output: Path) -> None:
    """Writes ``net`` in single precision, with its description, for `onnx_segmenter`.

    Raises MissingError where the extra ``onnx`` is not installed.
    """
    _check_installed()
    import onnx

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "network.onnx"
        _trace(net, path)
        model = onnx.load(path)
    info = replace(info, tile_gate=None)  # the graph computes all
    description = {"format": FORMAT, "format_version": FORMAT_VERSION, "precision": "float32"}
    onnx.helper.set_model_props(model, {**description, "info": polenet.write_info(info)})
    write_whole(output, model.SerializeToString())


def quantise(exported: Path, output: Path, pictures: Sequence[Image]) -> None:
    """Writes a file of `export` in 8 bits. ``pictures``: (H, W, 3) uint8 RGB, of the kind it shall run on.

    Raises UsageError for fewer than `LEAST_PICTURES`, MissingError as `export`.
    """
    _check_installed()
    import onnx

    if len(pictures) < LEAST_PICTURES:
        raise UsageError(f"int8 needs {LEAST_PICTURES} pictures or more, to see what ranges there are")
    with tempfile.TemporaryDirectory() as folder:
        model = onnx.load(_quantised(exported, Path(folder), pictures))
    properties = {each.key: each.value for each in onnx.load(exported).metadata_props}
    onnx.helper.set_model_props(model, {**properties, "precision": "int8"})
    write_whole(output, model.SerializeToString())


def _check_installed() -> None:
    try:
        import onnx  # noqa: F401
        import onnxscript  # noqa: F401  # torch's exporter uses it
        from onnxruntime import quantization  # noqa: F401
    except ImportError as error:
        raise MissingError(
            "exporting needs onnx, onnxscript and onnxruntime", "pip install 'scpf[onnx]'"
        ) from error


def _trace(net: polenet.PoleNet, path: Path) -> None:
    traced = _WholePoleNet(polenet_inference.fold_batch_norm(net)).eval()
    example = torch.zeros(1, *_EXAMPLE_PX, 3, dtype=torch.uint8)
    height, width = torch.export.Dim("height_cells"), torch.export.Dim("width_cells")
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it tells of torchvision's absence, line by line
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of torch's exporter about itself
        torch.onnx.export(
            traced,
            (example,),
            path,
            input_names=[INPUT[0]],
            output_names=list(OUTPUTS),
            dynamic_shapes=({1: height * STRIDE_PX, 2: width * STRIDE_PX},),
            dynamo=True,
            external_data=False,
            verbose=False,
        )


def _quantised(path: Path, folder: Path, pictures: Sequence[Image]) -> Path:
    """The quantised network of the one at ``path``, in ``folder``."""
    import onnx
    from onnxruntime.quantization import (
        CalibrationDataReader,
        CalibrationMethod,
        QuantFormat,
        QuantType,
        quantize_static,
    )
    from onnxruntime.quantization.shape_inference import quant_pre_process

    class Pictures(CalibrationDataReader):  # type: ignore[misc]  # onnxruntime has no types
        def __init__(self) -> None:
            self._left = iter(pictures)

        def get_next(self) -> dict[str, Any] | None:
            image = next(self._left, None)
            return None if image is None else {INPUT[0]: frame(image)[0][None]}

    prepared, quantised = folder / "prepared.onnx", folder / "quantised.onnx"
    quant_pre_process(path, prepared, skip_symbolic_shape=True)
    heads = [
        node.name
        for node in onnx.load(prepared).graph.node
        if node.op_type == "Conv" and any(node.input[1] == f"net.{head}.weight" for head in _HEADS)
    ]
    assert len(heads) == len(_HEADS), heads
    quantize_static(
        prepared,
        quantised,
        Pictures(),
        quant_format=QuantFormat.QDQ,
        activation_type=QuantType.QUInt8,
        weight_type=QuantType.QInt8,
        per_channel=True,
        reduce_range=True,
        nodes_to_exclude=heads,
        calibrate_method=CalibrationMethod.MinMax,
    )
    return quantised
