"""The contact sheet of the simulator's weathers that docs/SIMULATOR.md shows: twelve frames of simulated drives.

By hand (a minute on one core):

    python tests/benchmarks/weather_sheet.py docs/images/weathers.jpg
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from scpf.models.instances import Image
from scpf.models.whole_files import write_whole
from scpf.sample_logs.drive_frames import DriveSettings, SimulatedDrive

FRAMES = (
    ("clear", 1, 936.0),
    ("cloudy", 0, 96.0),
    ("overcast", 1, 846.0),
    ("rain", 2, 1806.0),
    ("lowsun", 0, 132.0),
    ("dusk", 1, 930.0),
    ("clear", 0, 1524.0),
    ("cloudy", 1, 1960.0),
    ("overcast", 2, 1110.0),
    ("rain", 0, 1560.0),
    ("lowsun", 1, 420.0),
    ("dusk", 0, 1590.0),
)
"""Weather, seed, and where along the Ring Road."""
COLUMNS, WIDTH_PX, SHOWN_PX, QUALITY = 3, 1024, (512, 384), 80


def picture(weather: str, seed: int, start_m: float) -> Image:
    """The first frame of a drive, BGR."""
    drive = SimulatedDrive(DriveSettings(start_m, 1.0, seed, weather=weather, width_px=WIDTH_PX, quality=95))
    frame = cv2.imdecode(np.frombuffer(drive()(0).jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert frame is not None
    return np.asarray(cv2.resize(frame, SHOWN_PX, interpolation=cv2.INTER_AREA), np.uint8)


def main() -> None:
    """Render and write the sheet."""
    shown = [picture(*frame) for frame in FRAMES]
    rows = [np.hstack(shown[k : k + COLUMNS]) for k in range(0, len(shown), COLUMNS)]
    done, data = cv2.imencode(".jpg", np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    assert done
    write_whole(Path(sys.argv[1]), data.tobytes())


if __name__ == "__main__":
    main()
