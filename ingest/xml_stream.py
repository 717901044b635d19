"""XML of others, read as a stream: bounded memory, no document type, hence no entities to expand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final, NoReturn
from xml.parsers import expat

from scpf.models.errors import DamagedError, InputError

BLOCK_BYTES: Final = 1 << 20
MAX_TAG_BYTES: Final = 8 << 20
"""Of one tag with its attributes: the parser holds a whole tag."""
MAX_DEPTH: Final = 256

Start = Callable[[str, dict[str, str], int], None]
End = Callable[[str, int], None]


def stream(
    path: Path, start: Start, end: End, text: Callable[[str], None] | None = None, *, max_bytes: int
) -> None:
    """Call ``start(name, attributes, depth)``, ``end(name, depth)`` and ``text(data)``; the root has depth 0.

    Namespace prefixes are cut off. Raises DamagedError, with the line, for a file that is not well-formed or is
    cut short, InputError for one that declares a document type (DTDs can make a small file explode), nests
    deeper than 256, or is larger than ``max_bytes``.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    depth = 0

    def on_start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        if depth >= MAX_DEPTH:
            raise InputError(f"{path}:{parser.CurrentLineNumber}: tags nested deeper than {MAX_DEPTH}")
        start(name.rpartition(":")[2], attributes, depth)
        depth += 1

    def on_end(name: str) -> None:
        nonlocal depth
        depth -= 1
        end(name.rpartition(":")[2], depth)

    def on_doctype(*_: object) -> NoReturn:
        hint = "remove the <!DOCTYPE …> line; maps need none"
        raise InputError(f"{path}:{parser.CurrentLineNumber}: a document type is declared, and refused", hint)

    parser.StartElementHandler = on_start
    parser.EndElementHandler = on_end
    parser.StartDoctypeDeclHandler = on_doctype
    if text is not None:
        parser.CharacterDataHandler = text
    fed = 0
    try:
        with path.open("rb") as file:
            while block := file.read(BLOCK_BYTES):
                fed += len(block)
                if fed > max_bytes:
                    hint = "cut it to the area of the drive"
                    raise InputError(f"{path} is larger than {max_bytes >> 20} MiB", hint)
                parser.Parse(block, False)
                if fed - parser.CurrentByteIndex > MAX_TAG_BYTES:
                    raise InputError(f"{path}:{parser.CurrentLineNumber}: a tag of more than 8 MiB")
        parser.Parse(b"", True)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from error
    except (expat.ExpatError, ValueError, LookupError) as error:
        hint = "is the file whole, and XML?" if fed else "the file is empty"
        raise DamagedError(f"{path}: not well-formed XML ({error})", hint) from error
