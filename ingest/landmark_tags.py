"""Which OpenStreetMap tags make a landmark, and of which class; the first row that fits decides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

ANY: Final = "*"
LANDMARK_TAGS: Final = (
    # key, value, class; https://wiki.openstreetmap.org/wiki/Tag:highway=street_lamp and the pages of each key
    ("highway", "street_lamp", "light_pole"),
    ("man_made", "street_lamp", "light_pole"),
    ("traffic_sign", ANY, "traffic_sign"),
    ("highway", "stop", "traffic_sign"),
    ("highway", "give_way", "traffic_sign"),
    ("highway", "traffic_signals", "traffic_light"),
    ("power", "pole", "pole"),
    ("power", "catenary_mast", "pole"),
    ("man_made", "utility_pole", "pole"),
    ("telecom", "pole", "pole"),
    ("man_made", "flagpole", "pole"),
    ("natural", "tree", "tree"),
)
CLASSES: Final = tuple(dict.fromkeys(name for _, _, name in LANDMARK_TAGS))
NOT_A_POLE: Final = frozenset({"wall", "wall_mounted", "ceiling", "suspended", "wire", "catenary"})
"""``support`` (or ``lamp_mount``) of lamps that hang: no foot stands where the lamp is."""


def landmark_class(tags: Mapping[str, Any]) -> str | None:
    """The class of an object with these tags; None for what is no landmark. A hanging lamp is a ``lamp``."""
    for key, value, name in LANDMARK_TAGS:
        found = tags.get(key)
        if found is None or found == "" or (value != ANY and found != value):
            continue
        if name == "light_pole" and NOT_A_POLE & {str(tags.get("support")), str(tags.get("lamp_mount"))}:
            return "lamp"
        return name
    return None
