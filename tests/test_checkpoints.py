"""Weights files of others: tensors come out, code does not run, damage is named in one line."""

from __future__ import annotations

import argparse
import io
import os
import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.torch import save_file

from scpf.models.checkpoints import read_tensors
from scpf.models.errors import DamagedError, InputError, MissingError, ScpfError

WEIGHT = np.arange(6, dtype=np.float32).reshape(2, 3)


class _Harmful:
    """Pickled, it is a call of a function that leaves a file behind."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {self.path}",)


def write_pkl(path: Path, content: object, protocol: int = 2) -> Path:
    path.write_bytes(pickle.dumps(content, protocol))
    return path


def refused(path: Path) -> ScpfError:
    """What is said about a file that is not read: one line."""
    with pytest.raises(ScpfError) as caught:
        read_tensors(path)
    assert "\n" not in caught.value.message
    assert caught.value.message.startswith(str(path))
    return caught.value


@pytest.mark.parametrize("container", ["", "model", "state_dict"])
def test_torch_files(tmp_path: Path, container: str) -> None:
    state = OrderedDict(a=torch.from_numpy(WEIGHT), b=torch.tensor(3))
    content: Any = {container: state, "optimizer": {"lr": 0.1}, "iteration": 9} if container else state
    for new in (True, False):
        path = tmp_path / f"{new}.pth"
        torch.save(content, path, _use_new_zipfile_serialization=new)
        found = read_tensors(path)
        assert found.keys() == {"a", "b"}
        np.testing.assert_array_equal(found["a"], WEIGHT)


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("kind", ["<f4", ">f4", "<f2", "<f8", "<i8"])
def test_pickles_of_arrays(tmp_path: Path, protocol: int, order: Any, kind: str) -> None:
    array = np.asarray(WEIGHT.astype(kind), order=order)
    content = {
        "model": OrderedDict(a=array, lr=np.float32(0.5)), "__author__": "Detectron2 Model Zoo",
    }  # fmt: skip
    found = read_tensors(write_pkl(tmp_path / "a.pkl", content, protocol))
    assert found.keys() == {"a"}
    np.testing.assert_array_equal(found["a"], WEIGHT)


def test_pickles_that_python_2_wrote(tmp_path: Path) -> None:
    """Their bytes are strings, and their numpy had its functions elsewhere."""
    text = pickle.dumps({"a": WEIGHT}, 2).replace(b"numpy._core.multiarray", b"numpy.core.multiarray")
    path = tmp_path / "a.pkl"
    path.write_bytes(text)
    np.testing.assert_array_equal(read_tensors(path)["a"], WEIGHT)
    raw = WEIGHT.tobytes()
    path.write_bytes(
        b"\x80\x02}U\x01acnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R"
        b"(K\x01K\x02K\x03\x86cnumpy\ndtype\nU\x02f4K\x00K\x01\x87R(K\x03U\x01<NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
        b"\x89U" + bytes([len(raw)]) + raw + b"tbs."
    )
    np.testing.assert_array_equal(read_tensors(path)["a"], WEIGHT)


def test_safetensors(tmp_path: Path) -> None:
    save_file({"a": torch.from_numpy(WEIGHT)}, tmp_path / "a.safetensors")
    np.testing.assert_array_equal(read_tensors(tmp_path / "a.safetensors")["a"], WEIGHT)


def test_code_is_named_and_not_run(tmp_path: Path) -> None:
    left = tmp_path / "left"
    harmful = {"a": torch.zeros(1), "b": _Harmful(left)}
    torch.save(harmful, tmp_path / "new.pth")
    torch.save(harmful, tmp_path / "old.pth", _use_new_zipfile_serialization=False)
    write_pkl(tmp_path / "bare.pth", harmful["b"])
    write_pkl(tmp_path / "a.pkl", {"a": WEIGHT, "b": _Harmful(left)})
    for name in ("new.pth", "old.pth", "bare.pth", "a.pkl"):
        error = refused(tmp_path / name)
        assert "posix.system" in error.message and "nothing was run" in error.message
        assert not isinstance(error, DamagedError)
    assert not left.exists()


def test_whole_models_and_options_are_code_too(tmp_path: Path) -> None:
    torch.save(torch.nn.Linear(2, 3), tmp_path / "a.pth")
    error = refused(tmp_path / "a.pth")
    assert "torch.nn.modules.linear.Linear" in error.message and "state_dict" in error.hint
    torch.save({"model": {"a": torch.zeros(1)}, "args": argparse.Namespace(lr=1)}, tmp_path / "b.pth")
    assert "argparse.Namespace" in refused(tmp_path / "b.pth").message


OBJECTS = np.array([{"a": 1}, None], dtype=object)
STRUCTURED = np.zeros(2, dtype=[("x", "<f4"), ("y", "O")])


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ({"a": OBJECTS}, "values of type 'O8'"),
        ({"a": STRUCTURED}, "values of type 'V12'"),
        ({"a": np.array(["text"])}, "values of type 'U4'"),
        ({"a": np.ma.masked_array([1.0], [True])}, "numpy.ma"),
        ({"a": pytest.approx(1.0)}, "approx"),
        ({"a": eval}, "builtins.eval"),
        ([WEIGHT], "holds a list"),
        ({"a": 1.0, 5: WEIGHT}, "no named tensors"),
        ({}, "no named tensors"),
    ],
)
def test_what_is_not_an_array_of_numbers_is_refused(tmp_path: Path, content: object, reason: str) -> None:
    for protocol in (2, 4):
        error = refused(write_pkl(tmp_path / "a.pkl", content, protocol))
        assert reason in error.message or (protocol == 2 and "__builtin__.eval" in error.message)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"cnumpy\nndarray\n(I100000000000\ntR.", "without its bytes"),
        (b"cnumpy.core.multiarray\n_reconstruct\n(clist\nI0\nS'b'\ntR.", "list"),
        (b"\x80\x02P1\n.", "another file"),
        (b"S'pid'\nQ.", "another file"),
        (b"\x80\x02\x82\x01.", "extension"),
        (b"c_codecs\nencode\n(S'a'\nS'rot13'\ntR.", "another encoding"),
        (b"\x80\x04\x8e\xff\xff\xff\xff\xff\xff\xff\x3f", "not a whole pickle"),
        (b"\x80\x05\x96\x00\x00\x00\x00\x10\x00\x00\x00.", "not a whole pickle"),
        (b"\x80\x04r\xff\xff\xff\xff.", "not a whole pickle"),
        (b"", "not a whole pickle"),
        (b"GIF89a", "not a whole pickle"),
    ],
)
def test_hand_made_pickles_are_refused(tmp_path: Path, text: bytes, reason: str) -> None:
    path = tmp_path / "a.pkl"
    path.write_bytes(text)
    assert reason in refused(path).message


def test_sizes_are_those_of_the_file(tmp_path: Path) -> None:
    """Neither a packed archive nor a view that repeats its bytes makes much of little."""
    torch.save({"a": torch.zeros(1000)}, tmp_path / "a.pth")
    with zipfile.ZipFile(tmp_path / "a.pth") as plain:
        members = {name: plain.read(name) for name in plain.namelist()}
    with zipfile.ZipFile(tmp_path / "b.pth", "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in members.items():
            packed.writestr(name, content)
    assert "compressed" in refused(tmp_path / "b.pth").message
    torch.save({"a": torch.zeros(1).expand(10**12)}, tmp_path / "c.pth")
    assert "larger than its bytes" in refused(tmp_path / "c.pth").message


def test_missing_files(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match="no such weights file"):
        read_tensors(tmp_path / "none.pth")


def pth(content: object) -> bytes:
    buffer = io.BytesIO()
    torch.save(content, buffer)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("suffix", "whole"),
    [
        (".pth", pth({"a": torch.from_numpy(WEIGHT)})),
        (".pkl", pickle.dumps({"model": {"a": WEIGHT}, "__author__": "x"}, 2)),
    ],
)
@given(data=st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_never_ends_in_anything_but_a_reason(
    tmp_path: Path, suffix: str, whole: bytes, data: st.DataObject
) -> None:
    damage: Callable[[bytes], bytes] = data.draw(
        st.one_of(
            st.integers(0, len(whole) - 1).map(lambda end: lambda text: text[:end]),
            st.tuples(st.integers(0, len(whole) - 1), st.integers(1, 255)).map(
                lambda flip: (
                    lambda text: text[: flip[0]] + bytes([text[flip[0]] ^ flip[1]]) + text[flip[0] + 1 :]
                )
            ),
        )
    )
    path = tmp_path / f"a{suffix}"
    path.write_bytes(damage(whole))
    try:
        found = read_tensors(path)
    except InputError as error:
        assert "\n" not in error.message
    else:
        assert all(isinstance(value, torch.Tensor) for value in found.values())
