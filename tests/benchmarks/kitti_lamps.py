"""How many of KITTI 06's lamps a replay found, and how many detections are none.

    python tests/benchmarks/kitti_lamps.py out/street.results.mcap street.mcap

Run by hand on the results of docs/KITTI.md; the images are not ours to ship. Which mapped poles are lamps, and in
which frames each is in sight within 40 m, was judged by eye on zoomed crops. A detection is a lamp's where the bearing
of its foot agrees with that of the lamp from the ground-truth pose; all others are printed with frame and box.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

from scpf.ingest.drive_log import DriveLog
from scpf.models.geodesy import wrap_angle
from scpf.replay.pipeline import foot_px
from scpf.replay.result_messages import from_observation

IN_SIGHT = {
    "0": (0, 14),
    "2": (0, 3),
    "18": (0, 2),
    "24": (8, 31),
    "25": (8, 37),
    "45": (9, 27),
    "52": (30, 50),
    "53": (32, 50),
}
NOT_IN_THE_MAP = {"unmapped": ((35.50, -6.26), (0, 21))}
"""A lamp that the lidar map lacks, triangulated from the images."""

GATE_RAD = np.radians(1.5)
MAP_ERROR_M = 0.6
"""How far a mapped lamp may stand from its true place: at 5 m that is more than the gate."""
NEAR_M = 40.0


def main(results: Path, log_path: Path) -> None:
    with DriveLog(log_path) as log:
        camera, trajectory, road_map = log.camera(), log.trajectory(), log.road_map()
        stamps = [picture.stamp_ns for picture in log.images()]
    assert camera is not None and trajectory is not None and road_map is not None
    lamps = {mark.id: np.array(mark.position_m[:2]) for mark in road_map.landmarks}
    lamps |= {name: np.array(position) for name, (position, _) in NOT_IN_THE_MAP.items()}
    in_sight = IN_SIGHT | {name: frames for name, (_, frames) in NOT_IN_THE_MAP.items()}

    found: Counter[str] = Counter()
    beyond, strangers = 0, []
    with DriveLog(results) as log:
        for record in log.messages(["/scpf/observations"]):
            frame = stamps.index(record.sensor_ns)
            pose = trajectory.at(record.sensor_ns)
            assert pose is not None
            yaw = np.arctan2(pose[1, 0], pose[0, 0])
            seen: set[str] = set()
            for observed in record.message.observations:
                instance = from_observation(observed)[0].instance
                bearing = camera.bearings(np.array([foot_px(instance)]))[0]
                offsets = {name: position - pose[:2, 3] for name, position in lamps.items()}
                miss = {
                    n: abs(wrap_angle(np.arctan2(o[1], o[0]) - yaw - bearing)) for n, o in offsets.items()
                }
                best = min(miss, key=lambda name: float(miss[name]))
                distance = float(np.hypot(*offsets[best]))
                if miss[best] > GATE_RAD + MAP_ERROR_M / distance or best in seen:
                    strangers.append((frame, [round(v) for v in instance.box_px], round(instance.score, 2)))
                elif distance > NEAR_M or best not in in_sight:
                    beyond += 1
                else:
                    first, last = in_sight[best]
                    found[best] += first <= frame <= last
                    seen.add(best)
    total = 0
    print("lamp       in sight within 40 m   found")
    for name, (first, last) in in_sight.items():
        frames = sum(first <= k <= last for k in range(len(stamps)))
        total += frames
        print(f"{name:<10} {frames:>12} frames {found[name]:>11}")
    hits = sum(found.values())
    print(f"all        {total:>12} frames {hits:>11}   recall {hits / total:.2f}")
    kept = hits + beyond
    print(
        f"further lamps {beyond}, no lamp {len(strangers)}: precision {kept / max(1, kept + len(strangers)):.2f}"
    )
    for frame, box, score in strangers:
        print(f"  frame {frame}: box {box}, score {score}")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
