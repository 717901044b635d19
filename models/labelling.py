"""Labels: which mapped landmark an instance shows, where the reference pose is known.

Training samples and the true distances of a replay come from here. Every landmark's vertical axis is
projected into the image; an instance is compared with it at the row where the instance ends below: the
bearing must agree within a gate, its base must not lie at a grossly other distance, and its height in
metres must be a pole's. The pairs are made one to one. A label in doubt is worse than none: it is dropped,
with the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.instances import Instance
from scpf.models.road_map import Landmark, RoadMap

Array = NDArray[np.float64]

NO_LANDMARK: Final = "no landmark at its bearing"
TOO_FAR: Final = "beyond the greatest distance"
BAD_BASE: Final = "its base is at another distance than the landmark at its bearing"
BAD_HEIGHT: Final = "not as high as a pole at the distance of the landmark at its bearing"
AMBIGUOUS: Final = "two landmarks, or two instances, fit alike"
TAKEN: Final = "another instance fits its landmark better"
NOT_MAPPED: Final = "its landmark is not on the map"

MAX_DISTANCE_M: Final = 60.0


@dataclass(frozen=True)
class LabelSettings:
    """When an instance counts as a landmark's.

    ``gate_rad``: greatest difference in bearing. ``base_below_rad``, ``base_above_rad``: by how much the
    instance's base may lie below and above the landmark's foot; above is wider, since cars and hedges hide
    feet. ``heights_m``: heights that a pole may have. ``sigma_bearing_rad``, ``sigma_base_rad`` weigh the
    two differences; a rival within ``margin`` of the best (in squared σ) makes a label doubtful.
    ``map_deviation_m``: the least deviation of a mapped position; at close range two such deviations, as an
    angle, widen the gates. ``body_height_m``: the body origin's height above the road, used where the map
    has no heights.
    """

    gate_rad: float = radians(1.5)
    base_below_rad: float = radians(2.0)
    base_above_rad: float = radians(4.0)
    heights_m: tuple[float, float] = (1.0, 16.0)
    sigma_bearing_rad: float = radians(0.4)
    sigma_base_rad: float = radians(1.0)
    margin: float = 4.0
    map_deviation_m: float = 0.2
    body_height_m: float = 0.0


@dataclass(frozen=True)
class Label:
    """``landmark_id`` of an instance with its horizontal distance (m) from the body origin in ``map``.

    Where it is not known, ``landmark_id`` is "", ``distance_m`` None and ``reason`` says why.
    """

    landmark_id: str
    distance_m: float | None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class _Axis:
    """A landmark's projected axis: pixels (Z, 2) from the foot upwards, those in front of the camera alone.

    ``spread_rad``: the deviation of its mapped position, as seen from the camera; ``slope``: of the line of
    sight to its foot, by which such a deviation moves the foot up and down.
    """

    pixels: Array
    depth_m: float
    spread_rad: float
    slope: float


def label(
    instances: Sequence[Instance],
    camera: Camera,
    T_map_body: Array,
    road_map: RoadMap,
    max_distance_m: float = MAX_DISTANCE_M,
    settings: LabelSettings | None = None,
) -> list[Label]:
    """A label for each instance of an image that ``camera`` took when the body was at ``T_map_body`` (4, 4).

    An instance that carries its ``landmark_id`` (a simulated drive's truth) keeps it.
    """
    if not instances:
        return []
    settings = settings or LabelSettings()
    reach = np.hypot(*(road_map.positions_m - T_map_body[:2, 3]).T)
    index = {mark.id: k for k, mark in enumerate(road_map.landmarks)}
    labels: list[Label | None] = [
        _told(instance.landmark_id, index, reach, max_distance_m) if instance.landmark_id else None
        for instance in instances
    ]
    told = {each.landmark_id for each in labels if each is not None}
    open_ = [k for k, each in enumerate(labels) if each is None]
    near = [k for k in np.flatnonzero(reach <= max_distance_m) if road_map.landmarks[k].id not in told]
    marks = [road_map.landmarks[k] for k in near]
    axes = _axes(marks, camera, T_map_body, settings)
    open_instances = [instances[k] for k in open_]
    costs, reasons = _costs(open_instances, axes, camera, settings)
    for n, instance in enumerate(open_instances):
        costs[n, [mark.landmark_class != instance.landmark_class for mark in marks]] = np.inf
    for row, choice in enumerate(_assign(costs, settings.margin)):
        if isinstance(choice, str):
            labels[open_[row]] = Label("", None, choice or reasons[row])
        else:
            labels[open_[row]] = Label(marks[choice].id, float(reach[near[choice]]))
    return [each for each in labels if each is not None]


def _told(landmark_id: str, index: dict[str, int], reach_m: Array, max_distance_m: float) -> Label:
    if landmark_id not in index:
        return Label("", None, NOT_MAPPED)
    distance = float(reach_m[index[landmark_id]])
    return Label(landmark_id, distance) if distance <= max_distance_m else Label("", None, TOO_FAR)


def _axes(
    marks: Sequence[Landmark], camera: Camera, T_map_body: Array, settings: LabelSettings
) -> list[_Axis | None]:
    """The projected axis of each landmark; None for one that is not within the camera's field of view."""
    heights = np.linspace(0.0, 10.0, 21)
    # A map drawn from above has no heights (all zero): its feet are put on the road that the body stands on.
    flat = all(mark.position_m[2] == 0.0 for mark in marks)
    road_m = float(T_map_body[2, 3]) - settings.body_height_m
    T_camera_map = np.linalg.inv(T_map_body @ camera.T_body_camera)
    edges = np.array([[-0.5, camera.height_px / 2], [camera.width_px - 0.5, camera.height_px / 2]])
    left, right = camera.bearings(edges)
    axes: list[_Axis | None] = []
    for mark in marks:
        east, north, up = mark.position_m
        foot_m = road_m if flat else up
        points = np.column_stack([np.full(21, east), np.full(21, north), foot_m + heights, np.ones(21)])
        in_camera = (points @ T_camera_map.T)[:, :3]
        in_body = in_camera @ camera.T_body_camera[:3, :3].T
        bearing = float(np.arctan2(in_body[0, 1], in_body[0, 0]))
        # Beyond the field of view the lens polynomial means nothing and may fold back into the image.
        if not right - radians(3.0) <= bearing <= left + radians(3.0):
            axes.append(None)
            continue
        pixels = camera.project(in_camera)
        shown: NDArray[np.bool_] = np.all(np.isfinite(pixels), axis=1)
        if not shown[0] or shown.sum() < 2:
            axes.append(None)
            continue
        reach = max(float(np.hypot(*in_body[0, :2])), 1.0)
        spread = max(float(np.sqrt(mark.variance_m2)), settings.map_deviation_m) / reach
        axes.append(_Axis(pixels[shown], float(in_camera[0, 2]), spread, abs(float(in_body[0, 2])) / reach))
    return axes


def _costs(
    instances: Sequence[Instance], axes: Sequence[_Axis | None], camera: Camera, settings: LabelSettings
) -> tuple[Array, list[str]]:
    """Costs (N, L) in squared σ, inf where a landmark cannot be the instance's; and why none can (N)."""
    costs = np.full((len(instances), len(axes)), np.inf)
    reasons = []
    focal_px = float(camera.matrix[1, 1])
    for n, instance in enumerate(instances):
        reason = NO_LANDMARK
        column, row = base_px(instance)
        at_edge = instance.box_px[3] >= camera.height_px - 1.0
        at_top = instance.box_px[1] <= 1.0
        for k, axis in enumerate(axes):
            if axis is None:
                continue
            # Rows grow downwards: reversed, the axis runs from its top to its foot.
            expected = float(np.interp(row, axis.pixels[::-1, 1], axis.pixels[::-1, 0]))
            seen, mapped = camera.bearings(np.array([[column, row], [expected, row]]))
            off = float(seen - mapped)
            below = (row - axis.pixels[0, 1]) / focal_px
            height_m = instance.height_px / focal_px * axis.depth_m
            low, high = settings.heights_m
            if abs(off) > settings.gate_rad + 2.0 * axis.spread_rad:
                continue
            slack = 2.0 * axis.spread_rad * axis.slope
            if below > settings.base_below_rad + slack or (
                below < -settings.base_above_rad - slack and not at_edge
            ):
                reason = BAD_BASE
            elif height_m > high or (height_m < low and not (at_top or at_edge)):
                reason = BAD_HEIGHT
            else:
                costs[n, k] = off**2 / (settings.sigma_bearing_rad**2 + axis.spread_rad**2)
                if not at_edge:
                    moved = axis.spread_rad * axis.slope
                    costs[n, k] += below**2 / (settings.sigma_base_rad**2 + moved**2)
        reasons.append(reason)
    return costs, reasons


def base_px(instance: Instance) -> tuple[float, float]:
    """Column and row (px) of an instance's foot: the middle of its mask in its lowest fifth, and its last
    row.
    """
    used = np.flatnonzero(instance.mask.any(axis=1))
    if not len(used):
        return 0.5 * (instance.box_px[0] + instance.box_px[2]) - 0.5, instance.box_px[3] - 1.0
    start = used[-1] - (used[-1] - used[0]) // 5
    rows = instance.mask[start : used[-1] + 1]
    columns = np.nonzero(rows)[1]
    return float(np.median(columns)) + instance.offset_px[0], float(used[-1] + instance.offset_px[1])


def _assign(costs: Array, margin: float) -> list[int | str]:
    """For each instance its landmark's column, or why there is none ("" where no cost is finite)."""
    from scipy.optimize import linear_sum_assignment

    bounded = np.where(np.isfinite(costs), costs, 1e6)
    choice: list[int | str] = ["" for _ in costs]
    rows, columns = linear_sum_assignment(bounded)
    taken = {int(r): int(c) for r, c in zip(rows, columns, strict=True) if np.isfinite(costs[r, c])}
    owner = {c: r for r, c in taken.items()}
    doubtful: set[int] = set()
    for r in range(len(costs)):
        own = float(costs[r, taken[r]]) if r in taken else np.inf
        for c in np.flatnonzero(np.isfinite(costs[r])):
            other = owner.get(int(c))
            if other == r:
                continue
            if r not in taken:
                # Left over beside an instance that fits the landmark better: it may be open which.
                choice[r] = TAKEN
                if other is not None and costs[r, c] < costs[other, c] + margin:
                    doubtful |= {r, other}
            elif other is None:
                if costs[r, c] < own + margin:
                    doubtful.add(r)
            elif costs[r, c] + costs[other, taken[r]] < own + costs[other, c] + margin:
                doubtful |= {r, other}  # the two could as well be exchanged
    for row, column in taken.items():
        choice[row] = column
    for row in doubtful:
        choice[row] = AMBIGUOUS
    return choice
