"""Arrays out of files that nobody vouches for."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from scpf.models.errors import DamagedError
from scpf.models.npz import load_arrays


def npy(header: bytes) -> bytes:
    """An .npy file with that header and no data."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


def test_arrays_come_back(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", x=np.arange(3), y=np.eye(2))
    np.save(tmp_path / "b.npy", np.arange(4.0))
    arrays = load_arrays(tmp_path / "a.npz", 1 << 20)
    assert sorted(arrays) == ["x", "y"]
    np.testing.assert_array_equal(load_arrays(tmp_path / "b.npy", 1 << 20)[""], np.arange(4.0))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"nothing",
        npy(b"{'descr': '<f8', 'fortran_order': False, 'shape': (1152921504606846976,), }\n"),
        npy(b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,), '''\n"),
        npy(b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n"),
        npy(b"__import__('os')\n"),
    ],
)
def test_what_is_no_array_is_damaged(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "c.npy").write_bytes(data)
    with pytest.raises(DamagedError, match=r"c\.npy"):
        load_arrays(tmp_path / "c.npy", 1 << 20)


def test_a_small_file_that_unpacks_large_is_refused(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "d.npz", x=np.zeros(1 << 20))
    with pytest.raises(DamagedError, match="MiB"):
        load_arrays(tmp_path / "d.npz", 1 << 20)


@pytest.mark.parametrize(("place", "value"), [(6, 109), (8, 0x01), (8, 0x20), (8, 0x40)])
def test_an_archive_that_asks_for_more_than_zip_can_do_is_damaged(
    tmp_path: Path, place: int, value: int
) -> None:
    """A changed byte may claim a later version of zip, or encryption: zipfile has exceptions of its own for it."""
    np.savez(tmp_path / "e.npz", x=np.arange(3))
    data = bytearray((tmp_path / "e.npz").read_bytes())
    data[data.index(b"PK\x01\x02") + place] = value
    (tmp_path / "e.npz").write_bytes(data)
    with pytest.raises(DamagedError, match=r"e\.npz"):
        load_arrays(tmp_path / "e.npz", 1 << 20)
