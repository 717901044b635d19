"""Image folders: order, sizes, and times as people write them."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from scpf.ingest.images import list_images, parse_time
from scpf.models.errors import InputError


def folder_of(tmp_path: Path, names: list[str], size: tuple[int, int] = (8, 6)) -> Path:
    folder = tmp_path / "images"
    folder.mkdir()
    for name in names:
        Image.new("L", size).save(folder / name, format="PNG" if name.endswith("png") else "JPEG")
    return folder


def test_numbers_count_as_numbers(tmp_path: Path) -> None:
    names = ["cam__1_0010.png", "cam__1_2.png", "cam__1_0001.png", "cam__1_100.png"]
    images = list_images(folder_of(tmp_path, names))
    ordered = ["cam__1_0001.png", "cam__1_2.png", "cam__1_0010.png", "cam__1_100.png"]
    assert [image.path.name for image in images] == ordered
    assert {(image.width_px, image.height_px, image.format) for image in images} == {(8, 6, "png")}


def test_the_content_says_the_format(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, ["1.jpg", "2.jpeg"])
    Image.new("L", (8, 6)).save(folder / "3.jpg", format="PNG")
    assert [image.format for image in list_images(folder)] == ["jpeg", "jpeg", "png"]


def test_folders_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not a folder"):
        list_images(tmp_path / "none")
    with pytest.raises(InputError, match="holds no image"):
        list_images(tmp_path)
    folder = folder_of(tmp_path, ["1.png", "01.png"])
    with pytest.raises(InputError, match="one number"):
        list_images(folder)
    (folder / "01.png").unlink()
    Image.new("L", (9, 6)).save(folder / "2.png")
    with pytest.raises(InputError, match="differ in size: 8×6 and 9×6"):
        list_images(folder)
    (folder / "2.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"2\.png is not a readable image"):
        list_images(folder)


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("1660847613.703", 1660847613703000000),
        ("1660847613703000001", 1660847613703000001),
        ("0.1", 100_000_000),
        ("1.036224e-01", 103_622_400),
        ("0", 0),
        ("-1.5", -1_500_000_000),
        ("2011-09-26 13:02:25.951199337", 1317042145951199337),
        ("2011-09-26T13:02:25Z", 1317042145000000000),
    ],
)
def test_times_are_exact(text: str, stamp_ns: int) -> None:
    assert parse_time(text, "here") == stamp_ns


@given(st.integers(0, 9_223_372_035), st.integers(0, 999_999_999))
def test_no_time_passes_through_a_float(seconds: int, nanoseconds: int) -> None:
    assert parse_time(f"{seconds}.{nanoseconds:09d}", "") == seconds * 10**9 + nanoseconds


@pytest.mark.parametrize(
    "text", ["", "noon", "2011-13-26 13:02:25", "1e999", "nan", "1" * 5000, "9" * 19, "9" * 11, "١٢"]
)
def test_what_is_no_time_names_its_place(text: str) -> None:
    started = time.monotonic()
    if text == "١٢":  # digits of another script are digits
        assert parse_time(text, "x") == 12 * 10**9
        return
    with pytest.raises(InputError, match=r"times\.txt:3"):
        parse_time(text, "times.txt:3")
    assert time.monotonic() - started < 1.0


def test_kitti_raw(shared_data: Path) -> None:
    images = list_images(shared_data / "kitti_raw_0002" / "image_02" / "data")
    assert [image.path.stem for image in images] == [f"{k:010d}" for k in range(10)]
    assert images[3].encoded() == (images[3].path.read_bytes(), "png")
