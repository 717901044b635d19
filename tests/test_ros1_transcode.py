"""ROS 1 to CDR by copying: the bytes are those of rosbags, for types of all kinds."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scpf.ingest.ros1_transcode import transcoder

BASES = (
    "bool",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
    "float32",
    "float64",
    "string",
)
DTYPES = {"bool": np.bool_, "byte": np.int8, "char": np.uint8}


def random_types(rng: random.Random) -> tuple[Any, str]:
    """A store of three types, each made of bases, arrays, sequences and the types before it; the last one's name."""
    store = get_typestore(Stores.EMPTY)
    known = get_typestore(Stores.ROS2_HUMBLE).fielddefs
    names = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header")
    store.register({name: known[name] for name in names})
    inner = list(names)
    for k in range(3):
        lines = []
        for n in range(rng.randrange(1, 7)):
            kind = rng.choice([*BASES, *BASES, *inner])
            many = rng.choice(["", "", "", "[]", "[3]"]) if kind in BASES and kind != "string" else ""
            lines.append(f"{kind.replace('/msg/', '/')}{many} f{n}")
        store.register(get_types_from_msg("\n".join(lines), f"a/msg/T{k}"))
        inner.append(f"a/msg/T{k}")
    return store, "a/msg/T2"


def random_value(store: Any, desc: Any, rng: random.Random) -> Any:
    node, detail = int(desc[0]), desc[1]
    if node == 2:
        fields = store.fielddefs[detail][1]
        return store.types[detail](**{name: random_value(store, inner, rng) for name, inner in fields})
    if node == 1:
        if detail[0] == "string":
            return "é" * rng.randrange(9)
        return (
            rng.random()
            if "float" in detail[0]
            else bool(rng.randrange(2))
            if detail[0] == "bool"
            else rng.randrange(120)
        )
    count = detail[1] if node == 3 else rng.randrange(6)
    base = detail[0][1][0]
    return np.array([rng.randrange(2) for _ in range(count)], dtype=DTYPES.get(base, base))


@pytest.mark.parametrize("seed", range(60))
def test_the_bytes_are_those_of_rosbags(seed: int) -> None:
    rng = random.Random(seed)
    store, name = random_types(rng)
    convert = transcoder(store, name)
    assert convert is not None
    ros1 = get_typestore(Stores.EMPTY)
    noetic = get_typestore(Stores.ROS1_NOETIC).fielddefs["std_msgs/msg/Header"]
    ros1.register({**store.fielddefs, "std_msgs/msg/Header": noetic})
    for _ in range(5):
        message = random_value(ros1, (2, name), rng)
        raw = bytes(ros1.serialize_ros1(message, name))
        assert convert(raw) == convert(memoryview(raw)) == bytes(store.ros1_to_cdr(raw, name))
        for wrong in (raw[:-1], raw + b"\0", raw[: len(raw) // 2]):
            with pytest.raises(Exception, match=r"."):
                convert(wrong)


@pytest.mark.parametrize("text", ["string[] names", "std_msgs/Header[] headers", "std_msgs/Empty nothing"])
def test_other_types_are_left_to_rosbags(text: str) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(text, "a/msg/Odd"))
    assert transcoder(store, "a/msg/Odd") is None
