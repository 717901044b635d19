"""Findings about what a replay needs of a log: camera, images, map, reference, rough GPS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.doctor_facts import TopicFacts
from scpf.ingest.drive_log import GPS_FIX_TOPIC, GPS_POSE_TOPIC, IMAGE_TOPIC, INS_POSE_TOPIC, DriveLog
from scpf.ingest.findings import Finding, counted
from scpf.models.trajectory import Trajectory

Array = NDArray[np.float64]
Facts = dict[str, TopicFacts]

NEAR_MAP_M: Final = 150.0
JUMP_M: Final = 1.0
JUMP_RAD: Final = 0.35
"""A pose may be off what the speed lets expect by a metre and 20°: what is more is a jump of the reference."""


def check_images(log: DriveLog, facts: Facts) -> Iterator[Finding]:
    """Images that are none, of another size than the calibration, or not there."""
    fact = facts.get(IMAGE_TOPIC)
    if fact is None or not fact.log_ns:
        yield Finding("error", IMAGE_TOPIC, "the log holds no images", "see `scpf ingest` and `scpf convert`")
        return
    if fact.unreadable:
        stamp_ns, reason = fact.unreadable[0]
        text = (
            f"{counted(len(fact.unreadable), 'image')} cannot be read, the first at {stamp_ns} ns ({reason})"
        )
        yield Finding(
            "error", IMAGE_TOPIC, text, "replay around them with --start and --stop, or ingest again"
        )
    sizes = ", ".join(f"{width}×{height} px ({count})" for (width, height), count in fact.sizes_px.items())
    if len(fact.sizes_px) > 1:
        yield Finding("error", IMAGE_TOPIC, f"images of several sizes: {sizes}", "one log holds one camera")
    camera = log.camera()
    if camera is not None and fact.sizes_px and (camera.width_px, camera.height_px) not in fact.sizes_px:
        text = f"the images have {sizes}, the calibration is for {camera.width_px}×{camera.height_px} px"
        yield Finding("error", IMAGE_TOPIC, text, "calibrate at the size of the images")


def check_camera(log: DriveLog, facts: Facts) -> Iterator[Finding]:
    """Whether there is a calibration."""
    if log.camera() is None:
        text = "the log holds no calibration of the camera"
        yield Finding("error", "calibration", text, "ingest it with --calibration; see `scpf calibrate`")


def check_map(log: DriveLog, facts: Facts) -> Iterator[Finding]:
    """Whether there is a map, and whether it is where the drive was."""
    road_map = log.road_map()
    if road_map is None:
        text = "the log holds no map: nothing to measure the distances to"
        yield Finding("error", "map.geojson", text, "make one with `scpf map from`, then ingest with --map")
        return
    if not road_map.landmarks:
        yield Finding("error", "map.geojson", "the map holds no landmark", "see `scpf map from`")
        return
    trajectory = log.trajectory()
    if trajectory is None or not len(trajectory):
        return
    path = trajectory.positions_m[:: max(1, len(trajectory) // 500), :2]
    apart = path[:, None, :] - road_map.positions_m[None, :5000, :]
    nearest_m = float(np.sqrt((apart**2).sum(axis=-1)).min())
    if nearest_m > NEAR_MAP_M:
        text = f"the drive never comes nearer than {nearest_m:.0f} m to a landmark"
        yield Finding("error", "map.geojson", text, "do map and reference have the same origin and frame?")


def check_reference(log: DriveLog, facts: Facts) -> Iterator[Finding]:
    """Whether there is a reference, at the times of the images, that moves as a vehicle does."""
    trajectory = log.trajectory()
    if trajectory is None:
        text = "the log holds no reference trajectory: errors cannot be given, and no GPS emulated"
        yield Finding("warning", INS_POSE_TOPIC, text, "ingest it with --trajectory")
        return
    images = facts[IMAGE_TOPIC].sensor_ns if IMAGE_TOPIC in facts else []
    without = [stamp for stamp in images if trajectory.at(stamp) is None]
    if without:
        begin_ns = int(trajectory.stamps_ns[0])
        low, high, end = (
            (s - begin_ns) * 1e-9 for s in (min(images), max(images), int(trajectory.stamps_ns[-1]))
        )
        text = f"{len(without)} of {counted(len(images), 'image')} lie outside the reference, or in a gap of it: "
        text += (
            f"from its beginning, the images run from {low:.3f} to {high:.3f} s, the reference to {end:.3f} s"
        )
        if len(without) == len(images):
            yield Finding("error", INS_POSE_TOPIC, text, "are both clocks UTC?")
        else:
            yield Finding("warning", INS_POSE_TOPIC, text, "their errors are not given")
    yield from _jumps(trajectory)


def _jumps(trajectory: Trajectory) -> Iterator[Finding]:
    if len(trajectory) < 4:
        return
    from scipy.ndimage import median_filter
    from scipy.spatial.transform import Rotation

    dt_s = np.diff(trajectory.stamps_ns) * 1e-9
    step_m = np.linalg.norm(np.diff(trajectory.positions_m, axis=0), axis=1)
    # The median of its neighbours says how fast the vehicle is, whatever one pose says.
    expected_m = median_filter(step_m / dt_s, size=5, mode="nearest") * dt_s
    rotations = Rotation.from_quat(trajectory.quaternions_xyzw)
    turn_rad = (rotations[:-1].inv() * rotations[1:]).magnitude()
    expected_rad = median_filter(turn_rad / dt_s, size=5, mode="nearest") * dt_s
    far = step_m > 2.0 * expected_m + JUMP_M
    turned = turn_rad > 2.0 * expected_rad + JUMP_RAD
    places = np.flatnonzero(far | turned)
    if len(places):
        worst = int(places[np.argmax((step_m - expected_m)[places])])
        text = f"the reference jumps at {counted(len(places), 'place')}; by {step_m[worst]:.2f} m, where "
        text += f"{expected_m[worst]:.2f} m are to be expected, after {int(trajectory.stamps_ns[worst])} ns"
        remedy = "errors there are not the filter's; use the post-processed solution, or leave the part out"
        yield Finding("warning", INS_POSE_TOPIC, text, remedy)


def check_gps(log: DriveLog, facts: Facts) -> Iterator[Finding]:
    """Whether there is a rough GPS that can be used."""
    if log.gps() is None:
        text = "the log holds no rough GPS: a replay emulates it from the reference"
        yield Finding("note", f"{GPS_FIX_TOPIC}, {GPS_POSE_TOPIC}", text, "or replay with --gps none")


CHECKS: Final = (check_images, check_camera, check_map, check_reference, check_gps)
