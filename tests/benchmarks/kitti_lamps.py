"""How many of KITTI 06's lamps a segmenter finds, and how many of its detections are none.

    python tests/benchmarks/kitti_lamps.py street.mcap --segmenter polenet

Run by hand on the log of docs/KITTI.md; the images are not ours to ship. Which mapped poles are lamps, and in which
frames each is in sight within 40 m, was judged by eye on zoomed crops. A detection is a lamp's where the bearing of its
foot agrees with that of the lamp from the ground-truth pose. Of several lamps in one direction it is the one whose
foot, on a level road, would be seen at that row: by bearing alone a lamp 19 m away passed for one behind it, 103 m
away. What has its foot much lower than that stands nearer, and is no lamp. All such are listed with frame and box.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from scpf.ingest.drive_log import DriveLog
from scpf.models.camera import Array, Camera
from scpf.models.geodesy import wrap_angle
from scpf.models.instances import Instance, foot_px
from scpf.models.segmentation import load
from scpf.models.trajectory import yaw_of
from scpf.replay.frames import decode

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
NEVER = (0, -1)
NOT_IN_THE_MAP = {
    "right": ((35.50, -6.26), (0, 21)),
    "next": ((131.3, 3.6), NEVER),
    "after": ((159.2, 3.9), NEVER),
}
"""Lamps that the lidar map lacks, triangulated from the images; two of them stand more than 70 m away."""

GATE_RAD, GATE_BELOW_PX = np.radians(1.5), 40.0
"""How far a foot may be seen beside its lamp's place and below it; above it, a car may hide the lower part."""
MAP_ERROR_M = 0.6
"""How far a mapped lamp may stand from its true place: at 5 m that is more than the gate."""
BEARING_SD_RAD, POSITION_SD_M, ROW_SD_PX = np.radians(0.3), 0.2, 20.0
"""What is usual within the gate. Rows differ by verges, by pitch, and by the cars that hide a foot."""
NEAR_M = 40.0
SCORES = (0.9, 0.7, 0.5, 0.3)
PRECISIONS = (0.98, 0.95, 0.9)
LEAST_SCORE = 0.02
LISTED_FROM = 0.5


def lamps_of(feet_px: Array, camera: Camera, pose: Array, lamps_m: Mapping[str, Array]) -> list[str | None]:
    """The lamp that each detection is of, by its foot (N, 2); None for no lamp, or for one found already.

    ``pose``: (4, 4), body frame to map frame. The pairs that agree best are taken first.
    """
    yaw = yaw_of(pose)
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    names = list(lamps_m)
    ahead_m = np.array([turn @ (lamps_m[name] - pose[:2, 3]) for name in names])
    R_body_camera, origin_m = camera.T_body_camera[:3, :3], camera.T_body_camera[:3, 3]
    ground_m = np.column_stack([ahead_m, np.zeros(len(names))])
    rows = np.minimum(camera.project((ground_m - origin_m) @ R_body_camera)[:, 1], camera.height_px - 1)
    distances_m = np.hypot(*ahead_m.T)
    misses = wrap_angle(camera.bearings(feet_px)[:, None] - np.arctan2(ahead_m[:, 1], ahead_m[:, 0]))
    usual = BEARING_SD_RAD + POSITION_SD_M / distances_m
    below_px = feet_px[:, 1:] - rows
    costs = (misses / usual) ** 2 + (below_px / ROW_SD_PX) ** 2
    found: dict[int, int] = {}
    beside = np.abs(misses) <= GATE_RAD + MAP_ERROR_M / distances_m
    pairs = np.argwhere(beside & (below_px <= GATE_BELOW_PX))
    for i, k in sorted(pairs.tolist(), key=lambda pair: float(costs[pair[0], pair[1]])):
        if i not in found and k not in found.values():
            found[i] = k
    return [names[found[i]] if i in found else None for i in range(len(feet_px))]


@dataclass(frozen=True)
class Frame:
    """All candidates of a picture, where the camera stood, and its number in the log."""

    number: int
    pose: Array
    candidates: Sequence[Instance]


@dataclass
class Verdict:
    """``found``: sightings within 40 m by lamp; ``further``: others of lamps; ``none``: frame and detection."""

    found: Counter[str] = field(default_factory=Counter)
    further: int = 0
    none: list[tuple[int, Instance]] = field(default_factory=list)

    @property
    def precision(self) -> float:
        """Share of the detections that are lamps."""
        lamps = self.found.total() + self.further
        return lamps / max(1, lamps + len(self.none))


@dataclass(frozen=True)
class Street:
    """The camera, all lamps that are known (x, y in the map frame), and the frames in which each must be found."""

    camera: Camera
    lamps_m: Mapping[str, Array]
    in_sight: Mapping[str, tuple[int, int]]

    def judge(self, frames: Sequence[Frame], least_score: float) -> Verdict:
        """What the candidates with at least this score are."""
        verdict = Verdict()
        for frame in frames:
            shown = [each for each in frame.candidates if each.score >= least_score]
            feet = np.array([foot_px(each) for each in shown]).reshape(-1, 2)
            for each, name in zip(shown, lamps_of(feet, self.camera, frame.pose, self.lamps_m), strict=True):
                if name is None:
                    verdict.none.append((frame.number, each))
                elif self._wanted(name, frame):
                    verdict.found[name] += 1
                else:
                    verdict.further += 1
        return verdict

    def _wanted(self, name: str, frame: Frame) -> bool:
        first, last = self.in_sight.get(name, NEVER)
        near = np.hypot(*(self.lamps_m[name] - frame.pose[:2, 3])) <= NEAR_M
        return bool(near and first <= frame.number <= last)


def read(log_path: Path, segmenter: str) -> tuple[Street, list[Frame]]:
    """The street of docs/KITTI.md, and what the segmenter finds in each frame."""
    segment = load(segmenter, threshold=LEAST_SCORE)
    frames = []
    with DriveLog(log_path) as log:
        camera, trajectory, road_map = log.camera(), log.trajectory(), log.road_map()
        assert camera is not None and trajectory is not None and road_map is not None
        for number, picture in enumerate(log.images()):
            pose = trajectory.at(picture.stamp_ns)
            assert pose is not None
            frames.append(Frame(number, pose, segment(decode(picture.data, f"frame {number}"))))
    lamps = {mark.id: np.array(mark.position_m[:2]) for mark in road_map.landmarks}
    lamps |= {name: np.array(position) for name, (position, _) in NOT_IN_THE_MAP.items()}
    in_sight = IN_SIGHT | {name: seen for name, (_, seen) in NOT_IN_THE_MAP.items()}
    return Street(camera, lamps, in_sight), frames


def main(log_path: Path, segmenter: str) -> None:
    street, frames = read(log_path, segmenter)
    listed, any_score = street.judge(frames, LISTED_FROM), street.judge(frames, LEAST_SCORE)
    total = 0
    print(f"lamp    in sight within 40 m  found at {LISTED_FROM}  any candidate")
    for name, (first, last) in street.in_sight.items():
        if wanted := sum(first <= frame.number <= last for frame in frames):
            total += wanted
            print(f"{name:<7} {wanted:>13} frames {listed.found[name]:>13} {any_score.found[name]:>14}")
    print(f"{'all':<7} {total:>13} frames {listed.found.total():>13} {any_score.found.total():>14}")

    print("\nscore  found  recall  further lamps  no lamp  precision")
    for score in SCORES:
        verdict = street.judge(frames, score)
        hits = verdict.found.total()
        print(f"{score:5.2f} {hits:>6} {hits / total:>7.3f} {verdict.further:>14} {len(verdict.none):>8}"
              f" {verdict.precision:>10.3f}")  # fmt: skip

    verdicts = [
        street.judge(frames, score) for score in sorted({c.score for f in frames for c in f.candidates})
    ]
    for precision in PRECISIONS:
        best = max((v.found.total() for v in verdicts if v.precision >= precision), default=0)
        print(f"recall at a precision of {precision}: {best / total:.3f}")
    print(f"\nno lamp, from a score of {LISTED_FROM}:")
    for number, each in listed.none:
        print(f"  frame {number}: box {[round(v) for v in each.box_px]}, score {each.score:.2f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("log", type=Path)
    parser.add_argument("--segmenter", default="polenet")
    given = parser.parse_args()
    main(given.log, given.segmenter)
