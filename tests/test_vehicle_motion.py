"""The simulated bus: the road that it drives by default, and how it moves."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scpf.ingest.maps import encode_map, read_map
from scpf.models.errors import MissingError
from scpf.models.road_map import RoadMap
from scpf.replay.cli import run
from scpf.sample_logs.ring_road import PATH, centre_line_of, default_centre_line, default_road_map


def test_the_ring_road_is_what_the_map_command_makes_of_openstreetmap(
    shared_data: Path, tmp_path: Path
) -> None:
    made = tmp_path / "ring.geojson"
    source = str(shared_data / "waterloo" / "uw.osm")
    origin = ["43.4729699", "-80.548017", "300"]
    done = run(["map", "from", source, "-o", str(made), "--road", "Ring Road", "--origin", *origin])
    assert done == 3  # two lanes lead off the ring, and are left out
    assert made.read_bytes() == PATH.read_bytes()


def test_the_ring_road_names_its_source_and_is_a_ring_of_its_length() -> None:
    road_map, line = default_road_map(), default_centre_line()
    assert road_map.attribution == "© OpenStreetMap contributors, ODbL 1.0"
    assert encode_map(read_map(PATH)) == PATH.read_bytes()
    assert line.closed
    # Chords cut no more than 0.1 %: 2,632 m are the polygon's.
    assert line.length_m == pytest.approx(2632.0, rel=1.5e-3)
    assert np.max(line.distance_m(road_map.centre_line_m)) < 1.0
    assert 1 / np.max(np.abs(line.curvature_per_m(np.arange(0, line.length_m)))) > 30.0


def test_an_open_road_stays_open_and_a_map_without_a_road_is_refused() -> None:
    points = np.column_stack([np.linspace(0.0, 200.0, 9), np.zeros(9)])
    assert not centre_line_of(RoadMap((), points)).closed
    with pytest.raises(MissingError, match="no centre line"):
        centre_line_of(RoadMap((), np.zeros((0, 2))))
