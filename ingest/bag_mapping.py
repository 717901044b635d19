"""Topic mappings: which topics of a bag become which of the drive log. Built-in ones, and those a user writes (TOML).

A mapping is a list of rules, the first that fits wins: several rules of one role are alternatives.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from scpf.ingest.bag_choice import matcher
from scpf.ingest.bag_mappings import BUILT_IN
from scpf.ingest.bag_navigation_fields import ACCURACY_FIELDS, NAVIGATION_FIELDS, check_field
from scpf.ingest.topics import (
    CAMERA_INFO_TOPIC,
    GPS_FIX_TOPIC,
    IMAGE_TOPIC,
    INS_FIX_TOPIC,
    INS_ODOMETRY_TOPIC,
    INS_POSE_TOPIC,
    TF_STATIC_TOPIC,
)
from scpf.models.errors import InputError, UsageError

MAX_FILE_BYTES: Final = 1 << 20
POSES: Final = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
ROLES: Final[dict[str, tuple[str, ...]]] = {
    "image": ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"),
    "camera_info": ("sensor_msgs/msg/CameraInfo",),
    "navigation": (),
    "accuracy": (),
    "pose": POSES,
    "fix": ("sensor_msgs/msg/NavSatFix",),
    "gps": ("sensor_msgs/msg/NavSatFix",),
    "imu": ("sensor_msgs/msg/Imu",),
    "tf_static": ("tf2_msgs/msg/TFMessage",),
}
"""What a topic may become, and the types that can (none listed: any with the fields)."""
TARGETS: Final = {
    "image": IMAGE_TOPIC,
    "camera_info": CAMERA_INFO_TOPIC,
    "fix": INS_FIX_TOPIC,
    "gps": GPS_FIX_TOPIC,
    "imu": "/ins/imu",
    "tf_static": TF_STATIC_TOPIC,
}
TIMES: Final = ("auto", "header", "gps", "log")


@dataclass(frozen=True)
class Rule:
    """One line of a mapping: topics (a pattern) of a type (a glob) become ``to``.

    ``time``: where poses take their time from; ``fields``: where values of a navigation message lie.
    ``rectified``: the images are rectified, so that the camera is that of the projection matrix ``P``.
    """

    topic: str
    to: str
    type: str = "*"
    time: str = "auto"
    rectified: bool = False
    fields: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Mapping:
    """A named list of rules."""

    name: str
    rules: tuple[Rule, ...]


@dataclass(frozen=True)
class Candidate:
    """A topic of the bag that a rule may take."""

    topic: str
    type: str


def read_mapping(name: str) -> Mapping:
    """A mapping by the name of a built-in one, or of a TOML file. InputError naming the file and the rule."""
    if name in BUILT_IN:
        return parse_mapping(BUILT_IN[name], name, name)
    path = Path(name)
    if not path.is_file():
        near = get_close_matches(name, BUILT_IN, 1)
        hint = f"did you mean {near[0]}?" if near else f"built in: {', '.join(BUILT_IN)}; or give a TOML file"
        raise UsageError(f"no mapping {name!r}", hint)
    if path.stat().st_size > MAX_FILE_BYTES:
        raise InputError(f"{path} is larger than 1 MiB", "is this a topic mapping?")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read ({error})") from error
    return parse_mapping(text, path.stem, str(path))


def parse_mapping(text: str, name: str, place: str) -> Mapping:
    """The mapping of a TOML text."""
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{place} is not TOML ({error})") from error
    _only(document, ("name", "rule"), place)
    rules = document.get("rule", [])
    if not isinstance(rules, list) or not rules:
        raise InputError(f"{place} holds no rule", 'begin with [[rule]], topic = "/…", to = "image"')
    parsed = tuple(_rule(entry, f"{place}: rule {k}") for k, entry in enumerate(rules, 1))
    return Mapping(str(document.get("name", name)), parsed)


def _rule(entry: Any, place: str) -> Rule:
    if not isinstance(entry, dict):
        raise InputError(f"{place} is not a table")
    _only(entry, ("topic", "to", "type", "time", "rectified", "fields"), place)
    for key in ("topic", "to"):
        if not isinstance(entry.get(key), str):
            raise InputError(f"{place}: {key} is missing, or not a text")
    if entry["to"] not in ROLES:
        raise InputError(f"{place}: to = {entry['to']!r}", f"known: {', '.join(ROLES)}")
    if entry.get("time", "auto") not in TIMES:
        raise InputError(f"{place}: time = {entry['time']!r}", f"known: {', '.join(TIMES)}")
    if not isinstance(entry.get("type", "*"), str) or not isinstance(entry.get("rectified", False), bool):
        raise InputError(f"{place}: type is a text, rectified is true or false")
    fields = entry.get("fields", {})
    known = {"navigation": NAVIGATION_FIELDS, "accuracy": ACCURACY_FIELDS}.get(entry["to"], {})
    if not isinstance(fields, dict) or not all(isinstance(value, str) for value in fields.values()):
        raise InputError(f"{place}: fields is a table of names and paths")
    for key in fields:
        check_field(key, known, place)
    matcher(entry["topic"])
    return Rule(**entry)


def _only(table: dict[str, Any], known: Sequence[str], place: str) -> None:
    for key in table:
        if key not in known:
            near = get_close_matches(key, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}"
            raise InputError(f"{place}: {key!r} is not known", hint)


def detect(candidates: Sequence[Candidate]) -> Mapping | None:
    """The built-in mapping whose reference is in the bag; ``plain`` has to be asked for by name."""
    for name in BUILT_IN:
        if name != "plain":
            mapping = read_mapping(name)
            roles = assign(mapping, candidates)[0].values()
            if any(rule.to in ("navigation", "pose") for rule in roles):
                return mapping
    return None


def made_by(rule: Rule) -> tuple[str, ...]:
    """The drive log's topics that a rule makes."""
    if rule.to == "navigation":
        return INS_POSE_TOPIC, INS_ODOMETRY_TOPIC, INS_FIX_TOPIC, TARGETS["imu"]
    if rule.to == "pose":
        return INS_POSE_TOPIC, INS_ODOMETRY_TOPIC
    return (TARGETS[rule.to],) if rule.to in TARGETS else ()


def assign(mapping: Mapping, candidates: Sequence[Candidate]) -> tuple[dict[Candidate, Rule], list[str]]:
    """Which topic takes which role, and notes on what was not taken.

    Of several topics that fit a rule, a camera_info next to the images comes first, else the first by name.
    Navigation and pose are both the reference: whichever is written first in the mapping.
    """
    taken: dict[Candidate, Rule] = {}
    filled: set[str] = set()
    notes: list[str] = []
    pictures = ""
    for rule in mapping.rules:
        role = "reference" if rule.to in ("navigation", "pose") else rule.to
        match = matcher(rule.topic)
        fitting = [
            c for c in candidates if match(c.topic) and fnmatchcase(c.type, rule.type) and c not in taken
        ]
        if not fitting or role in filled:
            continue
        allowed = ROLES[rule.to]
        usable = [c for c in fitting if not allowed or c.type in allowed]
        if not usable:
            notes.append(f"{fitting[0].topic}: a {fitting[0].type} cannot become {rule.to}")
            continue
        if rule.to == "camera_info" and pictures:
            usable.sort(key=lambda c: (-_shared(c.topic, pictures), c.topic))
        else:
            usable.sort(key=lambda c: c.topic)
        chosen = usable[0]
        taken[chosen] = rule
        filled.add(role)
        if rule.to == "image":
            pictures = chosen.topic
        if len(usable) > 1:
            others = ", ".join(c.topic for c in usable[1:6])
            notes.append(f"{rule.to} is taken from {chosen.topic}, not from {others}")
    return taken, notes


def _shared(one: str, other: str) -> int:
    """How many parts of their names two topics begin with together."""
    count = 0
    for mine, theirs in zip(one.split("/"), other.split("/"), strict=False):
        if mine != theirs:
            break
        count += 1
    return count
