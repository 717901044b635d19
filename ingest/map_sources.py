"""Maps of others: which reader reads which file."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Final

from scpf.ingest.map_source import MapSource
from scpf.models.errors import InputError, UsageError

READERS: Final = {
    # ending, where its reader lives; each is called with (path, road) and returns a MapSource
    ".osm": "osm:read_osm",
    ".kml": "kml:read_kml",
    ".geojson": "geojson_source:read_geojson",
    ".json": "geojson_source:read_geojson",
    ".csv": "csv_source:read_csv",
    ".txt": "csv_source:read_csv",
}
BY_CONTENT: Final = ((b"<osm", ".osm"), (b"<kml", ".kml"), (b"{", ".geojson"))
"""For other endings: what stands in the first kilobyte."""
REMEDIES: Final = {
    ".pbf": "convert it first: osmium cat IN.osm.pbf -o OUT.osm",
    ".kmz": "a .kmz is a zip file: unzip it and give the .kml inside",
    ".shp": "convert it first: ogr2ogr -t_srs EPSG:4326 OUT.geojson IN.shp",
    ".gpkg": "convert it first: ogr2ogr -t_srs EPSG:4326 OUT.geojson IN.gpkg",
    ".gz": "unpack it first: gunzip",
    ".bz2": "unpack it first: bunzip2",
}


def read_source(path: Path, road: str | None = None, key: str | None = None) -> MapSource:
    """The landmarks and lines of a foreign map, by the ending of its name, else its content.

    ``road`` names the lines that are wanted; ``key`` the array of an ``.npz``. Raises InputError.
    """
    ending = path.suffix.lower()
    if ending in (".npz", ".npy"):
        from scpf.ingest.csv_source import metric_points

        return metric_points(path, key)
    if key is not None:
        raise UsageError(f"--key names an array of an .npz, and {path} is none")
    module, _, function = (READERS.get(ending) or READERS[_by_content(path, ending)]).partition(":")
    source = getattr(import_module(f"scpf.ingest.{module}"), function)(path, road)
    assert isinstance(source, MapSource)
    return source


def _by_content(path: Path, ending: str) -> str:
    try:
        with path.open("rb") as file:
            head = file.read(1024).lstrip(b"\xef\xbb\xbf \t\r\n")
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    for mark, known in BY_CONTENT:
        if ending not in REMEDIES and (head.startswith(mark) or (head.startswith(b"<") and mark in head)):
            return known
    hint = REMEDIES.get(ending, "known: " + " ".join([*READERS, ".npz"]))
    raise InputError(f"{path}: not a map format that scpf reads", hint)
