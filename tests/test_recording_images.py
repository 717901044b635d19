"""Pictures in a file of their own: read back, shared by the runs of a log, and written anew for another log."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from scpf.ingest.drive_log import DriveLog, DriveLogWriter
from scpf.ingest.log_messages import EncodedImage
from scpf.replay import recording_images
from scpf.replay.cli import run
from scpf.replay.frames import Window
from scpf.replay.recording_images import SharedImages, recording_id, with_images
from scpf.replay.viewer import viewer_executable

SAMPLE = Path(__file__).parent.parent / "sample_logs" / "ring_road.mcap"
OPTIONS = ["--segmenter", "recorded", "-q"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first eight frames of the sample, without anything else."""
    path = tmp_path_factory.mktemp("log") / "short.mcap"
    shortened(path, 8)
    return path


def shortened(path: Path, count: int) -> None:
    with DriveLog(SAMPLE) as sample, DriveLogWriter(path, overwrite=True) as short:
        for image, _ in zip(sample.images(), range(count), strict=False):
            short.write_image(image.stamp_ns, image.data, image.format)


def replayed(log: Path, folder: Path, *options: str, images: str = "separate") -> None:
    """A replay; 3, as the log has neither map nor calibration."""
    assert run(["replay", str(log), "-o", str(folder), *OPTIONS, "--images", images, *options]) == 3


def pictures(rrd: Path) -> dict[int, bytes]:
    """The bytes of each frame's picture."""
    found = {}
    for chunk in RrdReader(rrd).stream().filter(content="/camera/image", components="EncodedImage:blob"):
        if not chunk.is_static:
            batch = chunk.to_record_batch()
            frames = batch.column("frame").cast(pa.int64()).to_pylist()
            blobs = batch.column("EncodedImage:blob").to_pylist()
            found |= {frame: bytes(blob[0]) for frame, blob in zip(frames, blobs, strict=True)}
    return found


def test_the_pictures_are_the_logs_and_the_runs_have_none(log: Path, tmp_path: Path) -> None:
    replayed(log, tmp_path, "--name", "one")
    images = tmp_path / "short.images.rrd"
    with DriveLog(log) as opened:
        assert pictures(images) == {k: bytes(image.data) for k, image in enumerate(opened.images())}
    assert pictures(tmp_path / "one.rrd") == {}
    assert recording_id(tmp_path / "one.rrd") == recording_id(images) != ""
    assert with_images(tmp_path / "one.rrd") == [tmp_path / "one.rrd", images]
    for path in (images, tmp_path / "one.rrd"):
        done = subprocess.run([viewer_executable(), "rrd", "verify", path], capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
    assert not list(tmp_path.glob("*partial*"))


def test_a_second_run_shares_the_file_and_another_log_does_not(log: Path, tmp_path: Path) -> None:
    own = tmp_path / "short.mcap"
    shutil.copy(log, own)
    replayed(own, tmp_path, "--name", "one")
    images = tmp_path / "short.images.rrd"
    first = images.stat().st_mtime_ns
    replayed(own, tmp_path, "--name", "two", "--seed", "4")
    assert images.stat().st_mtime_ns == first
    assert recording_id(tmp_path / "two.rrd") == recording_id(tmp_path / "one.rrd")

    shortened(own, 5)
    replayed(own, tmp_path, "--name", "three")
    assert sorted(pictures(images)) == list(range(5))
    assert with_images(tmp_path / "one.rrd") == [tmp_path / "one.rrd"], "those are not its pictures"


def test_a_stretch_has_its_own_file(log: Path, tmp_path: Path) -> None:
    replayed(log, tmp_path, "--start", "0.2", "--duration", "0.3", "--rate", "7", "--name", "part")
    images = tmp_path / "short.0.2s-0.5s.7hz.images.rrd"
    shown = sorted(pictures(images))
    assert 0 < len(shown) < 5 and min(shown) > 1
    assert with_images(tmp_path / "part.rrd") == [tmp_path / "part.rrd", images]


def test_two_runs_with_one_seed_are_the_same_recording(log: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        replayed(log, tmp_path / name)
    for file in ("short.rrd", "short.images.rrd"):
        command = [
            viewer_executable(), "rrd", "compare", "--unordered", tmp_path / "one" / file, tmp_path / "two" / file,
        ]  # fmt: skip
        assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_an_embedded_run_stands_alone_and_a_damaged_file_is_written_anew(log: Path, tmp_path: Path) -> None:
    images = tmp_path / "short.images.rrd"
    images.write_bytes(b"not a recording")
    assert recording_id(images) == recording_id(tmp_path / "no.rrd") == ""
    replayed(log, tmp_path, "--name", "whole", images="embed")
    assert with_images(tmp_path / "whole.rrd") == [tmp_path / "whole.rrd"]
    replayed(log, tmp_path, "--name", "apart")
    assert len(pictures(images)) == 8


def test_an_interruption_leaves_no_half_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def torn(log: DriveLog, window: Window) -> Iterator[tuple[int, float, EncodedImage]]:
        yield 0, 0.0, next(log.images())
        raise KeyboardInterrupt

    monkeypatch.setattr(recording_images, "pictures", torn)
    shared = SharedImages.of(tmp_path, SAMPLE, "0" * 64, Window())
    with DriveLog(SAMPLE) as log, pytest.raises(KeyboardInterrupt):
        shared.write_unless_there(log, Window())
    assert not list(tmp_path.iterdir())
