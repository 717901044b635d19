"""The map's part of a recording: where the vehicle is and was, by the reference, the GPS and the filters."""

from __future__ import annotations

from typing import Final

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from scpf.models.camera import Camera
from scpf.models.particle_filter import Belief
from scpf.replay import shapes
from scpf.replay.recording_rows import RowBatches
from scpf.replay.step import Frame, Step

Array = NDArray[np.float64]

ABOVE_PARTICLES_M: Final = 0.3
SLOWEST_MPS: Final = 0.3

PARTICLE_LIGHT: Final = np.array([140, 40, 50])
PARTICLE_HEAVY: Final = np.array([255, 85, 75])


class PoseRows:
    """Writes poses with their trails, the filters' 2σ ellipses, the particles by weight, and the camera's view."""

    def __init__(self, rows: RowBatches, camera: Camera | None) -> None:
        self._rows = rows
        self._camera = camera
        self._before: dict[str, Array] = {}

    def log(self, step: Step) -> None:
        """All that one step says of places."""
        self._log_reference(step.frame, step.belief)
        if step.belief is not None:
            self._log_belief("world/estimate", step.belief)
            self._log_particles(step.belief)
        if step.baseline is not None:
            self._log_belief("world/baseline", step.baseline)

    def _log_reference(self, frame: Frame, belief: Belief | None) -> None:
        pose = frame.T_map_body
        ahead: Array | None
        if frame.gps_m is not None:
            self._rows.add("world/gps", rr.Points3D.columns, positions=shapes.on_ground(frame.gps_m[None]))
        if pose is not None:
            here, ahead = pose[:2, 3], pose[:2, 0]
            self._arrow("world/truth", here, ahead)
        elif belief is not None:
            here, ahead = belief.mean[:2], _direction(belief)
        else:
            return
        self._rows.add("world/ego", rr.Transform3D.columns, translation=[(*here, 0.0)])
        if self._camera is not None and ahead is not None:
            wedge = shapes.view_wedge(self._camera, here, ahead)
            self._rows.add("world/view", rr.LineStrips3D.columns, strips=[wedge])

    def _log_belief(self, entity: str, belief: Belief) -> None:
        self._arrow(entity, belief.mean[:2], _direction(belief))
        ellipse = shapes.ellipse(belief.mean, belief.covariance)
        self._rows.add(f"{entity}/sigma2", rr.LineStrips3D.columns, strips=[ellipse])

    def _log_particles(self, belief: Belief) -> None:
        weights = belief.weights.astype(np.float32)
        share = (weights / max(float(weights.max()), 1e-30))[:, None]
        colours = (PARTICLE_LIGHT + share * (PARTICLE_HEAVY - PARTICLE_LIGHT)).astype(np.uint8)
        positions = shapes.on_ground(belief.states[:, :2])
        self._rows.add("world/particles", rr.Points3D.columns, positions=positions, colors=colours)
        self._rows.add("world/particles", rr.AnyValues.columns, weight=weights.astype(np.float16))

    def _arrow(self, entity: str, position: Array, heading: Array | None, length_m: float = 5.0) -> None:
        """A pose as an arrow, and one piece of its trail."""
        vector = np.zeros(2) if heading is None else heading * length_m
        self._rows.add(
            f"{entity}/pose",
            rr.Arrows3D.columns,
            origins=shapes.on_ground(position[None], ABOVE_PARTICLES_M),
            vectors=shapes.on_ground(vector[None]),
        )
        before = self._before.get(entity, position)
        self._before[entity] = position
        piece = shapes.on_ground(np.array([before, position]))
        self._rows.add(f"{entity}/trail", rr.LineStrips3D.columns, strips=[piece])


def _direction(belief: Belief) -> Array | None:
    """Unit vector (2,) along the estimated velocity; None at rest, where it says nothing."""
    velocity = belief.mean[2:4]
    speed = float(np.hypot(*velocity)) if len(velocity) == 2 else 0.0
    return velocity / speed if speed > SLOWEST_MPS else None
