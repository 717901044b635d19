"""OpenStreetMap XML (``.osm``): landmarks of nodes, and the ways of a named road, in one streaming pass.

Format: https://wiki.openstreetmap.org/wiki/OSM_XML. Nodes and ways may come in any order.
"""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest.landmark_tags import landmark_class
from scpf.ingest.map_source import (
    MAX_POINTS,
    OSM_ATTRIBUTION,
    MapSource,
    SourceLine,
    SourcePoint,
    degrees,
    same_name,
)
from scpf.ingest.xml_stream import stream
from scpf.models.errors import InputError

MAX_BYTES: Final = 4 << 30
MAX_NODES: Final = 20_000_000
"""24 bytes each: half a gigabyte, some 4 GB of XML."""
MAX_TAGS: Final = 2_000
NO_ROAD: Final = frozenset({"platform", "proposed", "construction", "rest_area", "services", "razed"})
NAME_KEYS: Final = ("name", "alt_name", "official_name", "ref", "name:en")


def read_osm(path: Path, road: str | None = None) -> MapSource:
    """Landmarks and, where ``road`` is given, the ways of that name (or alternative name, or ``ref``).

    Landmarks are nodes with the tags of ``landmark_tags``; only light poles are taken by default. A node that
    is a vertex of a highway marks where on the road a sign or signal applies, not where its pole stands: it
    is left out and counted. Heights are unknown. Raises InputError, DamagedError.
    """
    reader = _Reader(path, road)
    stream(path, reader.start, reader.end, max_bytes=MAX_BYTES)
    return reader.finish()


class _Reader:
    def __init__(self, path: Path, road: str | None) -> None:
        self._path, self._road = path, road
        self._source = MapSource(
            path, "OSM XML", attribution=OSM_ATTRIBUTION, classes=frozenset({"light_pole"})
        )
        self._node_ids, self._longitudes, self._latitudes = array("q"), array("d"), array("d")
        self._landmarks: dict[int, SourcePoint] = {}
        self._highway_refs = array("q")
        self._ways: list[tuple[int, array[int], bool]] = []
        self._way_vertices = 0
        self._id = 0
        self._usable = False
        self._tags: dict[str, str] = {}
        self._refs = array("q")

    def start(self, name: str, attributes: dict[str, str], depth: int) -> None:
        if depth == 0 and name != "osm":
            hint = "export OSM XML (.osm); a .pbf is converted with: osmium cat IN.osm.pbf -o OUT.osm"
            raise InputError(f"{self._path}: the root is <{name}>, not <osm>", hint)
        if depth == 1 and name in ("node", "way"):
            self._tags, self._refs = {}, array("q")
            self._usable = self._begin(name, attributes)
        elif depth == 2 and name == "tag":
            if len(self._tags) < MAX_TAGS:
                self._tags[attributes.get("k", "")] = attributes.get("v", "")
            else:
                self._source.left_out[f"tag beyond {MAX_TAGS} of one object"] += 1
        elif depth == 2 and name == "nd":
            try:
                self._refs.append(int(attributes.get("ref", "")))
            except (ValueError, OverflowError):
                self._source.left_out["way vertex without a node's number"] += 1

    def _begin(self, name: str, attributes: dict[str, str]) -> bool:
        if attributes.get("visible") == "false" or attributes.get("action") == "delete":
            return False
        try:
            self._id = int(attributes.get("id", ""))
            array("q", [self._id])
            if name == "node":
                place = degrees(attributes.get("lon", ""), attributes.get("lat", ""))
        except (ValueError, OverflowError):
            self._source.left_out[f"{name} without a number or a place"] += 1
            return False
        if name == "node":
            if len(self._node_ids) >= MAX_NODES:
                raise InputError(
                    f"{self._path}: more than {MAX_NODES} nodes", "cut it to the area of the drive"
                )
            self._node_ids.append(self._id)
            self._longitudes.append(place[0])
            self._latitudes.append(place[1])
        return True

    def end(self, name: str, depth: int) -> None:
        if depth != 1 or not self._usable:
            return
        if name == "node" and self._tags:
            self._end_node()
        elif name == "way" and "highway" in self._tags:
            self._end_way()
        self._usable = False

    def _end_node(self) -> None:
        kind = landmark_class(self._tags)
        if kind is None:
            return
        if len(self._landmarks) >= MAX_POINTS:
            raise InputError(
                f"{self._path}: more than {MAX_POINTS} landmarks", "cut it to the area of the drive"
            )
        place = self._longitudes[-1], self._latitudes[-1]
        self._landmarks[self._id] = SourcePoint(str(self._id), *place, landmark_class=kind)

    def _end_way(self) -> None:
        tags = self._tags
        self._highway_refs.extend(self._refs)
        if len(self._highway_refs) > 2 * MAX_NODES:
            raise InputError(f"{self._path}: ways of more than {2 * MAX_NODES} vertices")
        name = tags.get("name") or tags.get("ref") or ""
        self._source.add_name(name, len(self._refs))
        if self._road is None or not same_name(self._road, *(tags.get(key) for key in NAME_KEYS)):
            return
        if tags["highway"] in NO_ROAD or tags.get("area") == "yes":
            what = "area" if tags.get("area") == "yes" else tags["highway"]
            self._source.left_out[f"way of that name that is no road to drive on ({what})"] += 1
            return
        self._way_vertices += len(self._refs)
        if self._way_vertices > MAX_POINTS:
            raise InputError(f"{self._path}: a road of more than {MAX_POINTS} vertices")
        circle = tags.get("junction") in ("roundabout", "circular")
        oneway = tags.get("oneway", "yes" if circle else "no")
        refs = self._refs
        if oneway in ("-1", "reverse"):
            refs = refs[::-1]
        self._ways.append((self._id, refs, oneway in ("yes", "true", "1", "-1", "reverse")))

    def finish(self) -> MapSource:
        """The lines with their places, and the landmarks that stand beside the roads."""
        source = self._source
        on_road = np.isin(
            np.array(list(self._landmarks), dtype=np.int64), np.frombuffer(self._highway_refs, dtype=np.int64)
        )
        for beside, mark in zip(~on_road, self._landmarks.values(), strict=True):
            if beside:
                source.points.append(mark)
            elif source.classes is None or mark.landmark_class in source.classes:
                source.left_out[
                    f"{mark.landmark_class} that is a vertex of a road: it does not stand there"
                ] += 1
        ids, first = np.unique(np.frombuffer(self._node_ids, dtype=np.int64), return_index=True)
        if len(ids) < len(self._node_ids):
            source.notes.append(f"{len(self._node_ids) - len(ids)} nodes come twice: the first was taken")
        places = np.column_stack([np.frombuffer(column) for column in (self._longitudes, self._latitudes)])
        for way_id, refs, oneway in self._ways:
            self._add_line(way_id, np.frombuffer(refs, dtype=np.int64), oneway, ids, places[first])
        return source

    def _add_line(
        self,
        way_id: int,
        refs: NDArray[np.int64],
        oneway: bool,
        ids: NDArray[np.int64],
        places: NDArray[np.float64],
    ) -> None:
        """One line of a way; several where vertices are not in the file, as at the edge of an extract."""
        at = np.minimum(np.searchsorted(ids, refs), max(len(ids) - 1, 0))
        known = ids[at] == refs if len(ids) else np.zeros(len(refs), dtype=bool)
        if not known.all():
            self._source.left_out["vertex of the road that is not in the file"] += int((~known).sum())
        runs = np.split(np.arange(len(refs)), np.flatnonzero(np.diff(known.astype(int))) + 1)
        pieces = [run for run in runs if len(run) > 1 and known[run[0]]]
        for piece in pieces:
            nodes = tuple(int(ref) for ref in refs[piece])
            self._source.lines.append(SourceLine(f"way {way_id}", nodes, places[at[piece]], oneway))
        if not pieces:
            self._source.left_out["way of the road with less than two vertices in the file"] += 1
