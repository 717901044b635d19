"""What a picture costs from JPEG bytes to instances: decode, network, grouping; torch beside ONNX Runtime.

Not run by default. By hand (five minutes; needs `scpf[onnx]`):

    SCPF_BENCHMARK=1 pytest tests/benchmarks/test_segmenter_cost.py -s
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch

from scpf.ingest.drive_log import DriveLog
from scpf.models import polenet, polenet_inference, segmentation
from scpf.models.instances import Instance
from scpf.models.maskrcnn import MaskRCNN, for_inference
from scpf.models.maskrcnn_conventions import TORCHVISION, CheckpointSettings
from scpf.models.maskrcnn_segmenter import MaskRCNNSegmenter
from scpf.models.onnx_segmenter import OnnxSegmenter
from scpf.replay.frames import decode
from scpf.replay.network_export import export_network
from scpf.sample_logs.street_scenes import scene

pytestmark = pytest.mark.skipif(
    "SCPF_BENCHMARK" not in os.environ, reason="a benchmark: SCPF_BENCHMARK=1 runs it"
)

SIZES_PX = ((2048, 1536), (1024, 768))
KINDS = ("drive", "scene")
WITHOUT_GATE = "torch float32 without gate"
DIRECT = "torch float32 by oneDNN alone"
SEED, FRAME = 900_009, 90
SAMPLE = Path(__file__).parents[2] / "sample_logs" / "ring_road.mcap"
ROUNDS = 12
WORKERS, PICTURES, CLOCK_ROUNDS = 2, 16, 5
Call = Callable[[], Any]


@pytest.fixture(scope="module")
def segmenters(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("onnx")
    found: dict[str, Any] = {"torch float32": segmentation.load("polenet", threads=1)}
    whole: Any = segmentation.load("polenet", threads=1)
    whole.info = replace(whole.info, tile_gate=None)
    found[WITHOUT_GATE] = whole
    direct: Any = segmentation.load("polenet", threads=1)
    folded = polenet_inference.fold_batch_norm(polenet.load(polenet.weights_path("polenet"))[0])
    direct._net = polenet_inference.channels_last(folded)
    polenet_inference._pointwise_by_onednn(folded)
    found[DIRECT] = direct
    if polenet_inference.has_fast_bfloat16():
        found["torch bfloat16"] = segmentation.load("polenet", threads=1, bfloat16=True)
    for precision in ("float32", "int8"):
        path = folder / f"{precision}.onnx"
        export_network("polenet", path, precision, [], False, print)
        found[f"onnx {precision}"] = segmentation.load(path, threads=1)
    return found


def picture(kind: str) -> np.ndarray:
    """A painted scene, full of what looks like poles, or a frame of the sample drive."""
    if kind == "scene":
        return scene(SEED)[0]
    with DriveLog(SAMPLE) as log:
        data = next(islice(log.images(), FRAME, None)).data
    return decode(data, "")[:, :, ::-1]


def jpeg(kind: str, size_px: tuple[int, int]) -> bytes:
    image = picture(kind)
    return cv2.imencode(".jpg", cv2.resize(image, size_px), [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes()


def network(segmenter: Any, framed: np.ndarray) -> tuple[np.ndarray, ...]:
    if isinstance(segmenter, OnnxSegmenter):
        return segmenter.maps(framed)
    return polenet_inference.maps(segmenter._net, framed, segmenter.info.tile_gate)


def _found_in(segmenter: Any, encoded: bytes) -> list[Instance]:
    return segmenter(decode(encoded, ""))  # type: ignore[no-any-return]


def cpu_ms_once(call: Call) -> float:
    begun = time.process_time()
    call()
    return 1000 * (time.process_time() - begun)


def cpu_ms(calls: dict[str, Call]) -> dict[str, float]:
    """The least CPU time of each over interleaved rounds."""
    best: dict[str, float] = {}
    for _ in range(ROUNDS):
        for name, call in calls.items():
            best[name] = min(best.get(name, np.inf), cpu_ms_once(call))
    return best


@pytest.mark.parametrize("size_px", SIZES_PX)
@pytest.mark.parametrize("kind", KINDS)
def test_the_parts(kind: str, size_px: tuple[int, int], segmenters: dict[str, Any]) -> None:
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    encoded = jpeg(kind, size_px)
    image = decode(encoded, "")
    framed, shown_px = segmentation.frame(image)
    maps = network(segmenters["torch float32"], framed)
    info = segmenters["torch float32"].info
    calls: dict[str, Call] = {
        "decode": lambda: decode(encoded, ""),
        "frame": lambda: segmentation.frame(image),
        "grouping": lambda: segmentation.instances(
            maps[0], maps[1], maps[2], image.shape[:2], shown_px, info.calibration, 0.1
        ),
    }
    for name, segmenter in segmenters.items():
        calls[name] = partial(network, segmenter, framed)
    costs = cpu_ms(calls)
    print(
        f"\n{kind} of {size_px[0]}×{size_px[1]}, CPU ms on one core: "
        + ", ".join(f"{k} {v:.1f}" for k, v in costs.items())
    )
    around = costs["decode"] + costs["frame"] + costs["grouping"]
    for name in segmenters:
        print(
            f"  {name}: {around + costs[name]:.0f} ms, {2000 / (around + costs[name]):.1f} frames/s on two cores"
        )
    assert costs["onnx int8"] < 0.9 * costs["onnx float32"]
    assert costs["torch float32"] < 0.95 * costs[WITHOUT_GATE]
    assert costs["torch float32"] < 0.95 * costs[DIRECT]


@pytest.mark.parametrize("size_px", SIZES_PX)
@pytest.mark.parametrize("kind", KINDS)
def test_frames_a_second_of_two_workers(
    kind: str, size_px: tuple[int, int], segmenters: dict[str, Any]
) -> None:
    cv2.setNumThreads(1)
    encoded = jpeg(kind, size_px)
    rates: dict[str, list[float]] = {name: [] for name in segmenters}
    with ThreadPoolExecutor(WORKERS, initializer=torch.set_num_threads, initargs=(1,)) as pool:
        for _ in range(CLOCK_ROUNDS):
            for name, segmenter in segmenters.items():
                list(pool.map(partial(_found_in, segmenter), [encoded] * 4))
                begun = time.perf_counter()
                list(pool.map(partial(_found_in, segmenter), [encoded] * PICTURES))
                rates[name].append(PICTURES / (time.perf_counter() - begun))
    for name, each in rates.items():
        print(
            f"\n{kind} of {size_px[0]}×{size_px[1]}, {name}: median {np.median(each):.1f}, "
            f"best {max(each):.1f} frames/s, load {os.getloadavg()[0]:.1f}"
        )


@pytest.mark.parametrize("size_px", SIZES_PX)
def test_mask_rcnn_beside_it(size_px: tuple[int, int]) -> None:
    """The paper's network; its cost hardly depends on the weights, which none ship: random ones stand in."""
    torch.manual_seed(0)
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    encoded = jpeg("drive", size_px)
    dtypes = {"float32": torch.float32}
    if polenet_inference.has_fast_bfloat16():
        dtypes["bfloat16"] = torch.bfloat16
    for name, dtype in dtypes.items():
        net = for_inference(MaskRCNN(1, TORCHVISION).eval(), torch.device("cpu"), dtype)
        segmenter = MaskRCNNSegmenter(net, ("light_pole",), CheckpointSettings())
        costs = [cpu_ms_once(partial(_found_in, segmenter, encoded)) for _ in range(3)]
        best = min(costs)
        print(
            f"\n{size_px[0]}×{size_px[1]}, Mask R-CNN in {name}: {best / 1000:.2f} core-s, "
            f"{2000 / best:.2f} frames/s on two cores"
        )


def test_what_eight_bits_cost(segmenters: dict[str, Any], tmp_path: Path) -> None:
    """Precision and recall on painted scenes that no training saw."""
    from scpf.models.labelled_images import ids_images
    from scpf.models.segmentation_evaluation import EvaluationSettings, evaluate
    from scpf.sample_logs.scene_files import write_scenes

    write_scenes(tmp_path, range(2_000_000, 2_000_060))
    images = ids_images(tmp_path)
    for name, segmenter in segmenters.items():
        segmenter.threshold = 0.05
        figures = evaluate(segmenter, images, EvaluationSettings()).document()["figures"]
        kept = ("mask_ap50", "precision", "recall", "thickness_error_median_px")
        print(f"\n{name}: " + ", ".join(f"{key} {figures[key]:.3f}" for key in kept))
