"""KML: Placemarks as landmarks and lines."""

from __future__ import annotations

from pathlib import Path

import pytest

from scpf.ingest.kml import read_kml
from scpf.models.errors import DamagedError, InputError

DOCUMENT = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Document>
<name>Survey</name><Folder><name>Poles</name>
<Placemark id="p1"><name>Lamp 1</name><Point><coordinates>-80.54,43.47,330</coordinates></Point></Placemark>
<Placemark><name><![CDATA[Lamp & 2]]></name><ExtendedData><Data name="class"><value>tree</value></Data></ExtendedData>
  <MultiGeometry><Point><coordinates> -80.541 , 43.471 </coordinates></Point></MultiGeometry></Placemark>
</Folder>
<Placemark><name>Ring  Road</name><LineString><coordinates>
  -80.54,43.47,0 -80.541,43.47,0
  -80.542,43.471
</coordinates></LineString></Placemark>
<Placemark><name>Other</name><LineString><coordinates>-80.5,43.4 -80.51,43.4</coordinates></LineString></Placemark>
<Placemark><name>Park</name><Polygon><outerBoundaryIs><LinearRing><coordinates>0,0 1,1 1,0 0,0</coordinates>
  </LinearRing></outerBoundaryIs></Polygon></Placemark>
<Placemark><gx:Track><gx:coord>1 2 3</gx:coord></gx:Track></Placemark>
</Document></kml>
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "map.kml"
    path.write_text(text, encoding="utf-8")
    return path


def test_points_and_lines(tmp_path: Path) -> None:
    source = read_kml(write(tmp_path, DOCUMENT), "ring road")
    assert [(p.id, p.x, p.y, p.z_m, p.landmark_class) for p in source.points] == [
        ("p1", -80.54, 43.47, None, "light_pole"),
        ("Lamp & 2", -80.541, 43.471, None, "tree"),
    ]
    assert [line.points.tolist() for line in source.lines] == [
        [[-80.54, 43.47], [-80.541, 43.47], [-80.542, 43.471]]
    ]
    assert source.names == {"Ring Road": 3, "Other": 2}
    assert source.left_out == {
        "Polygon: neither a landmark nor a line": 1,
        "Track: neither a landmark nor a line": 1,
    }
    assert source.notes == ["1 Placemarks state no class: taken as light_pole"]
    assert len(read_kml(write(tmp_path, DOCUMENT)).lines) == 2


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("-80.54,43.47,330", "-80.54", r"Placemark 1 'Lamp 1'"),
        ("-80.54,43.47,330", "43.47,-180.54", "not on the globe"),
        ("-80.54,43.47,330", "-80.54,43.47 -80.54,43.47", "a Point of 2 places"),
        ("-80.54,43.47,330", "", "a Point of 0 places"),
        ("-80.541,43.47,0", "a,b", "Placemark 3 'Ring Road'"),
        ("<kml ", "<!DOCTYPE kml><kml ", "document type"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, old: str, new: str, what: str) -> None:
    assert old in DOCUMENT
    with pytest.raises(InputError, match=what):
        read_kml(write(tmp_path, DOCUMENT.replace(old, new)))


def test_files_that_are_no_kml(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="root is <osm>"):
        read_kml(write(tmp_path, "<osm/>"))
    with pytest.raises(DamagedError, match="not well-formed"):
        read_kml(write(tmp_path, DOCUMENT[:700]))
