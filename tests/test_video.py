"""Videos: presentation times exactly as the container has them, payloads untouched where they can be."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from video_files import HEIGHT, WIDTH, brightness, write_video

from scpf.ingest.mjpeg import as_jpeg, standard_tables
from scpf.ingest.pictures import Encoding
from scpf.ingest.video import open_video
from scpf.models.errors import DamagedError, InputError, MissingError

TIMES = [0, 40, 83, 200, 241, 360, 399, 1040]
"""Milliseconds: a frame rate that varies, with a gap."""
JPEG = Encoding("jpeg", 95)


def mean_of(data: bytes) -> float:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None and image.shape == (HEIGHT, WIDTH, 3)
    return float(image.mean())


@pytest.mark.parametrize(
    ("name", "codec"),
    [
        ("a.mp4", "libx264"),
        ("a.mp4", "libx265"),
        ("a.mkv", "libx264"),
        ("a.mov", "libx265"),
        ("a.mkv", "mjpeg"),
    ],
)
def test_presentation_times_come_back_exactly(tmp_path: Path, name: str, codec: str) -> None:
    path = tmp_path / name
    write_video(path, codec, TIMES, Fraction(1, 1000))
    video = open_video(path, JPEG)
    assert (video.frames, video.width_px, video.height_px) == (len(TIMES), WIDTH, HEIGHT)
    exact = [time * Fraction(1, 1000) for time in TIMES]
    assert [(time - video.times[0]) * video.time_base for time in video.times] == exact
    assert video.stamps_ns(7) == [7 + time * 10**6 for time in TIMES]
    for index, picture in enumerate(
        video.pictures()
    ):  # B-frames are stored in another order than they are shown
        assert mean_of(picture.encoded().data) == pytest.approx(brightness(index), abs=4)


def test_times_of_a_time_base_that_no_nanosecond_divides(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4", "libx264", [1001 * k for k in range(30)], Fraction(1, 30000))
    stamps = open_video(tmp_path / "a.mp4", JPEG).stamps_ns(0)
    assert stamps == [round(Fraction(1001 * k, 30000) * 10**9) for k in range(30)]


def test_motion_jpeg_is_not_touched(tmp_path: Path) -> None:
    import av

    path = tmp_path / "a.avi"
    write_video(path, "mjpeg", [0, 1, 2, 5, 6], Fraction(1, 25))
    with av.open(str(path)) as container:
        packets = [bytes(packet) for packet in container.demux(video=0) if packet.size]
    video = open_video(path, JPEG)
    assert video.untouched
    assert video.stamps_ns(0) == [0, 40_000_000, 80_000_000, 200_000_000, 240_000_000]
    assert [picture.encoded() for picture in video.pictures()] == [(packet, "jpeg") for packet in packets]


def test_png_video_is_not_touched(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mov", "png", [0, 40, 80], Fraction(1, 1000))
    frames = [picture.encoded() for picture in open_video(tmp_path / "a.mov", JPEG).pictures()]
    assert [frame.format for frame in frames] == ["png"] * 3
    assert [mean_of(frame.data) for frame in frames] == [brightness(k) for k in range(3)]


def test_frames_without_huffman_tables_become_whole_files() -> None:
    image = np.random.default_rng(0).integers(0, 255, (24, 32, 3)).astype(np.uint8)
    whole = cv2.imencode(".jpg", image)[1].tobytes()
    bare, at = whole[:2], 2
    while whole[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(whole[at + 2 : at + 4], "big")
        bare += b"" if whole[at + 1] == 0xC4 else whole[at:end]
        at = end
    bare += whole[at:]
    assert b"\xff\xc4" not in bare[:400]
    restored = as_jpeg(bare, (32, 24))
    assert restored is not None
    shown = cv2.imdecode(np.frombuffer(restored, np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(shown, cv2.imdecode(np.frombuffer(whole, np.uint8), cv2.IMREAD_COLOR))
    assert as_jpeg(whole, (32, 24)) is whole
    assert as_jpeg(whole, (32, 48)) is None, "half a picture of interlaced video is decoded instead"
    assert len(standard_tables()) in (420, 432)


@pytest.mark.parametrize("length", [0, 1, 3, 10, 100])
def test_broken_jpeg_headers(length: int) -> None:
    whole = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    assert as_jpeg(whole[:length], (8, 8)) is None
    assert as_jpeg(b"\xff\xd8" + b"\xff\xe0\0\0" * 5000, (8, 8)) is None


def test_lossless_encoding_and_colours(tmp_path: Path) -> None:
    colours = [(200, 40, 40), (40, 200, 40), (40, 40, 200)]
    write_video(tmp_path / "a.mp4", "libx264", [0, 40, 80], Fraction(1, 1000), colours, crf="1")
    for colour, picture in zip(
        colours, open_video(tmp_path / "a.mp4", Encoding("png")).pictures(), strict=True
    ):
        data, format = picture.encoded()
        assert format == "png"
        bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).reshape(-1, 3).mean(axis=0)
        np.testing.assert_allclose(bgr[::-1], colour, atol=4)


def test_bare_streams_have_no_times(tmp_path: Path) -> None:
    for name, codec in (("a.h265", "libx265"), ("a.h264", "libx264"), ("a.mjpeg", "mjpeg")):
        write_video(tmp_path / name, codec, [0, 1, 2, 3], Fraction(1, 25))
        video = open_video(tmp_path / name, JPEG)
        assert (video.frames, video.times) == (4, [])
        means = [mean_of(picture.encoded().data) for picture in video.pictures()]
        assert means == pytest.approx([brightness(k) for k in range(4)], abs=4)


def test_avi_with_frames_out_of_order_has_no_times(tmp_path: Path) -> None:
    write_video(tmp_path / "a.avi", "libx264", [0, 1, 2, 3, 4, 5], Fraction(1, 25), bf="2")
    video = open_video(tmp_path / "a.avi", JPEG)
    assert video.times == [] and "B-frames" in video.notes[0]
    means = [mean_of(picture.encoded().data) for picture in video.pictures()]
    assert means == pytest.approx([brightness(k) for k in range(6)], abs=4)
    write_video(tmp_path / "b.avi", "libx264", [0, 1, 2, 5], Fraction(1, 25), bf="0")
    assert open_video(tmp_path / "b.avi", JPEG).stamps_ns(0) == [0, 40_000_000, 80_000_000, 200_000_000]


def test_damaged_frames_are_an_error_of_their_own(tmp_path: Path) -> None:
    import av

    path = tmp_path / "a.avi"
    write_video(path, "libx264", [0, 1, 2, 3, 4], Fraction(1, 25), g="1", bf="0")
    data = bytearray(path.read_bytes())
    with av.open(str(path)) as container:
        third = [bytes(packet) for packet in container.demux(video=0) if packet.size][2]
    at = data.index(third)
    data[at : at + len(third)] = bytes(len(third))
    path.write_bytes(data)
    pictures = open_video(path, JPEG).pictures()
    with pytest.raises(InputError, match="frame 2 cannot be decoded"):
        pictures[2].encoded()
    assert mean_of(pictures[3].encoded().data) == pytest.approx(brightness(3), abs=4)
    assert mean_of(pictures[0].encoded().data) == pytest.approx(
        brightness(0), abs=4
    )  # going back reads again


def test_files_that_are_no_video(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    for data in (b"", b"no video", b"\0" * 10_000):
        path.write_bytes(data)
        with pytest.raises(DamagedError, match=r"a\.mp4"):
            open_video(path, JPEG)
    with pytest.raises(InputError, match="not a file"):
        open_video(tmp_path / "none.mp4", JPEG)


def test_a_playlist_that_calls_itself_a_video_opens_nothing(tmp_path: Path) -> None:
    write_video(tmp_path / "real.ts", "libx264", [0, 1, 2], Fraction(1, 25))
    path = tmp_path / "a.mp4"
    path.write_text(f"#EXTM3U\n#EXTINF:1,\n{tmp_path / 'real.ts'}\n#EXT-X-ENDLIST\n")
    with pytest.raises(DamagedError):
        open_video(path, JPEG)
    path.write_text(f"ffconcat version 1.0\nfile '{tmp_path / 'real.ts'}'\n")
    with pytest.raises(DamagedError):
        open_video(path, JPEG)


def test_cut_and_mutated_videos_raise_nothing_else(tmp_path: Path) -> None:
    source, path = tmp_path / "a.mp4", tmp_path / "b.mp4"
    write_video(source, "libx264", TIMES, Fraction(1, 1000))
    whole, rng = source.read_bytes(), np.random.default_rng(0)
    for trial in range(60):
        data = bytearray(whole)
        if trial % 3 == 0:
            del data[int(rng.integers(len(data))) :]
        for at in rng.integers(0, max(len(data), 1), 8):
            if at < len(data):
                data[at] = rng.integers(256)
        path.write_bytes(data)
        try:
            for picture in open_video(path, JPEG).pictures()[:20]:
                picture.encoded()
        except InputError as error:
            assert "b.mp4" in error.message


def test_without_pyav_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    (tmp_path / "a.mp4").write_bytes(b"x")
    with pytest.raises(MissingError, match="PyAV") as caught:
        open_video(tmp_path / "a.mp4", JPEG)
    assert "pip install 'scpf[video]'" in caught.value.hint
