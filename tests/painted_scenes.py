"""Small painted street scenes as files, for tests of training."""

from __future__ import annotations

from pathlib import Path

import cv2

from scpf.sample_logs.street_scenes import scene


def write_painted_scenes(folder: Path, size_px: tuple[int, int], count: int = 4) -> Path:
    """Write SEED.jpg and SEED.ids.png of the first ``count`` seeds; returns ``folder``."""
    for seed in range(count):
        image, ids = scene(seed, size_px)
        cv2.imwrite(str(folder / f"{seed}.jpg"), image)
        cv2.imwrite(str(folder / f"{seed}.ids.png"), ids)
    return folder
