"""PoleNet in ONNX Runtime (the extra ``onnx``): the files that `scpf.models.onnx_export` writes.

The graph takes the picture as it is framed, ``image`` (1, H, W, 3) uint8 RGB, and gives the probabilities ``mask``
(1, 1, H, W) and ``centre`` (1, 1, H/8, W/8) and the ``offsets`` (1, 2, H/4, W/4).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scpf.models.errors import InputError, MissingError
from scpf.models.instances import Image, Instance
from scpf.models.segmentation import DEFAULT_THRESHOLD, frame, instances

if TYPE_CHECKING:
    from scpf.models.devices import DeviceName
    from scpf.models.polenet import WeightsInfo

FORMAT, FORMAT_VERSION = "scpf-polenet-onnx", "1"
INPUT = ("image", "tensor(uint8)", 4)
OUTPUTS = ("mask", "centre", "offsets")
_ERRORS_ONLY = 3


class OnnxSegmenter:
    """Finds light poles in an image (H, W, 3), uint8, RGB; best score first."""

    def __init__(self, session: Any, info: WeightsInfo, threshold: float = DEFAULT_THRESHOLD) -> None:
        self.info = info
        self.threshold = threshold
        self._session = session

    def __call__(self, image: Image) -> list[Instance]:
        """Instances with a calibrated score of at least the threshold, masks at the resolution of ``image``."""
        framed, shown_px = frame(image)
        mask, centre, offsets = self.maps(framed)
        return instances(
            mask, centre, offsets, image.shape[:2], shown_px, self.info.calibration, self.threshold
        )

    def maps(self, framed: Image) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        """As `scpf.models.polenet_inference.maps`."""
        mask, centre, offsets = self._session.run(OUTPUTS, {INPUT[0]: framed[None]})
        return mask[0, 0], centre[0, 0], offsets[0]


def load(
    path: Path | None = None,
    *,
    threads: int | None = None,
    threshold: float = DEFAULT_THRESHOLD,
    bfloat16: bool = False,
    device: DeviceName = "cpu",
) -> OnnxSegmenter:
    """The segmenter of a file. ``threads``: CPU threads; by default ONNX Runtime's own choice.

    ``device``: cuda needs onnxruntime-gpu; auto is the CPU. ``bfloat16`` changes nothing: the file says its precision.
    Raises MissingError where file, ONNX Runtime or device is not there, InputError where the file is damaged or
    another network.
    """
    from scpf.models import polenet

    try:
        import onnxruntime
    except ImportError as error:
        raise MissingError(f"{path or 'onnx'}: needs ONNX Runtime", "pip install 'scpf[onnx]'") from error
    if path is None or not path.is_file():
        raise MissingError(
            f"{path or 'onnx'}: no such network", "scpf export polenet --onnx NAME.onnx makes one"
        )
    provider = "CUDAExecutionProvider" if device == "cuda" else "CPUExecutionProvider"
    if device == "mps" or provider not in onnxruntime.get_available_providers():
        raise MissingError(f"{path}: this ONNX Runtime knows no {device}", "use --device cpu")
    options = onnxruntime.SessionOptions()
    options.log_severity_level = _ERRORS_ONLY
    if threads is not None:
        options.intra_op_num_threads = options.inter_op_num_threads = threads
    try:
        # From bytes, a graph cannot point at other files for its weights.
        session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=[provider])
    except Exception as error:  # its own exceptions share no base but this
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: not an ONNX network that can be run ({reason})") from error
    metadata = session.get_modelmeta().custom_metadata_map
    if metadata.get("format") != FORMAT:
        raise InputError(f"{path}: not PoleNet as scpf exports it", "scpf export polenet --onnx NAME.onnx")
    if metadata.get("format_version") != FORMAT_VERSION:
        found = metadata.get("format_version")
        raise InputError(
            f"{path}: format {found}, this scpf reads {FORMAT_VERSION}", "update scpf, or export it anew"
        )
    inputs = [(each.name, each.type, len(each.shape)) for each in session.get_inputs()]
    if inputs != [INPUT] or tuple(each.name for each in session.get_outputs()) != OUTPUTS:
        raise InputError(f"{path}: its inputs and outputs are not PoleNet's")
    return OnnxSegmenter(session, polenet.read_info(path, metadata.get("info", "")), threshold)
