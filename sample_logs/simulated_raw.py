"""A simulated drive as the files that camera, receiver and recorder leave, for `scpf ingest` and `convert`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from scpf.ingest.calibration import to_yaml
from scpf.ingest.maps import encode_map
from scpf.models.errors import InputError
from scpf.sample_logs.bags_out import write_ros1_bag, write_rosbag2
from scpf.sample_logs.drive_frames import SimulatedDrive
from scpf.sample_logs.finished_frames import FinishedFrame
from scpf.sample_logs.raw_camera import RecordedPicture, write_basler_folder, write_mp4
from scpf.sample_logs.raw_logs import write_raw_logs
from scpf.sample_logs.rectify import Rectifier
from scpf.sample_logs.sensors import InsLog

NO_VIDEO: Final = "drive.mp4: a video needs PyAV (pip install 'scpf[video]')"


def check_raw_folder(folder: Path) -> None:
    """Raise InputError where files could not be put there; nothing that exists is ever replaced."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder} exists", "choose another folder for --raw, or remove it")
    if not folder.parent.is_dir():
        raise InputError(f"{folder}: there is no folder {folder.parent}")


def write_raw(
    folder: Path, drive: SimulatedDrive, ins: InsLog, frames: Callable[[], Iterator[FinishedFrame]]
) -> list[str]:
    """Write all raw files of a drive into ``folder``, which is made anew; returns what was left out, in words.

    ``frames`` gives the rendered frames, from the first each time. Pictures of the bags are rectified, as their topic
    says; all others are the log's own bytes.
    """
    shutil.rmtree(folder, ignore_errors=True)
    write_raw_logs(folder, ins)
    (folder / "camera.yaml").write_bytes(to_yaml(drive.camera))
    (folder / "map.geojson").write_bytes(encode_map(drive.road.mapped()))
    write_basler_folder(folder / "basler", folder / "basler_times.csv", _pictures(drive, frames()))
    left_out = []
    if find_spec("av") is None:
        left_out.append(NO_VIDEO)
    else:
        write_mp4(folder / "drive.mp4", folder / "drive_times.csv", _pictures(drive, frames()))
    rectifier = Rectifier(drive.camera)
    for write, name in ((write_ros1_bag, "drive.bag"), (write_rosbag2, "drive_ros2")):
        straight = _rectified(_pictures(drive, frames()), rectifier)
        write(folder / name, ins, straight, rectifier.camera)
    return left_out


def _pictures(drive: SimulatedDrive, frames: Iterable[FinishedFrame]) -> Iterator[RecordedPicture]:
    vehicle = drive.vehicle
    stamps_ns, numbers = vehicle.stamps_ns.tolist(), vehicle.frame_numbers.tolist()
    for stamp_ns, number, frame in zip(stamps_ns, numbers, frames, strict=True):
        yield RecordedPicture(stamp_ns, number, frame.jpeg)


def _rectified(pictures: Iterable[RecordedPicture], rectifier: Rectifier) -> Iterator[RecordedPicture]:
    for picture in pictures:
        yield picture._replace(jpeg=rectifier.jpeg(picture.jpeg))
