"""``scpf map from``: one command for every source of a map."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from map_files import ORIGIN, a_ring_with_lamps, lon_lat

from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.maps import read_map
from scpf.models.errors import InputError, MissingError, UsageError
from scpf.models.geodesy import Origin
from scpf.replay.map_commands import map_from


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    path = tmp_path / "ring.osm"
    path.write_text(a_ring_with_lamps())
    return path


@pytest.fixture
def poles(tmp_path: Path) -> Path:
    path = tmp_path / "poles.csv"
    path.write_text("id,x,y,class\na,10,0,light_pole\nb,0,20,tree\nc,90,2,light_pole\n")
    return path


def a_log(folder: Path, origin: Origin | None = None, poses: int = 50) -> Path:
    """A log of a drive along East, a metre a pose, from the origin."""
    path = folder / "drive.mcap"
    with DriveLogWriter(path, origin=origin) as log:
        for k in range(poses):
            pose = np.eye(4)
            pose[0, 3] = k
            log.write_pose(k * 10**8, pose)
    return path


def test_a_road_of_osm(tmp_path: Path, ring: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "map.geojson"
    assert (
        map_from(ring, output=output, road="Ring Road") == 3
    )  # a branch and a lamp on a footway are left out
    text = capsys.readouterr().out
    for part in ("627 m, a closed ring, of 3 pieces (667 m in all)", "40 m, branch: way 13", "light_pole   2",
                 "1 tree (--class)", "1 × light_pole that is a vertex of a road", "© OpenStreetMap contributors",
                 "halfway along"):  # fmt: skip
        assert part in text
    assert text.splitlines()[-1] == f"{output}: 2 of 3 points, centre line of 25 points"
    road_map = read_map(output)
    assert [mark.id for mark in road_map.landmarks] == ["60", "62"]
    np.testing.assert_allclose(road_map.centre_line_m[0], road_map.centre_line_m[-1])


def test_the_report_as_json(tmp_path: Path, ring: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "map.geojson"
    code = map_from(
        ring, output=output, road="Ring Road", classes=["light_pole,tree"], within_m=5.5, landmark_sigma_m=0.5,
        origin=(43.47, -80.54, 0.0), half_width_m=3.5, format="json",
    )  # fmt: skip
    report = json.loads(capsys.readouterr().out)
    assert code == 3
    assert report["landmarks"] == {"light_pole": 1, "tree": 1}
    assert report["far"] == {"light_pole": 1}
    assert report["centre_line"]["off"]["branch"]["pieces"] == ["way 13"]
    assert (report["origin"], report["lossless"]) == ([43.47, -80.54, 0.0], False)
    road_map = read_map(output)
    assert {mark.variance_m2 for mark in road_map.landmarks} == {0.25}
    assert road_map.half_width_m == 3.5


def test_points_in_metres_and_a_log(tmp_path: Path, poles: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "map.geojson"
    log = a_log(tmp_path)
    assert map_from(poles, output=output, log=log, road_offset_m=1.75, within_m=15.0) == 0
    road_map = read_map(output)
    assert [mark.id for mark in road_map.landmarks] == ["a"]
    np.testing.assert_allclose(road_map.centre_line_m[:, 1], 1.75)
    assert "1 of 3 points" in capsys.readouterr().out
    assert (
        map_from(poles, output=output, rotate_deg=90.0, offset_m=(1.0, 2.0), select=["a,c"], overwrite=True)
        == 0
    )
    np.testing.assert_allclose(read_map(output).positions_m, [[1, 12], [-1, 92]], atol=1e-4)
    assert map_from(poles, output=output, exclude=["a"], classes=["light_pole"], overwrite=True) == 0
    assert [mark.id for mark in read_map(output).landmarks] == ["c"]


def test_an_array(tmp_path: Path) -> None:
    path, output = tmp_path / "poles.npz", tmp_path / "map.geojson"
    np.savez(path, poles=np.array([[1.0, 2.0], [3.0, 4.0]]), trees=np.array([[5.0, 6.0]]))
    assert map_from(path, output=output, key="trees", attribution="© someone") == 0
    road_map = read_map(output)
    assert (road_map.positions_m.tolist(), road_map.attribution) == ([[5.0, 6.0]], "© someone")


def test_a_log_with_an_origin_gives_the_road_of_a_map_in_degrees(tmp_path: Path, ring: Path) -> None:
    output = tmp_path / "map.geojson"
    assert map_from(ring, output=output, log=a_log(tmp_path, ORIGIN, 140)) == 3
    road_map = read_map(output)
    assert road_map.origin == ORIGIN
    np.testing.assert_allclose(road_map.positions_m, [[105.0, 5.0], [135.0, 8.0]], atol=0.02)
    np.testing.assert_allclose(road_map.centre_line_m[-1], [139.0, 0.0], atol=1e-3)


def test_options_that_would_do_nothing_are_refused(tmp_path: Path, ring: Path, poles: Path) -> None:
    output, log = tmp_path / "map.geojson", a_log(tmp_path)
    degrees = tmp_path / "degrees.csv"
    degrees.write_text(
        "id,lon,lat\n" + "".join(f"{k},{x},{y}\n" for k, (x, y) in enumerate(lon_lat([(1, 2)])))
    )
    for kind, source, options, what in [
        (UsageError, ring, {"road": "Ring Road", "log": log}, "both"),
        (UsageError, ring, {"road": "Ring Road", "rotate_deg": 1.0}, "in metres"),
        (MissingError, ring, {"log": log}, "no origin"),
        (UsageError, ring, {}, "2 named roads"),
        (UsageError, poles, {"origin": (1.0, 2.0, 3.0)}, "in degrees"),
        (UsageError, poles, {"within_m": 3.0}, "needs a road"),
        (UsageError, degrees, {"within_m": 3.0}, "needs a road"),
        (MissingError, poles, {"road": "Ring Road"}, "no road named"),
        (UsageError, poles, {"key": "a"}, "npz"),
        (UsageError, ring, {"road": "Ring Road", "origin": (-80.0, 181.0, 0.0)}, "latitude comes first"),
        (UsageError, ring, {"road": "Ring Road", "within_m": -1.0}, "not negative"),
        (UsageError, ring, {"road": "Ring Road", "max_gap_m": float("nan")}, "finite"),
        (InputError, tmp_path / "none.osm", {}, "cannot be read"),
    ]:
        with pytest.raises(kind, match=what):
            map_from(source, output=output, **options)  # type: ignore[arg-type]
        assert not output.exists()


def test_an_output_that_exists_is_kept(tmp_path: Path, ring: Path) -> None:
    output = tmp_path / "map.geojson"
    output.write_text("mine")
    with pytest.raises(InputError, match="exists"):
        map_from(ring, output=output, road="Ring Road")
    assert output.read_text() == "mine"


def test_the_campus_of_waterloo(
    tmp_path: Path, shared_data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "map.geojson"
    assert map_from(shared_data / "waterloo" / "uw.osm", output=output, road="Ring Road") == 3
    text = capsys.readouterr().out
    assert "2632 m, a closed ring, of 10 pieces (2756 m in all)" in text
    assert "123 m, branch: way 42685771, way 42685772" in text
    assert len(read_map(output).landmarks) == 29


def test_the_poles_of_kitti_06(tmp_path: Path, shared_data: Path) -> None:
    output = tmp_path / "map.geojson"
    poles = shared_data / "kitti_06" / "poles.npz"
    assert map_from(poles, output=output, rotate_deg=0.8, select=["0,2", "25"]) == 0
    assert [mark.id for mark in read_map(output).landmarks] == ["0", "2", "25"]
