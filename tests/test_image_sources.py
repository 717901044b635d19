"""Folders and videos become pictures with times, and everything that is odd about them is said."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from video_files import write_video

from scpf.ingest.camera_files import Clock, time_pictures
from scpf.ingest.image_sources import open_source
from scpf.ingest.pictures import Encoding
from scpf.ingest.raw_images import RawLayout
from scpf.models.errors import InputError, MissingError, UsageError

BASLER = "Basler_acA2040-55uc__23734412__20220818_183353703_{}.tiff"
BEGIN = 1_660_847_633_703_000_000


def folder_of(tmp_path: Path, names: list[str], size: tuple[int, int] = (8, 6)) -> Path:
    folder = tmp_path / "images"
    folder.mkdir(exist_ok=True)
    for name in names:
        Image.new("L", size, 50).save(folder / name)
    return folder


@pytest.mark.parametrize("padded", [True, False])
def test_a_basler_folder(tmp_path: Path, padded: bool) -> None:
    names = [BASLER.format(f"{k:04d}" if padded else k) for k in (1, 2, 9, 10, 11)]
    source = open_source(folder_of(tmp_path, names))
    assert source.names == names
    assert source.encoding == "PNG (lossless), from tiff"
    timed, missing = time_pictures(source, Clock(rate_hz=10.0, start="name"))
    assert missing == 6
    assert ((timed.stamps_ns - BEGIN) / 1e8).tolist() == [0, 1, 8, 9, 10]
    assert "counter jumps from 2 to 9: 6 frames dropped" in timed.notes
    assert {picture.encoded().format for picture in timed.pictures} == {"png"}
    with pytest.raises(MissingError, match="no times of their own"):
        time_pictures(source, Clock())


def test_chunk_times_and_one_pair_of_clocks(tmp_path: Path) -> None:
    source = open_source(folder_of(tmp_path, [BASLER.format(k) for k in (1, 2, 3)]))
    sidecar = tmp_path / "chunks.csv"
    sidecar.write_text("counter,chunk_timestamp_ns\n1,52000000000000\n2,52000076923077\n3,52000153846154\n")
    clock = Clock(timestamps=sidecar, offset="52000000000000=1660847613.703")
    stamps = time_pictures(source, clock)[0].stamps_ns
    assert (stamps - 1_660_847_613_703_000_000).tolist() == [0, 76_923_077, 153_846_154]


def test_raw_folders(tmp_path: Path) -> None:
    folder = tmp_path / "raw"
    folder.mkdir()
    for k in (1, 2, 10):
        (folder / f"{1_660_847_613 + k}.{k:09d}.raw").write_bytes(np.full((6, 8), 800, "<u2").tobytes())
    (folder / "settings.txt").write_text("gain 3")
    source = open_source(folder, RawLayout("bggr", 10, (8, 6)), Encoding("jpeg", 90))
    assert source.encoding == "JPEG at quality 90, from raw, Bayer bggr, 10 bit cut to 8"
    timed, _ = time_pictures(source, Clock(inside="names"))
    assert (timed.stamps_ns - 1_660_847_613 * 10**9).tolist() == [
        1_000_000_001,
        2_000_000_002,
        10_000_000_010,
    ]
    assert timed.notes == ["1 files with .txt in the folder are no images"]
    with pytest.raises(UsageError, match="how large") as caught:
        open_source(folder)
    assert "--raw-size" in caught.value.hint


def test_bayer_png_is_decoded_and_plain_png_is_not(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, ["1.png", "2.png"])
    plain = open_source(folder)
    assert plain.encoding == ""
    assert plain.pictures[0].encoded() == ((folder / "1.png").read_bytes(), "png")
    assert "Bayer rggb" in open_source(folder, RawLayout("rggb")).encoding
    Image.new("L", (8, 6)).save(folder / "3.jpg")
    with pytest.raises(UsageError, match=r"3\.jpg is a JPEG"):
        open_source(folder, RawLayout("rggb"))


def test_deep_tiff_says_what_is_cut(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    folder.mkdir()
    Image.fromarray(np.full((6, 8), 4000, np.uint16)).save(folder / "1.tiff")
    assert "16 bit cut to 8" in open_source(folder).encoding
    assert "12 bit cut to 8" in open_source(folder, RawLayout(bits=12)).encoding


def test_folders_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not there"):
        open_source(tmp_path / "none")
    (tmp_path / "a.txt").write_text("")
    with pytest.raises(InputError, match="neither a folder nor a video"):
        open_source(tmp_path / "a.txt")
    with pytest.raises(InputError, match="holds no image"):
        open_source(tmp_path)
    (tmp_path / "b.mp4").write_bytes(b"")
    with pytest.raises(InputError) as caught:
        open_source(tmp_path)
    assert "video file itself" in caught.value.hint
    folder = folder_of(tmp_path, ["1.tiff", "01.tif"])
    with pytest.raises(InputError, match="one number"):
        open_source(folder)
    (folder / "01.tif").unlink()
    Image.new("L", (9, 6)).save(folder / "2.tiff")
    with pytest.raises(InputError, match="differ in size: 8×6 and 9×6"):
        open_source(folder)
    Image.new("L", (8, 6)).save(folder / "3.png")
    with pytest.raises(InputError, match="several kinds"):
        open_source(folder)


def test_a_video_has_its_own_times(tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    write_video(path, "libx264", [0, 77, 154, 400], Fraction(1, 1000))
    source = open_source(path)
    assert source.encoding == "JPEG at quality 95, from h264"
    timed, missing = time_pictures(source, Clock(start="2022-08-18 18:33:33.703"))
    assert ((timed.stamps_ns - 1_660_847_613_703_000_000) // 10**6).tolist() == [0, 77, 154, 400]
    assert missing == 0
    sidecar = tmp_path / "times.csv"
    sidecar.write_text("frame,t_ns\n0,5\n1,6\n2,7\n3,9\n".replace("t_ns", "time_ns"))
    assert time_pictures(source, Clock(timestamps=sidecar))[0].stamps_ns.tolist() == [5, 6, 7, 9]
    assert time_pictures(source, Clock(rate_hz=10.0))[0].stamps_ns.tolist() == [
        0,
        10**8,
        2 * 10**8,
        3 * 10**8,
    ]
    with pytest.raises(UsageError, match="--times names"):
        time_pictures(source, Clock(inside="names"))
    with pytest.raises(UsageError, match="more than one place"):
        time_pictures(source, Clock(rate_hz=10.0, timestamps=sidecar))
    with pytest.raises(UsageError, match="folders of raw images"):
        open_source(path, RawLayout("rggb"))


def test_a_video_without_times_says_so(tmp_path: Path) -> None:
    write_video(tmp_path / "a.avi", "libx264", [0, 1, 2, 3, 4, 5], Fraction(1, 25), bf="2")
    source = open_source(tmp_path / "a.avi")
    with pytest.raises(MissingError, match="B-frames"):
        time_pictures(source, Clock())
    assert len(time_pictures(source, Clock(rate_hz=25.0))[0].pictures) == 6
