"""What glibc's malloc does with the memory of a picture between two pictures."""

from __future__ import annotations

import ctypes
from typing import Final

# mallopt(3) and malloc.h: what each setting is called, and its value here.
M_TRIM_THRESHOLD: Final = -1
M_TOP_PAD: Final = -2
M_MMAP_THRESHOLD: Final = -3
LARGEST_ON_THE_HEAP: Final = 32 << 20  # glibc takes no more; the largest map of PoleNet has half of it
KEPT: Final = 256 << 20
PADDING: Final = 64 << 20  # a thread's heap has so much: with it, an empty one is not given back


def keep_freed_memory() -> bool:
    """Have freed memory kept for the next picture, in the whole process; False where malloc is not glibc's.

    By default glibc gives large blocks back to the system, and each picture has its memory, some 50 MB, mapped and
    zeroed anew, page by page: 13,000 faults and 20 ms of PoleNet's 130 ms of CPU time.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # musl and macOS have none, Windows no such library
        return False
    taken = mallopt(M_MMAP_THRESHOLD, LARGEST_ON_THE_HEAP)
    return bool(mallopt(M_TRIM_THRESHOLD, KEPT) and mallopt(M_TOP_PAD, PADDING) and taken)
