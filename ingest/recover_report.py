"""What ``recover`` saved of a damaged log, and what it could not save."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

MAX_DAMAGES: Final = 200


@dataclass(frozen=True)
class Damage:
    """A damaged place: ``offset`` in the file, ``length_bytes`` (0: nothing lies there), and what is wrong."""

    offset: int
    length_bytes: int
    what: str


@dataclass
class TopicRecovery:
    """Messages of a topic: saved, and lost as far as that is known."""

    topic: str
    type: str
    recovered: int = 0
    lost: int = 0


@dataclass
class RecoveryReport:
    """The stated loss. ``lost_known``: whether the log says how many messages it held."""

    path: str
    source: str
    size_bytes: int
    chunks: int = 0
    chunks_lost: int = 0
    """Chunks of which nothing could be used."""
    lost_bytes: int = 0
    """Bytes of the file that hold nothing usable; inside a compressed chunk, of the unpacked records."""
    lost_known: bool = False
    complete: bool = False
    """Whether the file has its proper end: nothing after it can be missing."""
    unverified: int = 0
    """Messages kept although no checksum speaks for them: their chunk is cut, damaged at its head, or fails its
    checksum and was kept because that was asked for."""
    topics: dict[str, TopicRecovery] = field(default_factory=dict)
    attachments: list[str] = field(default_factory=list)
    attachments_lost: list[str] = field(default_factory=list)
    metadata: list[str] = field(default_factory=list)
    metadata_lost: int = 0
    damages: list[Damage] = field(default_factory=list)
    damages_not_listed: int = 0

    @property
    def messages(self) -> int:
        """Messages that were saved."""
        return sum(topic.recovered for topic in self.topics.values())

    @property
    def messages_lost(self) -> int:
        """Messages that are known to be lost."""
        return sum(topic.lost for topic in self.topics.values())

    @property
    def lossless(self) -> bool:
        """Whether all that the file held is in the new one, as far as the file says what it held."""
        lost = self.lost_bytes or self.messages_lost or self.attachments_lost or self.metadata_lost
        return self.complete and not (lost or self.damages or self.damages_not_listed or self.unverified)

    def damage(self, offset: int, length_bytes: int, what: str) -> None:
        """Note a damaged place; of very many only the first are listed, all are counted."""
        self.lost_bytes += length_bytes
        if len(self.damages) < MAX_DAMAGES:
            self.damages.append(Damage(offset, length_bytes, what))
        else:
            self.damages_not_listed += 1
