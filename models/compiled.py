"""What compiled kernels are made of: the decorators, and float32 mathematics that the compiler can vectorise.

No branch, no call into a C library: a loop over particles becomes a loop over vector registers. Accuracy is that
of float32 (relative 1e-6, erfc 2e-7 of its value). Positions must be local, within a few kilometres of 0.
Kernels are cached next to their file; a cached kernel does not notice a change in this one, so remove
``__pycache__`` after editing it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array32 = NDArray[np.float32]
F = TypeVar("F", bound=Callable[..., Any])

f4 = np.float32
u4 = np.uint32
i4 = np.int32

TAU: Final = 6.283185307179586


def kernel(function: F) -> F:
    """Compile a loop over arrays, beside which other threads go on; cached on disk."""
    return cast(F, numba.njit(cache=True, nogil=True, fastmath=True, error_model="numpy")(function))


def inlined(function: F) -> F:
    """Compile a scalar function into the loops that call it."""
    return cast(F, numba.njit(inline="always", fastmath=True, error_model="numpy")(function))


@inlined
def hashed(x: Any) -> Any:
    """A bijection of 32 bits whose every output bit depends on every input bit (lowbias32)."""
    x = u4(x ^ (x >> u4(16)))
    x = u4(x * u4(0x21F0AAAD))
    x = u4(x ^ (x >> u4(15)))
    x = u4(x * u4(0xD35A2D97))
    return u4(x ^ (x >> u4(15)))


@inlined
def log_positive(u: Any) -> Any:
    """log u of a normal float32 u > 0: polynomial on the mantissa."""
    bits = f4(u).view(i4)
    exponent = i4((bits >> i4(23)) - i4(126))
    mantissa = i4((bits & i4(0x007FFFFF)) | i4(0x3F000000)).view(f4)
    small = mantissa < f4(0.70710678)
    power = f4(exponent) - (f4(1.0) if small else f4(0.0))
    x = (mantissa + mantissa - f4(1.0)) if small else (mantissa - f4(1.0))
    z = x * x
    y = f4(7.0376836292e-2)
    y = y * x - f4(1.1514610310e-1)
    y = y * x + f4(1.1676998740e-1)
    y = y * x - f4(1.2420140846e-1)
    y = y * x + f4(1.4249322787e-1)
    y = y * x - f4(1.6668057665e-1)
    y = y * x + f4(2.0000714765e-1)
    y = y * x - f4(2.4999993993e-1)
    y = y * x + f4(3.3333331174e-1)
    y = y * x * z - f4(0.5) * z
    return x + y + power * f4(0.69314718056)


@inlined
def exp_negative(x: Any) -> Any:
    """exp x for x ≤ 0; below −87 as at −87."""
    x = max(x, f4(-87.0))
    n = np.floor(x * f4(1.44269504) + f4(0.5))
    r = x - n * f4(0.693359375) + n * f4(2.12194440e-4)
    y = f4(1.9875691500e-4)
    y = y * r + f4(1.3981999507e-3)
    y = y * r + f4(8.3334519073e-3)
    y = y * r + f4(4.1665795894e-2)
    y = y * r + f4(1.6666665459e-1)
    y = y * r + f4(5.0000001201e-1)
    y = y * r * r + r + f4(1.0)
    return y * i4((i4(n) + i4(127)) << i4(23)).view(f4)


@inlined
def sin_cos_turns(t: Any) -> Any:
    """sin and cos of t turns (2πt rad)."""
    q = np.floor(f4(4.0) * t + f4(0.5))
    r = (t - q * f4(0.25)) * f4(TAU)
    z = r * r
    s = ((f4(-1.9515295891e-4) * z + f4(8.3321608736e-3)) * z - f4(1.6666654611e-1)) * z * r + r
    c = ((f4(2.443315711809948e-5) * z - f4(1.388731625493765e-3)) * z + f4(4.166664568298827e-2)) * z * z
    c = c - f4(0.5) * z + f4(1.0)
    k = i4(q) & i4(3)
    odd = (k & i4(1)) != 0
    sine = c if odd else s
    cosine = s if odd else c
    sine = -sine if (k & i4(2)) != 0 else sine
    cosine = -cosine if ((k + i4(1)) & i4(2)) != 0 else cosine
    return sine, cosine


@inlined
def angle_of(y: Any, x: Any) -> Any:
    """atan2(y, x); 0 at the origin."""
    ax = abs(x)
    ay = abs(y)
    high = max(max(ax, ay), f4(1e-30))
    low = min(ax, ay)
    steep = low > f4(0.41421356) * high
    # atan a = π/4 + atan((a − 1)/(a + 1)) brings the argument within ±tan(π/8)
    a = (low - high) / (low + high) if steep else low / high
    z = a * a
    p = ((f4(8.05374449538e-2) * z - f4(1.38776856032e-1)) * z + f4(1.99777106478e-1)) * z
    p = (p - f4(3.33329491539e-1)) * z * a + a
    p = p + f4(0.785398163397448) if steep else p
    p = f4(1.5707963267949) - p if ay > ax else p
    p = f4(3.14159265358979) - p if x < f4(0.0) else p
    return -p if y < f4(0.0) else p


@inlined
def wrapped(angle_rad: Any) -> Any:
    """The same angle within ±π."""
    return angle_rad - f4(TAU) * np.floor(angle_rad * f4(1.0 / TAU) + f4(0.5))


@inlined
def erfc_parts(u: Any) -> Any:
    """(t, p) with erfc(u) = t·e^p for u ≥ 0, never underflowing: products of t and sums of p stay exact."""
    t = f4(1.0) / (f4(1.0) + f4(0.5) * u)
    p = f4(0.17087277)
    p = p * t + f4(-0.82215223)
    p = p * t + f4(1.48851587)
    p = p * t + f4(-1.13520398)
    p = p * t + f4(0.27886807)
    p = p * t + f4(-0.18628806)
    p = p * t + f4(0.09678418)
    p = p * t + f4(0.37409196)
    p = p * t + f4(1.00002368)
    p = p * t + f4(-1.26551223)
    return t, p - u * u
