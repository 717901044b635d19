"""Synthetic steps: a drive along a bend with poles on both sides, for the tests of recording and results."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scpf.models.association import Match
from scpf.models.camera import Camera
from scpf.models.constraints import (
    Constraint,
    LandmarkConstraint,
    RoadConstraint,
    SpeedConstraint,
    log_probability,
    total_violation,
)
from scpf.models.instances import Instance, instance_from_mask
from scpf.models.observation import Distance, Observation
from scpf.models.particle_filter import Belief
from scpf.models.road_map import Landmark, RoadMap
from scpf.replay.step import Errors, Frame, Step, Surface

Array = NDArray[np.float64]

WIDTH_PX, HEIGHT_PX = 320, 240
FIRST_STAMP_NS = 1_700_000_000_000_000_000
PERIOD_NS = 76_923_077
SPEED_MPS = 10.0
RADIUS_M = 120.0


def camera(width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> Camera:
    """A camera that looks ahead, 80° wide."""
    focal = width_px / 2 / np.tan(np.radians(40.0))
    return Camera(
        width_px, height_px, np.array([[focal, 0, width_px / 2], [0, focal, height_px / 2], [0, 0, 1.0]])
    )


def pose_at(length_m: float) -> Array:
    """``T_map_body`` (4, 4) after ``length_m`` along a bend to the left of radius 120 m, from the origin eastwards."""
    angle = length_m / RADIUS_M
    c, s = np.cos(angle), np.sin(angle)
    pose = np.eye(4)
    pose[:2, :2] = [[c, -s], [s, c]]
    pose[:2, 3] = RADIUS_M * s, RADIUS_M * (1 - c)
    return pose


def road_map() -> RoadMap:
    """The bend, 4 m to either side, with a pole every 22 m on alternating sides."""
    line = np.array([pose_at(at)[:2, 3] for at in np.arange(-60.0, 180.0, 3.0)])
    marks = []
    for k, at in enumerate(np.arange(-30.0, 150.0, 22.0)):
        pose = pose_at(float(at))
        east, north, _, _ = pose @ [0.0, 6.0 if k % 2 else -6.0, 0.0, 1.0]
        marks.append(Landmark(f"P{k + 11}", (float(east), float(north), 0.0), variance_m2=0.01))
    return RoadMap(tuple(marks), line, 4.0)


def picture(width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> bytes:
    """A JPEG of sky over ground."""
    pixels = np.full((height_px, width_px, 3), (120, 160, 210), dtype=np.uint8)
    pixels[height_px // 2 :] = (90, 100, 85)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG")
    return file.getvalue()


def pole_instance(view: Camera, foot_body_m: Array, landmark_id: str) -> Instance | None:
    """A pole 9 m high and 0.3 m wide, its foot 1.5 m below the camera; None out of sight."""
    ends = np.array([[*foot_body_m, -1.5], [*foot_body_m, 7.5]])
    pixels = view.project(ends @ view.T_body_camera[:3, :3])
    if not np.isfinite(pixels).all():
        return None
    half = max(view.matrix[0, 0] * 0.15 / float(np.hypot(*foot_body_m)), 0.8)
    rows, columns = np.mgrid[: view.height_px, : view.width_px]
    mask = (np.abs(columns - pixels[0, 0]) <= half) & (rows <= pixels[0, 1]) & (rows >= pixels[1, 1])
    return instance_from_mask(mask, 0.9, landmark_id) if mask.sum() > 8 else None


def belief_of(states: Array, log_likelihood: Array, name: str = "tracking") -> Belief:
    """The belief of particles (N, 4) weighted by exp(log_likelihood) (N,)."""
    log_weights = log_likelihood - np.logaddexp.reduce(log_likelihood)
    weights = np.exp(log_weights)
    mean = weights @ states
    off = states - mean
    covariance = (weights[:, None] * off).T @ off
    evidence = float(np.logaddexp.reduce(log_likelihood) - np.log(len(states)))
    return Belief(states, log_weights, mean, covariance, float(1 / (weights**2).sum()), evidence, name)  # type: ignore[arg-type]


def surface_of(constraints: list[Constraint], mean: Array, cells: int, cell_m: float) -> Surface:
    """Constraint values about ``mean``."""
    corner = np.round(mean[:2] / cell_m - (cells - 1) / 2) * cell_m
    east, north = np.meshgrid(corner[0] + np.arange(cells) * cell_m, corner[1] + np.arange(cells) * cell_m)
    states = np.column_stack([east.ravel(), north.ravel(), np.tile(mean[2:], (cells**2, 1))])
    shape = (cells, cells)
    return Surface(
        corner,
        cell_m,
        total_violation(constraints, states).reshape(shape),
        log_probability(constraints, states).reshape(shape),
    )


def errors_of(mean: Array, pose: Array) -> Errors:
    """Errors of a mean against a pose."""
    off = mean[:2] - pose[:2, 3]
    return Errors(float(np.hypot(*off)), float(off @ pose[:2, 0]), float(off @ pose[:2, 1]))


def synthetic_steps(
    count: int = 6,
    *,
    blind: frozenset[int] = frozenset({3}),
    particles: int = 60,
    cells: int = 21,
    cell_m: float = 0.5,
    view: Camera | None = None,
    encoded: bytes | None = None,
    seed: int = 0,
) -> list[Step]:
    """``count`` steps at 13 Hz; frames in ``blind`` detect nothing. The same seed gives the same steps."""
    rng = np.random.default_rng(seed)
    view = view or camera()
    image = encoded if encoded is not None else picture(view.width_px, view.height_px)
    known = road_map()
    bias, baseline_bias = rng.normal(0, 0.2, 2), rng.normal(0, 1.0, 2)
    return [
        _step(k, rng, view, image, known, k in blind, particles, cells, cell_m, bias, baseline_bias)
        for k in range(count)
    ]


def _step(
    k: int,
    rng: np.random.Generator,
    view: Camera,
    image: bytes,
    known: RoadMap,
    blind: bool,
    particles: int,
    cells: int,
    cell_m: float,
    bias: Array,
    baseline_bias: Array,
) -> Step:
    pose = pose_at(k * SPEED_MPS / 13.0)
    truth = pose[:2, 3]
    observations, matches, distances = [], [], []
    segment = known.segment_near(truth)
    assert segment is not None
    constraints: list[Constraint] = [RoadConstraint(segment), SpeedConstraint()]
    for mark in () if blind else known.landmarks:
        foot = (np.linalg.inv(pose) @ [*mark.position_m, 1.0])[:2]
        distance_m = float(np.hypot(*foot))
        instance = pole_instance(view, foot, mark.id) if distance_m < 50.0 else None
        if instance is None:
            continue
        deviation = 0.15 + 0.02 * distance_m
        mean_m = distance_m + float(rng.normal(0, 0.6 * deviation))
        variance = deviation**2
        distance = Distance(mean_m, variance, variance / 2, "straight", distance_m < 45.0)
        observations.append(Observation(instance, distance, float(np.arctan2(foot[1], foot[0]))))
        distances.append(distance_m)
        if distance_m > 40.0:
            matches.append(Match("", "two landmarks fit"))
        else:
            matches.append(Match(mark.id))
            constraints.append(
                LandmarkConstraint(mark.id, np.array(mark.position_m[:2]), mean_m, variance + 0.01)
            )
    bias[:] = 0.9 * bias + rng.normal(0, 0.12, 2)
    baseline_bias[:] = 0.97 * baseline_bias + rng.normal(0, 0.25, 2)
    velocity = pose[:2, 0] * SPEED_MPS
    spread = [1.1, 1.1, 0.5, 0.5]
    states = np.r_[truth + bias, velocity] + rng.normal(0, spread, (particles, 4))
    far = np.r_[truth + baseline_bias, velocity] + rng.normal(0, [1.5, 1.5, 0.8, 0.8], (particles, 4))
    belief = belief_of(states, log_probability(constraints, states), "unconstrained" if blind else "tracking")
    baseline = belief_of(
        far, -0.5 * ((far[:, :2] - truth - baseline_bias) ** 2).sum(1) / 9.0, "unconstrained"
    )
    frame = Frame(
        index=k,
        stamp_ns=FIRST_STAMP_NS + k * PERIOD_NS,
        encoded=image,
        image_format="jpeg",
        image=None,
        dt_s=PERIOD_NS * 1e-9,
        T_map_body=pose,
        gps_m=truth + rng.normal(0, 3.0, 2),
        gps_variance_m2=9.0,
    )
    notes = (("INFO", "start"),) if k == 0 else (("WARNING", "no landmark in sight"),) if blind else ()
    return Step(
        frame=frame,
        observations=tuple(observations),
        matches=tuple(matches),
        true_distances_m=tuple(distances),
        belief=belief,
        baseline=baseline,
        surface=surface_of(constraints, belief.mean, cells, cell_m),
        errors=errors_of(belief.mean, pose),
        baseline_errors=errors_of(baseline.mean, pose),
        timing_s={"segmentation": 0.02 + 0.001 * k, "distance": 0.002, "filter": 0.003, "surface": 0.004},
        notes=notes,
        true_landmark_ids=tuple(observation.instance.landmark_id for observation in observations),
    )
