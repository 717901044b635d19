"""Image folders: order, sizes, and the times that belong to them."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from scpf.ingest.images import list_images, parse_time, read_stamps, stamps_at_rate
from scpf.models.errors import InputError, UsageError


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


@given(st.integers(0, 99_999_999_999), st.integers(0, 999_999_999))
def test_no_time_passes_through_a_float(seconds: int, nanoseconds: int) -> None:
    assert parse_time(f"{seconds}.{nanoseconds:09d}", "") == seconds * 10**9 + nanoseconds


@pytest.mark.parametrize("text", ["", "noon", "2011-13-26 13:02:25", "1e999", "nan", "1" * 5000, "١٢"])
def test_what_is_no_time_names_its_place(text: str) -> None:
    started = time.monotonic()
    if text == "١٢":  # digits of another script are digits
        assert parse_time(text, "x") == 12 * 10**9
        return
    with pytest.raises(InputError, match=r"times\.txt:3"):
        parse_time(text, "times.txt:3")
    assert time.monotonic() - started < 1.0


NAMES = ["1.png", "2.png", "3.png"]


@pytest.mark.parametrize(
    "text",
    [
        "10\n10.5\n11\n",
        "# times\n10\n\n10.5\n11",
        "image,timestamp\n1.png,10\n2.png,10.5\n3.png,11\n",
        "3.png,11\n1.png,10\n2.png,10.5\n",
        "0;10\n1;10.5\n2;11\n".replace("0;", "1;")
        .replace("\n1;10.5", "\n2;10.5")
        .replace("\n2;11", "\n3;11"),
    ],
)
def test_times_belong_to_images(tmp_path: Path, text: str) -> None:
    images = list_images(folder_of(tmp_path, NAMES))
    path = tmp_path / "times"
    path.write_text(text)
    np.testing.assert_array_equal(read_stamps(path, images), [10 * 10**9, 10_500_000_000, 11 * 10**9])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("10\n11\n", "2 times for 3 images"),
        ("10\n12\n11\n", r"3\.png has an earlier time than 2\.png"),
        ("10\n10\n11\n", r"2\.png has the same time as 1\.png"),
        ("10\nx\n11\n", "times:2"),
        ("1.png,10\n2.png,11\n", r"no time for 1 of 3 images, such as 3\.png"),
        ("1.png,10\n2.png,11\n3.png,12\n4.png,13\n", r"times:4: no image '4\.png'"),
        ("1.png,10\n1.png,11\n3.png,12\n", "second time"),
        ("1.png,10\n2.png,x\n3.png,12\n", "times:2"),
    ],
)
def test_times_that_do_not_fit_are_refused(tmp_path: Path, text: str, what: str) -> None:
    images = list_images(folder_of(tmp_path, NAMES))
    path = tmp_path / "times"
    path.write_text(text)
    with pytest.raises(InputError, match=what):
        read_stamps(path, images)


def test_a_rate_makes_times_without_drift() -> None:
    stamps = stamps_at_rate(13 * 3600, 13.0, 5)
    assert stamps[0] == 5
    assert stamps[13 * 1000] == 5 + 1000 * 10**9
    for rate in (0.0, -1.0, float("nan")):
        with pytest.raises(UsageError):
            stamps_at_rate(3, rate, 0)


def test_kitti_raw(tmp_path: Path, shared_data: Path) -> None:
    folder = shared_data / "kitti_raw_0002" / "image_02"
    images = list_images(folder / "data")
    assert [image.path.stem for image in images] == [f"{k:010d}" for k in range(10)]
    with pytest.raises(InputError, match="77 times for 10 images"):
        read_stamps(folder / "timestamps.txt", images)
    lines = (
        (folder / "timestamps.txt").read_text().splitlines()[:10]
    )  # the folder here is the drive's beginning
    (tmp_path / "times").write_text("\n".join(lines))
    np.testing.assert_allclose(np.diff(read_stamps(tmp_path / "times", images)) * 1e-9, 0.1, atol=0.01)
