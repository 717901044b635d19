"""Files of times: which row means which image, in which unit."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.sidecar import read_sidecar
from scpf.models.errors import InputError, ScpfError, UsageError

NAMES = ["img_1.png", "img_2.png", "img_3.png"]
STAMPS = [10 * 10**9, 10_500_000_000, 11 * 10**9]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "times"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        "10\n10.5\n11\n",
        "# times\n10\n\n10.5\n11",
        "1970-01-01 00:00:10\n1970-01-01 00:00:10.5\n1970-01-01 00:00:11\n",
        "image,timestamp\nimg_1.png,10\nimg_2.png,10.5\nimg_3.png,11\n",
        "img_3.png,11\nimg_1.png,10\nimg_2.png,10.5\n",
        "img_1 10\nimg_2 10.5\nimg_3 11\n",
        "0;10\n1;10.5\n2;11\n",
        "1\t10\n2\t10.5\n3\t11\n",
        "#timestamp [ns],filename\n10000000000,img_1.png\n10500000000,img_2.png\n11000000000,img_3.png\n",
        "timestamp_us,frame\n10000000,1\n10500000,2\n11000000,3\n",
        "frame,exposure_time_us,t_ms,gain\n1,50,10000,1\n2,50,10500,1\n3,50,11000,1\n".replace(
            "t_ms", "time_ms"
        ),
        "10,img_1.png\n10.5,img_2.png\n11,img_3.png\n",
        "frame, time (s)\n0, 10\n1, 10.5\n2, 1.1e1\n",
        'name,stamp\n"img_1.png","10"\n"img_2.png","10.5"\n"folder/img_3.png","11"\n',
    ],
)
def test_times_belong_to_images(tmp_path: Path, text: str) -> None:
    sidecar = read_sidecar(written(tmp_path, text), NAMES)
    assert sidecar.stamps_ns == STAMPS
    assert (sidecar.unclaimed, sidecar.notes) == (0, [])


def test_a_stated_unit_is_that_of_plain_numbers(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "frame,chunk\n1,52000000000000\n2,52000076923077\n3,52000153846154\n".replace("chunk", "chunk_time"),
    )
    assert read_sidecar(path, NAMES, "ns").stamps_ns == [52000000000000, 52000076923077, 52000153846154]
    with pytest.raises(UsageError, match="unit of time 'days'"):
        read_sidecar(path, NAMES, "days")


def test_frames_of_a_video_counted_from_one(tmp_path: Path) -> None:
    for first in (0, 1):
        text = "".join(f"{k + first},{stamp / 1e9}\n" for k, stamp in enumerate(STAMPS))
        sidecar = read_sidecar(written(tmp_path, text), ["0", "1", "2"])
        assert sidecar.stamps_ns == STAMPS
        assert sidecar.notes == (["times counts the images from 1"] if first else [])


def test_frames_that_one_side_lacks_are_counted(tmp_path: Path) -> None:
    sidecar = read_sidecar(
        written(tmp_path, "img_1.png,10\nimg_3.png,11\nimg_4.png,12\nimg_5.png,13\n"), NAMES
    )
    assert sidecar.stamps_ns == [STAMPS[0], None, STAMPS[2]]
    assert sidecar.unclaimed == 2
    assert "2 times in times are of images that are not there" in sidecar.notes


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "holds no time"),
        ("10\n11\n", "2 times for 3 images"),
        ("10\nx\n11\n", "times:2"),
        ("img_1.png,10\nimg_1.png,11\nimg_3.png,12\n", "times:2: a second time for img_1"),
        ("img_1.png,10\nimg_2.png,x\nimg_3.png,12\n", "times:2: 'x'"),
        ("other_7.png,10\nother_8.png,11\n", "times for 0 of 3 images"),
        ("1,2,3\n4,5,6\n", "which of 3 columns"),
        ("1,10\n2,10,5\n", "times:2: 3 columns"),
        ("a,b\n", "holds no time"),
    ],
)
def test_files_that_do_not_fit(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(InputError, match=what):
        read_sidecar(written(tmp_path, text), NAMES)


def test_files_that_are_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_sidecar(tmp_path / "none", NAMES)
    path = tmp_path / "times"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        read_sidecar(path, NAMES)


def test_mutated_files_raise_nothing_else(tmp_path: Path) -> None:
    rng, path = np.random.default_rng(0), tmp_path / "times"
    wholes = [
        b"#timestamp [ns],filename\n10000000000,img_1.png\n10500000000,img_2.png\n11000000000,img_3.png\n",
        b"10\n10.5\n1.1e+01\n",
        b'image;time\n"img_1.png";1970-01-01 00:00:10.5\nimg_2.png;1e1\nimg_3.png;-4\n',
    ]
    pieces = [
        b",",
        b"\n",
        b'"',
        b"9" * 30,
        b"e99",
        b".",
        b"\0",
        b"\xff",
        b"#",
        b"inf",
        b"\xc2\xb2",
        b" ",
        b"1e-99",
    ]
    started, refused = time.monotonic(), 0
    for trial in range(1500):
        data = bytearray(wholes[trial % 3])
        for _ in range(int(rng.integers(1, 5))):
            at = int(rng.integers(len(data)))
            data[at : at + int(rng.integers(0, 4))] = pieces[int(rng.integers(len(pieces)))]
        path.write_bytes(data)
        try:
            read_sidecar(path, NAMES, [None, "ns", "s"][trial % 7 % 3])
        except ScpfError as error:
            refused += 1
            assert "times" in error.message
    assert refused > 500
    assert time.monotonic() - started < 10


def test_kitti_raw(tmp_path: Path, shared_data: Path) -> None:
    folder = shared_data / "kitti_raw_0002" / "image_02"
    names = [f"{k:010d}.png" for k in range(10)]
    with pytest.raises(InputError, match="77 times for 10 images"):
        read_sidecar(folder / "timestamps.txt", names)
    lines = (folder / "timestamps.txt").read_text().splitlines()[:10]
    stamps = np.array(read_sidecar(written(tmp_path, "\n".join(lines)), names).stamps_ns, dtype=np.int64)
    assert stamps[0] % 10**9 == int(lines[0].split(".")[1])
    np.testing.assert_allclose(np.diff(stamps) * 1e-9, 0.1, atol=0.01)
