"""What file names say: order, counters, stamps, and when a recording began."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scpf.ingest.image_names import begin_in_name, counters, natural_order, stamp_in_name

BASLER = "Basler_acA2040-55uc__23734412__20220818_183353703_"
T0 = 1_660_847_613_703_000_001


@pytest.mark.parametrize(
    ("stem", "stamp_ns"),
    [
        ("1660847613703000001", T0),
        ("frame_1660847613703000001", T0),
        ("1660847613.703000001", T0),
        ("1660847613_703000001", T0),
        ("left-1660847613-703000001", T0),
        ("1660847613.5", 1_660_847_613_500_000_000),
        ("1660847613703000", 1_660_847_613_703_000_000),
        ("1660847613703", 1_660_847_613_703_000_000),
        ("12.500000000", 12_500_000_000),
        ("000012", None),
        ("1660847613703000001_1660847613703000002", None),
        (BASLER + "0001", None),
        ("", None),
        ("²", None),
    ],
)
def test_stamps_in_names(stem: str, stamp_ns: int | None) -> None:
    assert stamp_in_name(stem) == stamp_ns


def test_basler_names_hold_the_beginning() -> None:
    assert begin_in_name(BASLER + "0001") == 1_660_847_633_703_000_000  # 2022-08-18 18:33:53.703
    assert begin_in_name("image_0001") is None
    assert begin_in_name("20221318_183353703") is None


@pytest.mark.parametrize("padded", [True, False])
def test_counters_and_their_gaps(padded: bool) -> None:
    numbers = [1, 2, 3, 5, 6, 10, 11, 110]
    names = [BASLER + (f"{number:04d}" if padded else str(number)) for number in numbers]
    assert sorted(names, key=lambda stem: natural_order(stem + ".tiff")) == names
    found = counters(names)
    assert found is not None
    assert (found.numbers, found.stride) == (numbers, 1)
    assert found.gaps == [(3, 5, 1), (6, 10, 3), (11, 110, 98)]
    assert found.missing == 102
    assert found.positions() == [number - 1 for number in numbers]


def test_every_tenth_frame_is_no_gap() -> None:
    found = counters([f"frame{k:06d}" for k in (100, 110, 120, 140)])
    assert found is not None
    assert (found.stride, found.missing, found.gaps) == (10, 1, [(120, 140, 1)])
    irregular = counters(["a7", "a10", "a14"])
    assert irregular is not None and (irregular.stride, irregular.missing) == (1, 5)


@pytest.mark.parametrize(
    "stems",
    [
        ["1"],
        ["a", "b"],
        ["a1", "b2"],
        ["1_1", "2_2"],
        ["1a", "2b"],
        ["1660847613703000001", "1660847613803000001"],
    ],
)
def test_names_without_counters(stems: list[str]) -> None:
    assert counters(stems) is None


@given(st.lists(st.text(max_size=20), max_size=5))
def test_any_names_can_be_read(stems: list[str]) -> None:
    sorted(stems, key=natural_order)
    counters(stems)
    for stem in stems:
        stamp_in_name(stem)
        begin_in_name(stem)


def test_the_counter_may_stand_before_an_ending() -> None:
    found = counters([f"{k}_left" for k in (1, 2, 4)])
    assert found is not None and found.missing == 1
