"""What became of the files that a drive log was made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

SHOWN: Final = 10
"""Of each finding, how many are named."""


@dataclass
class AssemblyReport:
    """What became a drive log, and what did not. Times in seconds, ``dropped``: reason → count."""

    path: str
    frames: int = 0
    poses: int = 0
    poses_left_out: int = 0
    """Poses more than a second before the first or after the last image: no frame needs them."""
    landmarks: int = 0
    duration_s: float = 0.0
    median_interval_s: float = 0.0
    gaps: list[tuple[float, float]] = field(default_factory=list)
    """Start after the first image, and length, of each interval that is 1.5 times the median, or more."""
    overlap_s: float = 0.0
    """How long images and trajectory run side by side."""
    frames_without_pose: int = 0
    """Frames in the log that lie outside the trajectory, or in a gap of it."""
    duplicates: int = 0
    """Images with the very bytes of the one before: the camera, or a recorder, repeated a frame."""
    duplicates_left_out: int = 0
    """Those of them that were left out, as asked."""
    duplicates_at_s: list[float] = field(default_factory=list)
    """When the first ten of them were, after the first image."""
    frames_missing: int = 0
    """Frames that the images' own counters lack: dropped before they reached this tool."""
    encoding: str = ""
    """How pixels were encoded that came as no JPEG or PNG; empty where each image kept its own bytes."""
    dropped: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def lossless(self) -> bool:
        """Whether everything given is in the log."""
        return not self.dropped
