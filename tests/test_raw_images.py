"""Bayer dumps, TIFF and PGM: colours, depths and sizes as recorded."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from scpf.ingest.pictures import Encoding
from scpf.ingest.raw_images import (
    BAYER,
    PixelFile,
    RawDump,
    RawLayout,
    demosaic,
    parse_size,
    picture_size,
    read_pixels,
)
from scpf.models.errors import DamagedError, InputError, UsageError

PNG = Encoding("png")
WIDTH, HEIGHT = 32, 24


def smooth_picture() -> np.ndarray:
    """Blue, green, red (H, W, 3): gradients that any interpolation follows."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([40 + 2 * x, 200 - 3 * y, 30 + 2 * x + 2 * y], axis=2).astype(np.uint8)


def mosaic_of(bgr: np.ndarray, bayer: str) -> np.ndarray:
    """What a sensor with this pattern of colours sees."""
    mosaic = np.zeros(bgr.shape[:2], dtype=bgr.dtype)
    for place, colour in enumerate(bayer):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = bgr[row::2, column::2, "bgr".index(colour)]
    return mosaic


def decoded(data: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image


@pytest.mark.parametrize("bayer", BAYER)
@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_dumps_show_the_colours_of_the_scene(tmp_path: Path, bayer: str, bits: int) -> None:
    scene, path = smooth_picture(), tmp_path / "1.raw"
    mosaic = mosaic_of(scene, bayer)
    data = mosaic.tobytes() if bits == 8 else (mosaic.astype("<u2") << (bits - 8)).tobytes()
    path.write_bytes(data)
    picture = RawDump(path, WIDTH, HEIGHT, RawLayout(bayer, bits, (WIDTH, HEIGHT)), PNG)
    image = decoded(picture.encoded().data)
    assert image.dtype == np.uint8
    np.testing.assert_allclose(image[2:-2, 2:-2].astype(int), scene[2:-2, 2:-2], atol=3)


def test_a_grey_dump_is_stored_bit_by_bit(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)
    path = tmp_path / "1.bin"
    path.write_bytes(pixels.tobytes())
    picture = RawDump(path, WIDTH, HEIGHT, RawLayout(size_px=(WIDTH, HEIGHT)), PNG)
    np.testing.assert_array_equal(decoded(picture.encoded().data), pixels)
    jpeg = RawDump(path, WIDTH, HEIGHT, RawLayout(size_px=(WIDTH, HEIGHT)), Encoding("jpeg", 40)).encoded()
    assert jpeg.format == "jpeg" and jpeg.data[:2] == b"\xff\xd8"


@pytest.mark.parametrize(
    ("size", "bits", "hint"),
    [
        (WIDTH * HEIGHT * 3 // 2, 8, "12 bit packed"),
        (WIDTH * HEIGHT * 2, 8, "--raw-bits"),
        (WIDTH * HEIGHT - 1, 8, "file whole"),
        (0, 12, "file whole"),
    ],
)
def test_a_dump_of_another_size(tmp_path: Path, size: int, bits: int, hint: str) -> None:
    path = tmp_path / "1.raw"
    path.write_bytes(bytes(size))
    with pytest.raises(DamagedError, match=rf"1\.raw has {size} bytes") as caught:
        RawDump(path, WIDTH, HEIGHT, RawLayout(None, bits, (WIDTH, HEIGHT)), PNG).encoded()
    assert hint in caught.value.hint


def test_more_bits_than_said(tmp_path: Path) -> None:
    path = tmp_path / "1.raw"
    path.write_bytes(np.full((HEIGHT, WIDTH), 4096, "<u2").tobytes())
    with pytest.raises(InputError, match="4096, more than 12 bits"):
        RawDump(path, WIDTH, HEIGHT, RawLayout(None, 12, (WIDTH, HEIGHT)), PNG).encoded()


@pytest.mark.parametrize("name", ["1.tiff", "1.pgm", "1.png"])
@pytest.mark.parametrize("bayer", [None, "grbg"])
def test_files_with_a_header(tmp_path: Path, name: str, bayer: str | None) -> None:
    scene = smooth_picture()
    mosaic = mosaic_of(scene, bayer or "rggb")
    Image.fromarray(mosaic).save(tmp_path / name)
    assert picture_size(tmp_path / name) == (WIDTH, HEIGHT)
    image = decoded(PixelFile(tmp_path / name, WIDTH, HEIGHT, RawLayout(bayer), PNG).encoded().data)
    if bayer is None:
        np.testing.assert_array_equal(image, mosaic)
    else:
        np.testing.assert_allclose(image[2:-2, 2:-2].astype(int), scene[2:-2, 2:-2], atol=3)


@pytest.mark.parametrize("compression", [None, "tiff_lzw", "tiff_deflate", "packbits"])
def test_colour_tiff(tmp_path: Path, compression: str | None) -> None:
    scene = smooth_picture()
    Image.fromarray(scene[:, :, ::-1].copy()).save(tmp_path / "1.tif", compression=compression)
    np.testing.assert_array_equal(read_pixels(tmp_path / "1.tif"), scene)
    with pytest.raises(InputError, match="3 channels: no Bayer"):
        PixelFile(tmp_path / "1.tif", WIDTH, HEIGHT, RawLayout("rggb"), PNG).encoded()


@pytest.mark.parametrize("name", ["1.tiff", "1.png"])
@pytest.mark.parametrize("bits", [12, 16])
def test_deep_files_keep_their_significant_bits(tmp_path: Path, name: str, bits: int) -> None:
    grey = smooth_picture()[:, :, 0].astype(np.uint16) << (bits - 8)
    assert cv2.imwrite(str(tmp_path / name), grey)
    np.testing.assert_array_equal(read_pixels(tmp_path / name), grey)
    picture = PixelFile(tmp_path / name, WIDTH, HEIGHT, RawLayout(bits=bits), PNG)
    np.testing.assert_array_equal(decoded(picture.encoded().data), smooth_picture()[:, :, 0])


def test_demosaicing_agrees_with_opencv_s_own_alias() -> None:
    mosaic = np.random.default_rng(0).integers(0, 256, (16, 16)).astype(np.uint8)
    for bayer in BAYER:
        alias = getattr(cv2, f"COLOR_Bayer{bayer.upper()}2BGR_EA", None)
        if alias is not None:
            np.testing.assert_array_equal(demosaic(mosaic, bayer), cv2.cvtColor(mosaic, alias))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_files_that_are_no_picture(tmp_path: Path) -> None:
    path = tmp_path / "1.tiff"
    path.write_bytes(b"II*\0\x08\0\0\0")
    with pytest.raises(InputError, match=r"1\.tiff is not a readable picture"):
        picture_size(path)
    first, second = Image.new("L", (8, 8)), Image.new("L", (8, 8))
    first.save(path, save_all=True, append_images=[second])
    with pytest.raises(InputError, match="several pages"):
        picture_size(path)
    Image.new("F", (8, 8)).save(path)
    with pytest.raises(InputError, match="floating-point"):
        read_pixels(path)


def test_a_header_that_claims_a_huge_picture_costs_nothing(tmp_path: Path) -> None:
    path = tmp_path / "1.pgm"
    path.write_bytes(b"P5 100000 100000 255\n" + bytes(100))
    tracemalloc.start()
    with pytest.raises(InputError, match=r"1\.pgm"):
        read_pixels(path)
    path.write_bytes(b"P5 13000 10000 255\n" + bytes(100))
    with pytest.raises(InputError, match="130"), pytest.warns(Image.DecompressionBombWarning):
        read_pixels(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10_000_000


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_mutated_tiffs_raise_nothing_else(tmp_path: Path) -> None:
    path, rng = tmp_path / "1.tiff", np.random.default_rng(0)
    Image.fromarray(smooth_picture()).save(path, compression="tiff_lzw")
    whole = path.read_bytes()
    for _ in range(300):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), 4):
            data[at] = rng.integers(256)
        path.write_bytes(data[: int(rng.integers(1, len(data)))] if rng.random() < 0.3 else data)
        try:
            read_pixels(path)
        except InputError as error:
            assert "1.tiff" in error.message


def test_settings_that_make_no_sense() -> None:
    assert parse_size("2048x1536") == (2048, 1536)
    for text in ("2048", "0x5", "x", "-1x5", "99999x99999", "2048x1536x3"):
        with pytest.raises((UsageError, InputError)):
            parse_size(text)
    with pytest.raises(UsageError, match="mosaic"):
        RawLayout("rgbg")
    with pytest.raises(UsageError, match="9 bits"):
        RawLayout(bits=9)
    with pytest.raises(UsageError, match="quality of 0"):
        Encoding("jpeg", 0)
