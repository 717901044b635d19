"""The distance model of a replay: the one that ships, or a file."""

from __future__ import annotations

from pathlib import Path

from scpf.models import distance_file
from scpf.models.camera import Camera
from scpf.models.distance_file import Distances
from scpf.models.errors import MissingError


def load(name: str, camera: Camera) -> Distances:
    """The distance model by name (``default``: the one that ships) or file; it has to fit the camera's images."""
    shipped = Path(distance_file.__file__).with_name("distance.npz")
    path = shipped if name == "default" else Path(name)
    if path == shipped and not shipped.exists():
        raise MissingError("this installation ships no distance model", "give one with --distance-model")
    model = distance_file.load(path)
    model.check_camera(camera)
    return model
