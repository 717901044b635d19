"""Two thousand and more damaged logs: reading and recovering raise nothing but our own errors."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from damaged_logs import repack

from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.ingest.recover import recover_into
from scpf.models.camera import Camera
from scpf.models.errors import ScpfError
from scpf.models.geodesy import Origin
from scpf.models.instances import instance_from_mask
from scpf.models.road_map import Landmark, RoadMap, to_geojson

T0 = 1_660_847_613_000_000_000
COUNT = 2100
EXTREMES = (0, 1, 0x7F, 0xFF, 0xFFFF, 0xFFFFFFFF, 1 << 31, 1 << 60, (1 << 64) - 1)


def build(path: Path) -> bytes:
    """A log with everything in it, as small as it gets."""
    origin = Origin(43.0, -80.0, 300.0)
    road = RoadMap(
        (Landmark("a", (10.0, 5.0, 0.0)),), np.column_stack([np.arange(3.0), np.zeros(3)]), origin=origin
    )
    with DriveLogWriter(path, origin=origin) as log:
        log.write_camera(T0, Camera(64, 48, np.array([[70.0, 0, 32], [0, 70, 24], [0, 0, 1]])))
        for k in range(3):
            log.write_image(T0 + k, bytes([k]) * 100, "jpeg")
            log.write_pose(T0 + k, np.eye(4), 0.1)
            log.write_gps(T0 + k, np.zeros(2), 4.0)
            log.write_instances(T0 + k, [instance_from_mask(np.ones((3, 4), bool))])
        log.attach("map.geojson", "application/geo+json", json.dumps(to_geojson(road)).encode())
        log.metadata("scpf", {"made_by": "a test"})
    return path.read_bytes()


def flip(data: bytearray, rng: np.random.Generator) -> None:
    for place in rng.integers(len(data), size=rng.integers(1, 6)):
        data[place] ^= 1 << rng.integers(8)


def overwrite(data: bytearray, rng: np.random.Generator) -> None:
    size = int(rng.choice([1, 2, 4, 8]))
    place = int(rng.integers(len(data) - 8))
    value = EXTREMES[rng.integers(len(EXTREMES))] & ((1 << 8 * size) - 1)
    data[place : place + size] = value.to_bytes(size, "little")


def lie(data: bytearray, rng: np.random.Generator) -> None:
    """Change a number that looks like a length: small, followed by zeros."""
    array = np.frombuffer(bytes(data), dtype=np.uint8)
    places = np.flatnonzero((array[:-4] > 0) & (array[2:-2] == 0) & (array[3:-1] == 0))
    place = int(rng.choice(places))
    data[place : place + 4] = struct.pack("<I", EXTREMES[rng.integers(len(EXTREMES))] & 0xFFFFFFFF)


def cut(data: bytearray, rng: np.random.Generator) -> None:
    del data[rng.integers(len(data)) :]


def remove(data: bytearray, rng: np.random.Generator) -> None:
    place = int(rng.integers(len(data)))
    del data[place : place + int(rng.integers(1, 200))]


def repeat(data: bytearray, rng: np.random.Generator) -> None:
    place = int(rng.integers(len(data)))
    data[place:place] = data[place : place + int(rng.integers(1, 400))]


def blank(data: bytearray, rng: np.random.Generator) -> None:
    place = int(rng.integers(len(data)))
    size = min(int(rng.integers(1, 300)), len(data) - place)
    data[place : place + size] = bytes([rng.choice([0, 255])]) * size


MUTATIONS: tuple[Callable[[bytearray, np.random.Generator], None], ...] = (
    flip, overwrite, lie, cut, remove, repeat, blank,
)  # fmt: skip


def read_all(path: Path) -> None:
    """Everything that a replay asks of a log, each for itself: one that fails does not hide the next."""
    with DriveLog(path) as log:
        tasks: tuple[Callable[[], object], ...] = (
            lambda: [m.raw for m in log.messages()],
            lambda: [m.message for m in log.messages()],
            lambda: list(log.messages(None, T0 + 1, T0 + 2)),
            log.attachments, log.metadata, log.camera, log.trajectory, log.gps, log.road_map, log.origin,
            log.instances, lambda: list(log.images()),
        )  # fmt: skip
        for task in tasks:
            try:
                task()
            except ScpfError as error:
                assert error.message


@pytest.mark.parametrize("part", range(7))
def test_damage_raises_nothing_but_our_own(tmp_path: Path, part: int) -> None:
    sound = build(tmp_path / "sound.mcap")
    sources = (sound, repack(sound), repack(sound))
    path = tmp_path / "damaged.mcap"
    read = saved = 0
    for k in range(part, COUNT, 7):
        rng = np.random.default_rng(k)
        data = bytearray(sources[k % 3])
        for _ in range(rng.integers(1, 3)):
            if len(data) > 16:
                MUTATIONS[rng.integers(len(MUTATIONS))](data, rng)
        path.write_bytes(data)
        try:
            read_all(path)
            read += 1
        except ScpfError as error:
            assert error.message
        try:
            report = recover_into(io.BytesIO(data), path, io.BytesIO())
            saved += report.messages > 0
        except ScpfError as error:
            assert error.message
    assert read > 50
    assert saved > 200
