"""All raw files of an INS, as an operator copies them from unit and office after a drive."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from scpf.models.errors import InputError
from scpf.sample_logs.encode_grp import grp
from scpf.sample_logs.encode_gsof import gsof
from scpf.sample_logs.encode_nmea import nmea
from scpf.sample_logs.encode_pcap import pcap
from scpf.sample_logs.encode_sbet import sbet, smrmsg
from scpf.sample_logs.sensors import InsLog

RAW_LOGS: Final[dict[str, Callable[[InsLog], Iterable[bytes]]]] = {
    "sbet.out": lambda ins: [sbet(ins)],
    "smrmsg.out": lambda ins: [smrmsg(ins)],
    "lvx.gsof": lambda ins: [gsof(ins)],
    "poslv.pcap": lambda ins: pcap(grp(ins)),
    "ins.nmea": lambda ins: [nmea(ins)],
}
"""File name, and what gives the file's pieces."""


def write_raw_logs(folder: Path, ins: InsLog, *, overwrite: bool = False) -> list[Path]:
    """Write an INS's log in each format of ``RAW_LOGS`` into ``folder``, which is made where it is missing.

    Returns the files' paths. Raises InputError where one of them exists, unless ``overwrite``.
    """
    paths = [folder / name for name in RAW_LOGS]
    there = [path for path in paths if path.exists()]
    if there and not overwrite:
        raise InputError(f"{there[0]} exists", "choose another folder, or give --overwrite")
    folder.mkdir(parents=True, exist_ok=True)
    for path, pieces in zip(paths, RAW_LOGS.values(), strict=True):
        with path.open("wb") as file:
            file.writelines(pieces(ins))
    return paths
