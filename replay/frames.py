"""Frames of a drive log: images in order, each with the reference pose and rough GPS of its exposure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.drive_log import DriveLog
from scpf.ingest.log_messages import EncodedImage
from scpf.ingest.topics import IMAGE_TOPIC
from scpf.models.errors import InputError, MissingError
from scpf.models.instances import Image
from scpf.models.trajectory import Trajectory
from scpf.replay.settings import GpsSettings
from scpf.replay.step import Frame

Array = NDArray[np.float64]

LONG_GAP_S: Final = 1.0
UNREADABLE: Final = "image that cannot be decoded"
BACKWARDS: Final = "time goes back"
GAP: Final = "gap before the frame"


@dataclass(frozen=True)
class Window:
    """The part of a log to replay, in seconds after its first image; ``stop_s`` is exclusive.

    ``rate_hz`` thins the frames: the first at or after each tick of that rate is kept. A rate that the camera does not
    reach keeps them all.
    """

    start_s: float = 0.0
    stop_s: float = float("inf")
    rate_hz: float = float("inf")


class Thinning:
    """Which frames are kept at ``rate_hz``, told one after the other by their times.

    The ticks are counted from the first frame, so that a camera's jitter does not add up; after a gap they go on from
    where the log is.
    """

    def __init__(self, rate_hz: float) -> None:
        self._interval_s = 1.0 / rate_hz
        self._tick = -1

    def keeps(self, seconds: float) -> bool:
        """Whether the frame at ``seconds`` after the first is to be kept: it is the first of its tick."""
        if self._interval_s == 0.0:
            return True
        # A tenth of an interval early still counts as this tick: triggers jitter to both sides.
        tick = int(np.floor(seconds / self._interval_s + 0.1))
        kept = tick != self._tick
        self._tick = tick
        return kept


def decode(encoded: bytes | memoryview, place: str) -> Image:
    """The RGB image (H, W, 3) of JPEG or PNG bytes; InputError naming ``place`` where they are damaged."""
    import cv2

    image = (
        cv2.imdecode(np.frombuffer(encoded, dtype=np.uint8), cv2.IMREAD_COLOR_RGB) if len(encoded) else None
    )
    if image is None:
        raise InputError(f"{place}: the image cannot be decoded")
    return np.asarray(image, dtype=np.uint8)


class GpsEmulator:
    """Rough GPS out of a reference: position plus white noise. Each frame's draw depends on its index and the seed
    alone, so that a replay of a part of the log sees the same fixes."""

    def __init__(self, sigma_m: float, seed: int) -> None:
        self._sigma_m, self._seed = sigma_m, seed

    def fix(self, index: int, T_map_body: Array) -> Array:
        """Position (2,) in map."""
        rng = np.random.default_rng([self._seed, 1, index])
        position: Array = T_map_body[:2, 3] + self._sigma_m * rng.standard_normal(2)
        return position


def expected_frames(log: DriveLog, window: Window) -> int:
    """How many frames a replay will have: exact for a whole log, from its duration for a stretch or a lower rate."""
    images = log.count(IMAGE_TOPIC)
    span_s = (log.end_ns - log.start_ns) * 1e-9
    if span_s <= 0.0 or window == Window():
        return images
    within_s = max(0.0, min(window.stop_s, span_s) - max(window.start_s, 0.0))
    return round(min(images * within_s / span_s, window.rate_hz * within_s))


def pictures(log: DriveLog, window: Window) -> Iterator[tuple[int, float, EncodedImage]]:
    """The log's images within the window: index in the log, seconds after its first image, and the image."""
    first_ns: int | None = None
    thinning = Thinning(window.rate_hz)
    for index, picture in enumerate(log.images()):
        first_ns = picture.stamp_ns if first_ns is None else first_ns
        seconds = (picture.stamp_ns - first_ns) * 1e-9
        if 0.0 < window.start_s > seconds:  # a clock that goes back is no reason to leave a frame out
            continue
        if seconds >= window.stop_s:
            break
        if thinning.keeps(seconds):
            yield index, seconds, picture


def read_frames(
    log: DriveLog,
    trajectory: Trajectory | None,
    gps: GpsSettings,
    seed: int,
    window: Window,
    *,
    recorded: bool,
    pixels: bool,
) -> Iterator[Frame]:
    """The log's frames in order, posed by its ``trajectory``.

    ``recorded`` reads the log's own masks, ``pixels`` decodes the images.

    What is wrong with a frame stands in its ``problems``, and the replay goes on: an image that cannot be decoded has
    no landmarks, and no time passes where the clock goes back. Raises MissingError where the GPS asked for is not
    there.
    """
    fixes = None if gps.source in ("none", "emulated") else log.gps()
    if gps.source == "log" and fixes is None:
        raise MissingError(f"{log.path}: no rough GPS in the log", "use --gps emulated")
    if gps.source == "emulated" and trajectory is None:
        raise MissingError(f"{log.path}: no reference to emulate GPS from", "use --gps none")
    emulator = None
    if gps.source in ("auto", "emulated") and fixes is None and trajectory is not None:
        emulator = GpsEmulator(gps.sigma_m, seed)
    masks = log.instances() if recorded else {}

    last_ns: int | None = None
    for index, seconds, picture in pictures(log, window):
        pose = None if trajectory is None else trajectory.at(picture.stamp_ns)
        interval_s = 0.0 if last_ns is None else (picture.stamp_ns - last_ns) * 1e-9
        problems: list[tuple[str, str]] = []
        if interval_s < 0.0:
            problems.append((BACKWARDS, f"by {-interval_s:.3f} s"))
        elif interval_s > LONG_GAP_S:
            problems.append((GAP, f"{interval_s:.3f} s"))
        image = None
        if pixels:
            try:
                image = decode(picture.data, f"{log.path}: frame {index}")
            except InputError as error:
                problems.append((UNREADABLE, error.message))
        fix, variance = None, gps.sigma_m**2
        if fixes is not None:
            fix, found = _nearest_fix(fixes, picture.stamp_ns, interval_s)
            variance = found if np.isfinite(found) and found > 0.0 else variance
        elif emulator is not None and pose is not None:
            fix = emulator.fix(index, pose)
        if any(begin <= seconds < end for begin, end in gps.outages_s):
            fix = None
        yield Frame(
            index=index,
            stamp_ns=picture.stamp_ns,
            encoded=picture.data,
            image_format=picture.format,
            image=image,
            dt_s=max(interval_s, 0.0),
            T_map_body=pose,
            gps_m=fix,
            gps_variance_m2=variance,
            recorded=tuple(masks.get(picture.stamp_ns, ())),
            problems=tuple(problems),
        )
        last_ns = picture.stamp_ns if last_ns is None else max(last_ns, picture.stamp_ns)


def _nearest_fix(
    fixes: tuple[NDArray[np.int64], Array, Array], stamp_ns: int, interval_s: float
) -> tuple[Array | None, float]:
    """The fix nearest in time, where it is within half a frame's interval (so that each is used once)."""
    stamps, positions, variances = fixes
    nearest = int(np.argmin(np.abs(stamps - stamp_ns)))
    reach_ns = max(interval_s, 0.05) / 2 * 1e9
    if abs(int(stamps[nearest]) - stamp_ns) > reach_ns:
        return None, float(variances[nearest])
    return positions[nearest], float(variances[nearest])


def first_state(frame: Frame, trajectory: Trajectory | None) -> Array | None:
    """[x, y, vx, vy] to start from: the reference's at the frame, else the GPS fix, at rest; None without either.

    Only the start uses the reference, and the filter spreads its particles around it by P0.
    """
    if trajectory is not None and frame.T_map_body is not None:
        half_ns = 200_000_000
        before, after = (trajectory.at(frame.stamp_ns + step) for step in (-half_ns, half_ns))
        before = frame.T_map_body if before is None else before
        after = frame.T_map_body if after is None else after
        spans = (after is not frame.T_map_body) + (before is not frame.T_map_body)
        velocity = (after - before)[:2, 3] / (0.2 * spans) if spans else np.zeros(2)
        return np.concatenate([frame.T_map_body[:2, 3], velocity])
    if frame.gps_m is not None:
        return np.concatenate([frame.gps_m, np.zeros(2)])
    return None
