"""Pictures from the headless viewer: each view shows what it should. Needs a Vulkan driver."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from synthetic_steps import camera, road_map, synthetic_steps

from scpf.ingest.drive_log import DriveLog
from scpf.models.errors import InputError, MissingError
from scpf.replay import viewer
from scpf.replay.cli import run
from scpf.replay.overlays import LandmarkClasses
from scpf.replay.recording import Recording

needs_driver = pytest.mark.skipif(bool(viewer.missing_driver()), reason=viewer.missing_driver() or "–")

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
SIZE = (1200, 800)
BLIND = 3


def near(picture: NDArray[np.uint8], colour: tuple[int, int, int], tolerance: int = 40) -> int:
    """How many pixels are about that colour."""
    return int((np.abs(picture.astype(int) - colour).max(axis=-1) < tolerance).sum())


@pytest.fixture(scope="module")
def rrd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short recording; its fourth frame shows no pole."""
    path = tmp_path_factory.mktemp("viewer") / "bend.rrd"
    settings = {"seed": "0"}
    with Recording(
        path, name="bend", camera=camera(), road_map=road_map(), about_markdown="# bend", settings=settings
    ) as recording:
        for step in synthetic_steps(6, blind=frozenset({BLIND}), particles=300, cells=41):
            recording.log(step)
    return path


@needs_driver
def test_every_view_shows_what_it_should(rrd: Path, tmp_path: Path) -> None:
    pictures = [
        np.asarray(Image.open(path))
        for path in viewer.screenshot(rrd, [BLIND - 1, BLIND], tmp_path / "pictures", SIZE)
    ]
    assert [picture.shape for picture in pictures] == [(SIZE[1], SIZE[0], 3)] * 2
    middle, upper = SIZE[0] // 2, SIZE[1] // 2
    seen, blind = (
        {"camera": p[:upper, :middle], "map": p[:upper, middle:], "plots": p[upper:]} for p in pictures
    )
    step = synthetic_steps(6, blind=frozenset({BLIND}), particles=300, cells=41)[BLIND - 1]
    name = next(match.landmark_id for match in step.matches if match.landmark_id)
    colour = LandmarkClasses(road_map()).colour_of(name)
    assert near(seen["camera"], colour) > 20, "outline of the matched landmark"
    assert near(blind["camera"], colour) == 0, "nothing is left of it a frame later"
    for shown in (seen, blind):
        red, green, blue = shown["map"].astype(int).transpose(2, 0, 1)
        assert ((red > 120) & (green < red / 2) & (blue < red / 2)).sum() > 50, "particles"
        assert near(shown["map"], (190, 190, 195), 25) > 50, "road edges"
        assert near(shown["map"], (70, 230, 255)) > 20, "estimate"
    assert near(seen["map"], colour) > near(blind["map"], colour), "ring of the predicted distance"
    assert near(seen["plots"], colour) > 5, "its distance"
    assert near(seen["plots"], (70, 230, 255)) > 10, "position error of the scPF"


@needs_driver
def test_pictures_in_a_file_of_their_own_lie_under_the_masks(tmp_path: Path) -> None:
    options = ["--segmenter", "recorded", "--duration", "0.3", "--images", "separate", "-q"]
    assert run(["replay", str(SAMPLE), "-o", str(tmp_path), *options]) == 0
    (path,) = viewer.screenshot(tmp_path / "ring_road.rrd", [2], tmp_path, SIZE)
    camera_view = np.asarray(Image.open(path))[: SIZE[1] // 2, : SIZE[0] // 2]
    red, green, blue = camera_view.astype(int).transpose(2, 0, 1)
    assert ((blue > 150) & (blue > red + 15)).sum() > 2000, "the sky of the picture"
    assert ((green > red + 20) & (green > blue + 20)).sum() > 2000, "and its grass"
    with DriveLog(SAMPLE) as log:
        colour = LandmarkClasses(log.road_map()).colour_of("P32")
    assert near(camera_view, colour) > 20, "the outline of P32"


def test_without_a_driver_the_error_says_what_to_install(rrd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "DRIVERS", ())
    monkeypatch.delenv("VK_DRIVER_FILES", raising=False)
    monkeypatch.delenv("VK_ICD_FILENAMES", raising=False)
    with pytest.raises(MissingError, match="Vulkan") as caught:
        viewer.screenshot(rrd, [0], rrd.parent)
    assert "mesa-vulkan-drivers" in caught.value.hint


def test_a_recording_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not there"):
        viewer.screenshot(tmp_path / "no.rrd", [0], tmp_path)
