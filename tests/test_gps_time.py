"""GPS time and UTC, against known instants and the standard library's calendar."""

from __future__ import annotations

from datetime import UTC, date, datetime

import numpy as np
import pytest

from scpf.ingest import gps_time
from scpf.models.errors import InputError


def _unix(text: str) -> int:
    return int(datetime.fromisoformat(text + "+00:00").timestamp())


def test_week_2000_began_on_6_may_2018() -> None:
    stamps = gps_time.stamps_of_week(2000, np.array([18.0]))
    assert stamps[0] == _unix("2018-05-06T00:00:00") * 10**9


@pytest.mark.parametrize(
    ("day", "leap"),
    [("1980-01-06", 0), ("1999-01-01", 13), ("2012-06-30", 15), ("2012-07-01", 16), ("2015-07-01", 17)],
)
def test_leap_seconds_of_the_table(day: str, leap: int) -> None:
    assert gps_time.leap_seconds(_unix(day + "T00:00:00")) == leap
    assert gps_time.leap_seconds(_unix("2026-01-01T00:00:00")) == 18


def test_a_leap_second_inside_a_log() -> None:
    # 2016-12-31T23:59:59Z is 17 s before GPS; the leap second, then 2017-01-01T00:00:00Z is 18 s before.
    before = _unix("2016-12-31T23:59:59") - gps_time.GPS_EPOCH_UNIX_S + 17
    stamps = gps_time.utc_ns(np.array([before, before + 2], dtype=np.int64) * 10**9)
    assert [int(stamp) // 10**9 for stamp in stamps] == [
        _unix("2016-12-31T23:59:59"),
        _unix("2017-01-01T00:00:00"),
    ]


def test_the_streams_leap_seconds_go_before_the_table() -> None:
    given, table = (gps_time.stamps_of_week(2000, np.array([100.0]), offset)[0] for offset in (15, None))
    assert given - table == 3 * 10**9


def test_a_week_ends_inside_a_log() -> None:
    stamps = gps_time.stamps_of_week(2000, np.array([604799.5, 604799.9, 0.3, 0.7]))
    np.testing.assert_allclose(np.diff(stamps) * 1e-9, [0.4, 0.4, 0.4], atol=1e-9)


def test_a_single_wrong_time_does_not_shift_those_after_it() -> None:
    stamps = gps_time.stamps_of_week(2000, np.array([10.0, 604000.0, 12.0]))
    assert stamps[2] - stamps[0] == 2 * 10**9


def test_values_that_are_no_time_of_week_have_no_stamp() -> None:
    stamps = gps_time.stamps_of_week(2000, np.array([np.nan, 1.0, np.inf, -1.0, 1e300, 2.0]))
    assert [int(stamp) > 0 for stamp in stamps] == [False, True, False, False, False, True]
    assert stamps[5] - stamps[1] == 10**9


def test_nanoseconds_are_kept() -> None:
    stamps = gps_time.stamps_of_week(2162, np.array([151631.0028361, 151631.0078319]))
    assert int(stamps[1] - stamps[0]) == 4_995_800


def test_the_week_on_a_day_also_where_utc_and_gps_disagree_about_it() -> None:
    assert gps_time.week_on(date(2012, 6, 25), 152103.0) == 1694
    # Saturday 2018-05-05, 23:59:50 UTC is already second 8 of week 2000.
    assert gps_time.week_on(date(2018, 5, 5), 8.0) == 2000


@pytest.mark.parametrize(("short", "full"), [(1137, 2161), (1023, 2047), (0, 2048), (5, 2053)])
def test_weeks_counted_modulo_1024(short: int, full: int) -> None:
    assert gps_time.full_week(short % 1024, 2100) == full


def test_a_full_week_stays() -> None:
    assert gps_time.full_week(1694, 2400) == 1694


def test_a_week_out_of_range_is_refused() -> None:
    with pytest.raises(InputError, match="not a GPS week"):
        gps_time.check_week(65535)


def test_unix_of_a_day() -> None:
    assert gps_time.unix_of(date(2021, 6, 15)) == int(datetime(2021, 6, 15, tzinfo=UTC).timestamp())
