"""How many poles a frame of the simulated Ring Road shows, counted as a person labels: the paper's histogram.

By hand (a quarter of an hour on two cores):

    python tests/benchmarks/pole_statistics.py --frames out/statistics.frames

The frames are kept in that folder, and taken up again by a second run.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from scpf.sample_logs.drive_frames import DriveSettings, SimulatedDrive
from scpf.sample_logs.finished_frames import FinishedFrame, SeenPole
from scpf.sample_logs.render_jobs import Make, open_folder, render_all
from scpf.sample_logs.renderer import warm_up
from scpf.sample_logs.simulation import program_hash, stored

ROUTE_M = 1200.0
FULL_WIDTH_PX = 2048
LEAST_HEIGHT_PX, LEAST_FRACTION = 60.0, 0.3
"""At full width: what a person would label."""
REACHES_M = (35.0, 45.0, 48.0, 50.0, 60.0)


@dataclass(frozen=True)
class EveryNth:
    """Renders every so many frames of a drive."""

    drive: SimulatedDrive
    every: int

    def __call__(self) -> Make:
        make = self.drive()
        return lambda index: make(index * self.every)


def is_labelled(pole: SeenPole, reach_m: float, width_px: int) -> bool:
    """Whether a person would label the pole."""
    high = pole.instance.height_px >= LEAST_HEIGHT_PX * width_px / FULL_WIDTH_PX
    return high and pole.visible_fraction >= LEAST_FRACTION and pole.distance_m <= reach_m


def table(frames: list[FinishedFrame], width_px: int) -> str:
    """One line a reach: mean, histogram, share of the poles that the upper edge cuts."""
    lines = [
        "| counted up to | poles | mean | 0 / 1 / 2 / 3 / 4 poles, % of the frames | cut by the upper edge |"
    ]
    lines.append("| --- | --- | --- | --- | --- |")
    for reach_m in REACHES_M:
        kept = [[pole for pole in frame.poles if is_labelled(pole, reach_m, width_px)] for frame in frames]
        counts = Counter(len(poles) for poles in kept)
        shares = " / ".join(f"{100 * counts[number] / len(frames):.0f}" for number in range(5))
        everyone = [pole for poles in kept for pole in poles]
        cut = np.mean([pole.instance.box_px[1] <= 0.0 for pole in everyone])
        line = f"| {reach_m:.0f} m | {len(everyone)} | {len(everyone) / len(frames):.2f} | {shares} |"
        lines.append(f"{line} {100 * cut:.0f} % |")
    return "\n".join(lines)


def main() -> None:
    """Render, count, print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--frames", type=Path, required=True)
    parser.add_argument("--start-m", type=float, default=0.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--width", type=int, default=1024)
    parser.add_argument("--every", type=int, default=3)
    parser.add_argument("--weather", default="cloudy")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    settings = DriveSettings(
        given.start_m, 115.0, given.seed, weather=given.weather, width_px=given.width, quality=75
    )
    drive = SimulatedDrive(settings)
    driven = int(np.searchsorted(drive.vehicle.frames.s_m, given.start_m + ROUTE_M))
    count = driven // given.every
    given.frames.parent.mkdir(parents=True, exist_ok=True)
    identity = {"settings": asdict(settings), "every": given.every, "program": program_hash()}
    open_folder(given.frames, identity, overwrite=True)
    warm_up(print)
    render_all(given.frames, count, EveryNth(drive, given.every), workers=given.workers)
    print(f"{count} frames of {ROUTE_M:.0f} m, seed {given.seed}, {settings.weather}")
    print(table(list(stored(given.frames, count)), given.width))


if __name__ == "__main__":
    main()
