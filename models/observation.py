"""Observations: what one segmented landmark says about where the vehicle is."""

from __future__ import annotations

from dataclasses import dataclass

from scpf.models.instances import Instance


@dataclass(frozen=True)
class Distance:
    """The predicted horizontal distance from the body origin to a landmark's foot.

    ``variance_m2`` is the predictive variance, noise included; ``function_variance_m2`` the paper's eq. (2), the
    variance of the function alone. ``expert`` answered; ``in_range`` is False outside the training range.
    """

    mean_m: float
    variance_m2: float
    function_variance_m2: float
    expert: str
    in_range: bool = True


@dataclass(frozen=True)
class Observation:
    """One detected landmark: its mask, its distance, and its bearing in the body frame (rad, left positive)."""

    instance: Instance
    distance: Distance
    bearing_rad: float
