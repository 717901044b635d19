"""What the renderer's compiled kernels are made of: the decorators, vectors of three, and small functions.

Strict IEEE arithmetic, no fast mathematics: the same inputs give the same bits. A kernel is cached next to its file
with all parts it calls; it does not notice a change in another file, so remove ``__pycache__`` after editing a part.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a loop over arrays that Python calls; it runs without the GIL and is cached on disk."""
    return _compiled(function, cache=True)


def part(function: F) -> F:
    """Compile a function that kernels call."""
    return _compiled(function)


def inlined(function: F) -> F:
    """Put a function's code into its caller: for one that is called from one place and takes many arrays, which a
    call would copy one by one."""
    return _compiled(function, inline="always")


def _compiled(function: F, **options: Any) -> F:
    # Nothing here allocates, so nothing has to count references to arrays: that alone took two thirds of the time.
    # The option that says so is spelt as an internal one, and as old as numba's public interface.
    strict: Any = {"nogil": True, "fastmath": False, "error_model": "numpy", "_nrt": False}
    return cast(F, numba.njit(**strict, **options)(function))


@part
def dot(a: Any, b: Any) -> Any:
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def cross(a: Any, b: Any) -> Any:
    """Vector product of two vectors."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@part
def minus(a: Any, b: Any) -> Any:
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@part
def along(origin: Any, direction: Any, distance: Any) -> Any:
    """The point at a distance along a ray."""
    return (
        origin[0] + direction[0] * distance,
        origin[1] + direction[1] * distance,
        origin[2] + direction[2] * distance,
    )


@part
def unit_vector(a: Any) -> Any:
    """The vector at length 1."""
    inverse = 1.0 / math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2] + 1e-30)
    return a[0] * inverse, a[1] * inverse, a[2] * inverse


@part
def negative(a: Any) -> Any:
    """-a."""
    return -a[0], -a[1], -a[2]


@part
def mirrored(direction: Any, normal: Any) -> Any:
    """A direction after reflection at a plane of that unit normal."""
    twice = 2.0 * dot(direction, normal)
    return (
        direction[0] - twice * normal[0],
        direction[1] - twice * normal[1],
        direction[2] - twice * normal[2],
    )


@part
def transformed(T: Any, x: Any, y: Any, z: Any) -> Any:
    """A point (x, y, z) through a matrix (3, 4)."""
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@part
def rotated(T: Any, a: Any) -> Any:
    """A direction through the left (3, 3) of a matrix."""
    return (
        T[0, 0] * a[0] + T[0, 1] * a[1] + T[0, 2] * a[2],
        T[1, 0] * a[0] + T[1, 1] * a[1] + T[1, 2] * a[2],
        T[2, 0] * a[0] + T[2, 1] * a[1] + T[2, 2] * a[2],
    )


@part
def mixed(a: Any, b: Any, share: Any) -> Any:
    """The colour a, with that share of it replaced by b."""
    rest = 1.0 - share
    return a[0] * rest + b[0] * share, a[1] * rest + b[1] * share, a[2] * rest + b[2] * share


@part
def scaled(a: Any, factor: Any) -> Any:
    """The colour or vector times a factor."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@part
def clamp(x: Any, low: Any, high: Any) -> Any:
    """x kept within low and high."""
    return low if x < low else (high if x > high else x)


@part
def smooth_step(low: Any, high: Any, x: Any) -> Any:
    """0 below low, 1 above high, a cubic between them."""
    t = clamp((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


@part
def band(x: Any, low: Any, high: Any, width: Any) -> Any:
    """How much of a filter of that width about x lies within low and high: a line drawn without steps."""
    return clamp((min(x + width * 0.5, high) - max(x - width * 0.5, low)) / width, 0.0, 1.0)


@part
def remainder(x: Any, period: Any) -> Any:
    """x within its period, 0 and above also for negative x."""
    return x - math.floor(x / period) * period


@part
def hashed(i: Any, j: Any) -> Any:
    """A number in [0, 1) of two integers, without visible pattern."""
    h = (i * 374761393 + j * 668265263) & 0xFFFFFFFF
    h = ((h ^ (h >> 13)) * 1274126177) & 0xFFFFFFFF
    return ((h ^ (h >> 16)) & 0xFFFFFF) / 16777216.0
