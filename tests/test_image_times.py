"""Times of pictures: names, EXIF, rate, clocks, and what happens to times that do not increase."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from scpf.ingest.image_times import clock_offset_ns, from_exif, from_names, from_rate, missing_frames, settle
from scpf.ingest.pictures import Encoded
from scpf.models.errors import InputError, UsageError

BASLER = "Basler_acA2040-55uc__23734412__20220818_183353703_{:04d}.tiff"
BEGIN = 1_660_847_633_703_000_000


@dataclass(frozen=True)
class Named:
    name: str
    width_px: int = 8
    height_px: int = 6

    def encoded(self) -> Encoded:
        raise AssertionError("times are found without reading pictures")


def named(*names: str) -> list[Named]:
    return [Named(name) for name in names]


def test_ros_style_names() -> None:
    assert from_names(named("1660847613.703000001.png", "1660847613.780000000.png")) == [
        1_660_847_613_703_000_001,
        1_660_847_613_780_000_000,
    ]
    assert from_names(named("1660847613703000001.png", "1660847613780000000.png", "preview.png"))[2] is None


def test_basler_names_hold_no_times_but_offer_the_start() -> None:
    names = [BASLER.format(k) for k in (1, 2, 3, 6)]
    with pytest.raises(InputError, match="no time in the name") as caught:
        from_names(named(*names))
    assert "--start-time name" in caught.value.hint
    stamps = from_rate(names, 10.0, "name")
    assert stamps == [BEGIN, BEGIN + 10**8, BEGIN + 2 * 10**8, BEGIN + 5 * 10**8], (
        "dropped frames take their time"
    )
    count, notes = missing_frames(names)
    assert (count, notes) == (2, ["counter jumps from 3 to 6: 2 frames dropped"])
    with pytest.raises(InputError, match="no date"):
        from_rate(["1.png", "2.png"], 10.0, "name")


def test_a_rate_makes_times_without_drift() -> None:
    names = [f"{k}.png" for k in range(13 * 3600)]
    stamps = from_rate(names, 13.0, "5")
    assert stamps[0] == 5 * 10**9
    assert stamps[13 * 1000] == 1005 * 10**9
    for rate in (0.0, -1.0, float("nan")):
        with pytest.raises(UsageError):
            from_rate(names, rate, "0")
    with pytest.raises(InputError, match="years after"):
        from_rate(["1.png", "2.png", "99999999999999.png"], 13.0, "0")


def exif_file(path: Path, **tags: str) -> Path:
    exif = Image.Exif()
    numbers = {"original": 36867, "fraction": 37521, "offset": 36881}
    inner = exif.get_ifd(0x8769)
    for name, text in tags.items():
        if name == "changed":
            exif[306] = text
        else:
            inner[numbers[name]] = text
    Image.new("L", (8, 6)).save(path, exif=exif)
    return path


@pytest.mark.parametrize(
    ("tags", "stamp_ns"),
    [
        ({"original": "2022:08-18"}, None),
        ({"original": "2022:08:18 18:33:33", "fraction": "703"}, 1_660_847_613_703_000_000),
        ({"original": "2022:08:18 18:33:33", "fraction": "07"}, 1_660_847_613_070_000_000),
        ({"original": "2022:08:18 14:33:33", "offset": "-04:00"}, 1_660_847_613_000_000_000),
        ({"original": "2022:08:19 00:03:33", "fraction": "5", "offset": "+05:30"}, 1_660_847_613_500_000_000),
        ({"changed": "2022:08:18 18:33:33"}, 1_660_847_613_000_000_000),
        ({"original": "2022:08:18 18:33:33", "offset": "+99:00"}, None),
    ],
)
def test_exif(tmp_path: Path, tags: dict[str, str], stamp_ns: int | None) -> None:
    good = exif_file(tmp_path / "1.jpg", original="2022:08:18 18:33:33", offset="+00:00")
    path, notes = exif_file(tmp_path / "2.jpg", **tags), list[str]()
    assert from_exif([good, path], notes)[1] == stamp_ns
    assert bool(notes) == (stamp_ns is not None and "offset" not in tags)


def test_no_exif(tmp_path: Path) -> None:
    Image.new("L", (8, 6)).save(tmp_path / "1.jpg")
    with pytest.raises(InputError, match=r"1\.jpg: no EXIF time"):
        from_exif([tmp_path / "1.jpg"], [])


def test_times_that_do_not_increase_are_left_out_and_named() -> None:
    pictures = named(*(f"{k}.png" for k in range(8)))
    timed = settle(pictures, [10, 20, 20, 30, 25, None, 40, 50], 5)
    assert timed.stamps_ns.tolist() == [15, 25, 35, 45, 55]
    assert [picture.name for picture in timed.pictures] == ["0.png", "1.png", "3.png", "6.png", "7.png"]
    assert timed.dropped == {
        "image with the time of the one before": 1,
        "image with an earlier time than one before": 1,
        "image without a time": 1,
    }
    assert timed.notes[0] == "2.png: image with the time of the one before"


def test_times_that_fit_few_images_are_refused() -> None:
    pictures = named(*(f"{k}.png" for k in range(8)))
    with pytest.raises(InputError, match="7 of 8 images have no time of their own"):
        settle(pictures, [5] * 8)
    with pytest.raises(InputError, match=r"1\.png: image with an earlier"):
        settle(pictures, [10**18, *range(7)])
    with pytest.raises(InputError, match="does not fit a log"):
        settle(pictures, [k - 3 for k in range(8)])
    with pytest.raises(InputError, match="does not fit a log"):
        settle(pictures, [2**62 + k for k in range(8)])


@pytest.mark.parametrize(
    ("text", "unit", "offset_ns"),
    [
        ("1.5", None, 1_500_000_000),
        ("-0.25", "ns", -250_000_000),
        ("52000000000001=1660847613.703", None, 1_660_847_613_703_000_000 - 52_000_000_000_001),
        ("52000.5=1660847613703000000", "s", 1_660_847_613_703_000_000 - 52_000_500_000_000),
        ("52000000001=2022-08-18 18:33:33.703", "us", 1_660_847_613_703_000_000 - 52_000_000_001_000),
    ],
)
def test_a_pair_of_clocks(text: str, unit: str | None, offset_ns: int) -> None:
    assert clock_offset_ns(text, unit) == offset_ns


@pytest.mark.parametrize("text", ["", "x", "=5", "1=", "1=x", "inf", "nan", "-1=5", "1e400", "9" * 40 + "=1"])
def test_what_is_no_pair_of_clocks(text: str) -> None:
    with pytest.raises(UsageError, match="clock-offset"):
        clock_offset_ns(text, None)


def test_kitti_raw_has_no_gap(shared_data: Path) -> None:
    names = sorted(path.name for path in (shared_data / "kitti_raw_0002" / "image_02" / "data").iterdir())
    assert missing_frames(names) == (0, [])
    np.testing.assert_array_equal(from_rate(names, 10.0, "0"), np.arange(10) * 10**8)
