"""Navigation as messages of the drive log."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from applanix_encoders import drive, gsof, sbet
from navigation_text_encoders import nmea

from scpf.ingest import applanix, messages
from scpf.ingest.navigation import Navigation
from scpf.ingest.navigation_messages import (
    native_message,
    native_records,
    standard_messages,
)
from scpf.ingest.read_report import ReadOptions

D = drive(3)


def _read(tmp_path: Path, data: bytes) -> Navigation:
    (tmp_path / "log").write_bytes(data)
    return applanix.read(tmp_path / "log", ReadOptions(date=date(2021, 6, 15)))


def _first(tmp_path: Path, data: bytes) -> dict[str, Any]:
    navigation = _read(tmp_path, data)
    outgoing = list(standard_messages(navigation, navigation.origin()))
    assert all(messages.serialize(item.message, item.typename) for item in outgoing)
    assert [item.stamp_ns for item in outgoing] == sorted(item.stamp_ns for item in outgoing)
    return {item.topic: item.message for item in reversed(outgoing)}


def test_a_row_becomes_the_standard_topics(tmp_path: Path) -> None:
    found = _first(tmp_path, gsof(D))
    assert sorted(found) == ["/ins/fix", "/ins/imu", "/ins/odometry", "/ins/pose"]
    assert found["/ins/fix"].latitude == D.latitude[0]
    np.testing.assert_allclose(
        np.diag(found["/ins/fix"].position_covariance.reshape(3, 3)) ** 0.5, [0.02, 0.01, 0.03]
    )


def test_the_twist_is_in_the_body(tmp_path: Path) -> None:
    """10 m/s towards where the body looks; it rolls to the right and pitches a little: nearly all is forward."""
    odometry = _first(tmp_path, gsof(D))["/ins/odometry"]
    linear, angular = odometry.twist.twist.linear, odometry.twist.twist.angular
    assert linear.x == pytest.approx(10.0, abs=0.01)
    assert abs(linear.y) < 0.1
    rates = np.degrees([angular.x, angular.y, angular.z])
    np.testing.assert_allclose(rates, [1.0, -2.0, -3.0], rtol=1e-6)  # y left, z up
    covariance = odometry.pose.covariance.reshape(6, 6)
    np.testing.assert_allclose(np.diag(covariance)[:3] ** 0.5, [0.02, 0.01, 0.03], rtol=1e-6)
    assert np.degrees(covariance[5, 5] ** 0.5) == pytest.approx(0.05, rel=1e-3)


def test_the_imu_feels_gravity(tmp_path: Path) -> None:
    imu = _first(tmp_path, gsof(D))["/ins/imu"]
    force = imu.linear_acceleration
    # 0.1, 0.2, 0.3 forward, right, down; 0.5° of roll and −0.25° of pitch turn some gravity to the side.
    assert force.z == pytest.approx(9.80665 - 0.3, abs=1e-3)
    assert force.x == pytest.approx(0.1 + 9.80665 * np.sin(np.radians(-0.25)), abs=1e-3)
    assert force.y == pytest.approx(-0.2 + 9.80665 * np.sin(np.radians(0.5)), abs=1e-3)


def test_what_a_format_has_not_is_not_made_up(tmp_path: Path) -> None:
    found = _first(tmp_path, nmea(D))
    assert sorted(found) == ["/ins/fix", "/ins/odometry", "/ins/pose"]
    assert found["/ins/fix"].position_covariance_type == 0
    assert not np.any(found["/ins/odometry"].twist.covariance)


def test_native_records_are_whole_and_in_order(tmp_path: Path) -> None:
    data = sbet(D)
    records = list(native_records(_read(tmp_path, data)))
    assert b"".join(record.values.astype("<f8").tobytes() for record in records) == data
    assert records[0].names[0] == "time"
    assert records[0].units[1] == "rad"
    kinds = [record.kind for record in native_records(_read(tmp_path, gsof(D)))]
    assert sorted(kinds[:3]) == ["gsof_16", "gsof_49", "gsof_50"]
    text = "".join(record.text + "\r\n" for record in native_records(_read(tmp_path, nmea(D))))
    assert text.encode() == nmea(D)


def test_native_records_as_messages(tmp_path: Path) -> None:
    for data in (gsof(D), nmea(D)):
        for record in native_records(_read(tmp_path, data)):
            item = native_message(record)
            raw = messages.serialize(item.message, item.typename)
            back = messages.typestore().deserialize_cdr(bytes(raw), item.typename)
            assert (back.record, list(back.names), back.text) == (record.kind, record.names, record.text)
            np.testing.assert_array_equal(back.values, record.values)
