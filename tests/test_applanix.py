"""The table of formats, recognition by content, and thousands of damaged files of each format."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from applanix_encoders import (
    drive,
    grp,
    grp_1,
    grp_2,
    grp_3,
    grp_head,
    gsof,
    gsof_16,
    gsof_49,
    gsof_50,
    gsof_packets,
    gsof_record,
    pos_message,
    sbet,
    smrmsg,
)
from mutations import mutated
from navigation_text_encoders import boreas, nmea, nmea_bodies, nmea_sentence, pospac
from packet_encoders import ethernet, ipv4, pcap, pcapng, tcp, udp

from scpf.ingest import applanix
from scpf.ingest.read_report import ReadOptions
from scpf.models.errors import InputError, MissingError, ScpfError, UsageError
from scpf.models.geodesy import Origin

INPUTS = 2_000
"""Damaged files of each format; half as many for each kind of capture."""
OPTIONS = ReadOptions(date=date(2021, 6, 15), utm_zone="17N", sensor="body")
ORIGIN = Origin(43.4723, -80.5449, 300.0)
D = drive(12)


def _boreas() -> bytes:
    stamps = [round(unix * 1e6) for unix in D.unix_s]
    zero = np.zeros((12, 3))
    return boreas(stamps, 5e5 + np.arange(12.0), 4.8e6 + np.arange(12.0), zero, zero)


def _tcp_capture(data: bytes) -> bytes:
    parts = [(k, data[k : k + 300]) for k in range(0, len(data), 300)]
    return pcap([(D.unix_s[0], ethernet(ipv4(6, tcp(number, part)))) for number, part in parts])


def _udp_capture(data: bytes, writer: Callable[..., bytes] = pcap) -> bytes:
    parts = [data[k : k + 300] for k in range(0, len(data), 300)]
    return writer([(D.unix_s[0], ethernet(ipv4(17, udp(part)))) for part in parts])


WHOLE: dict[str, tuple[str, bytes]] = {
    "sbet": ("sbet", sbet(D)),
    "smrmsg": ("smrmsg", smrmsg(D, every=1)),
    "gsof": ("gsof", gsof(D, 100)),
    "grp": ("grp", grp(D)),
    "nmea": ("nmea", nmea(D)),
    "pospac": ("pospac", pospac(D)),
    "boreas": ("boreas", _boreas()),
    "pcap_tcp": ("gsof", _tcp_capture(gsof(D))),
    "pcap_udp": ("grp", _udp_capture(grp(D))),
    "pcapng": ("nmea", _udp_capture(nmea(D), pcapng)),
}


@pytest.mark.parametrize("case", WHOLE)
def test_every_format_is_recognised_by_its_content(tmp_path: Path, case: str) -> None:
    name, data = WHOLE[case]
    (tmp_path / "log").write_bytes(data)
    recognised = applanix.recognise(tmp_path / "log")
    assert recognised.name == name
    assert recognised.why
    assert recognised.why.startswith("network capture") == case.startswith("pcap")


@pytest.mark.parametrize("case", [case for case in WHOLE if case != "smrmsg"])
def test_every_format_is_read_and_says_why(tmp_path: Path, case: str) -> None:
    name, data = WHOLE[case]
    (tmp_path / "log").write_bytes(data)
    navigation = applanix.read(tmp_path / "log", OPTIONS)
    assert len(navigation) == 12
    assert navigation.report.format == name
    assert navigation.report.notes[0].startswith(f"{name}: ")
    assert navigation.report.lossless
    assert navigation.native
    np.testing.assert_allclose(navigation.stamps_ns * 1e-9, D.unix_s, atol=1e-6)
    assert len(navigation.to_trajectory(ORIGIN)) == 12


def test_real_files_are_recognised(shared_data: Path) -> None:
    names = {
        "applanix/sbet.out": "sbet",
        "applanix/2-points.sbet": "sbet",
        "applanix/badfile.sbet": "sbet",
        "applanix/smrmsg_first_half.out": "smrmsg",
        "applanix/poslv_grp_first40s.pcap": "grp",
        "boreas/boreas-2021-08-05-13-34/applanix/camera_poses.csv": "boreas",
    }
    assert {name: applanix.recognise(shared_data / name).name for name in names} == names


def test_other_real_files_are_not(shared_data: Path) -> None:
    folders = ("bags", "camvid", "kitti_raw_0002", "labelme", "waterloo")
    others = sorted(
        path for folder in folders for path in (shared_data / folder).rglob("*") if path.is_file()
    )
    assert others
    for path in others[:: max(len(others) // 60, 1)]:
        with pytest.raises(InputError):
            applanix.recognise(path)


@pytest.mark.parametrize("data", [b"", b"\0" * 1000, b"\0" * 1360, b"hello\n" * 100, bytes(range(256)) * 20])
def test_other_bytes_are_not(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "log").write_bytes(data)
    with pytest.raises(InputError) as caught:
        applanix.recognise(tmp_path / "log")
    assert caught.value.hint


def test_a_capture_of_something_else_names_its_flows(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(_udp_capture(b"something else"))
    with pytest.raises(InputError, match=r"without a known stream .*UDP 192.168.2.3:4000"):
        applanix.recognise(tmp_path / "log")
    with pytest.raises(InputError, match="no flow of the capture carries gsof"):
        applanix.read(tmp_path / "log", OPTIONS, format="gsof")


@pytest.mark.parametrize("case", ["pospac", "boreas"])
def test_texts_of_other_systems(tmp_path: Path, case: str) -> None:
    """A byte order mark, and lines that end in two characters."""
    (tmp_path / "log").write_bytes(b"\xef\xbb\xbf" + WHOLE[case][1].replace(b"\n", b"\r\n"))
    assert len(applanix.read(tmp_path / "log", OPTIONS)) == 12


def test_times_that_are_utc_already(tmp_path: Path) -> None:
    (tmp_path / "log").write_bytes(sbet(D))
    options = ReadOptions(week=D.week(0), leap_seconds=0)
    late = applanix.read(tmp_path / "log", options).stamps_ns * 1e-9 - D.unix_s
    np.testing.assert_allclose(late, 18.0, atol=1e-6)


def test_a_format_that_is_not_in_the_table(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="'rtk' is not a log format"):
        applanix.read(tmp_path / "log", format="rtk")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    for name in applanix.FORMATS:
        with pytest.raises(InputError, match="cannot be read"):
            applanix.read(tmp_path / "absent", OPTIONS, format=name)


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    for name in applanix.FORMATS:
        with pytest.raises(InputError):
            applanix.read(tmp_path, OPTIONS, format=name)


@pytest.mark.parametrize("name", applanix.FORMATS)
def test_the_table_points_at_functions(name: str) -> None:
    for place in applanix.FORMATS[name][:2]:
        module, function = place.split(":")
        assert callable(getattr(importlib.import_module(module), function))


# Damaged files. Where a format has checksums, half of the inputs are damaged inside the messages, under checksums
# that are right: what has none to protect it must be as safe.

E = drive(2)


def _damaged_gsof(rng: np.random.Generator) -> bytes:
    out = b""
    for k in range(2):
        records = [
            gsof_record(16, gsof_16(E, k)),
            gsof_record(49, gsof_49(E, k)),
            gsof_record(50, gsof_50(E, k)),
        ]
        hit = int(rng.integers(0, 3))
        records[hit] = mutated(records[hit], rng)
        out += b"".join(gsof_packets(b"".join(records), k, 100))
    return out


def _damaged_grp(rng: np.random.Generator) -> bytes:
    out = b""
    for k in range(2):
        bodies = {1: grp_1(E, k), 2: grp_2(), 3: grp_3(E.week(k), 18.0)}
        hit = int(rng.integers(1, 4))
        contents = {number: grp_head(E, k) + body for number, body in bodies.items()}
        contents[hit] = mutated(contents[hit], rng)[:60_000]
        out += b"".join(pos_message(b"$GRP", number, content) for number, content in contents.items())
    return out


def _damaged_nmea(rng: np.random.Generator) -> bytes:
    bodies = nmea_bodies(E)
    hit = int(rng.integers(0, len(bodies)))
    bodies[hit] = mutated(bodies[hit].encode(), rng).decode("latin-1").replace("*", "").replace("$", "")
    return b"".join(nmea_sentence(body) for body in bodies)


INSIDE = {"gsof": _damaged_gsof, "grp": _damaged_grp, "nmea": _damaged_nmea}
SMALL: dict[str, tuple[str, bytes]] = {
    "sbet": ("sbet", sbet(E)),
    "smrmsg": ("sbet", smrmsg(E, every=1)),
    "gsof": ("gsof", gsof(E, 100)),
    "grp": ("grp", grp(E)),
    "nmea": ("nmea", nmea(E)),
    "pospac": ("pospac", pospac(E)),
    "boreas": ("boreas", b"\n".join(_boreas().split(b"\n")[:4])),
    "pcap_tcp": ("gsof", _tcp_capture(gsof(E))),
    "pcap_udp": ("grp", _udp_capture(grp(E))),
    "pcapng": ("nmea", _udp_capture(nmea(E), pcapng)),
}


@pytest.mark.parametrize("case", SMALL)
def test_damaged_files_raise_nothing_but_our_errors(tmp_path: Path, case: str) -> None:
    rng = np.random.default_rng(list(case.encode()))
    name, whole = SMALL[case]
    path = tmp_path / "log"
    options = OPTIONS
    if case == "smrmsg":  # the damage is in the accuracies of an SBET that is whole
        (tmp_path / "sbet").write_bytes(sbet(E))
        options = ReadOptions(date=OPTIONS.date, smrmsg=path)
    read = refused = 0
    inputs = INPUTS // 2 if case.startswith("pcap") else INPUTS
    for k in range(inputs):
        data = INSIDE[case](rng) if case in INSIDE and k % 2 else mutated(whole, rng)
        path.write_bytes(data)
        try:
            if k % 4 == 0:
                applanix.recognise(path)
            navigation = applanix.read(tmp_path / "sbet" if case == "smrmsg" else path, options, format=name)
            if k % 5 < 2:  # the same for every format, hence a part is enough
                trajectory = navigation.to_trajectory(ORIGIN)
                assert np.isfinite(trajectory.positions_m).all()
                assert np.isfinite(trajectory.quaternions_xyzw).all()
        except ScpfError as error:
            assert str(tmp_path) in error.message or isinstance(error, MissingError), error.message
            refused += 1
            continue
        read += 1
        assert navigation.report.skipped_bytes <= 2 * len(data)
    assert read + refused == inputs
    assert read > inputs // 50, "the damage is so coarse that nothing is left to test"


def test_damage_warns_of_nothing_by_the_way(tmp_path: Path) -> None:
    """Numbers that no one sends are counted in the report, not shouted about by the libraries."""
    rng = np.random.default_rng(7)
    path = tmp_path / "log"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name, whole in SMALL.values():
            for _ in range(40):
                path.write_bytes(mutated(whole, rng))
                try:
                    applanix.read(path, OPTIONS, format=name)
                except ScpfError:
                    continue
