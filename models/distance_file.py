"""Distance models on disk: one .npz, arrays and a JSON member, no pickle.

``model.json`` (uint8) says format, version, the experts with their features and what the model was trained on; the
arrays of expert E are named ``E.NAME``, those of a cross-fitted model's held-out predictions ``held_out.NAME``. Where
there is a model for each of several landmark classes, the k-th one's names begin with ``k/``. The Cholesky factor is
stored (its lower triangle, row by row), not computed anew, so that predictions are bit-equal to those before saving.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel, Predictions, TrainedOn
from scpf.models.distance_classes import DistanceByClass
from scpf.models.distance_gate import Gate, expert_names
from scpf.models.errors import DamagedError, InputError, MissingError
from scpf.models.features import FEATURES
from scpf.models.gaussian_process import GaussianProcess, Hyperparameters
from scpf.models.npz import load_arrays
from scpf.models.warp import POWERS, RANGE_M, Warp

FORMAT: Final = "scpf.distance"
VERSION: Final = 3
"""What this scpf reads. Version 1 knows one class and one or two experts, version 2 no warped ones; what needs no more
is written as such.
"""

HEADER: Final = "model.json"
MAX_BYTES: Final = 1 << 30
"""What the members of a file may unpack to; a model of 1000 samples has 4 MB."""

HELD_OUT: Final = ("mean_m", "variance_m2", "function_variance_m2", "expert", "in_range")

Array = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]


Distances = DistanceModel | CrossFittedDistance | DistanceByClass
"""Everything that a file may hold."""


def save(model: Distances, path: Path) -> None:
    """Write ``model`` to ``path``, replacing it only when the new file is whole."""
    arrays: Arrays = {}
    if isinstance(model, DistanceByClass):
        entries = [_entry(each, arrays, f"{k}/") for k, each in enumerate(model.models.values())]
        header: dict[str, Any] = {"format": FORMAT, "version": max(2, _version(arrays)), "classes": entries}
    else:
        entry = _entry(model, arrays, "")
        least = 1 if len(entry["model"]["experts"]) <= 2 else 2
        header = {"format": FORMAT, "version": max(least, _version(arrays)), **entry}
    arrays[HEADER] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    partial = path.with_name(path.name + ".partial")
    try:
        with partial.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def load(path: Path) -> Distances:
    """Read a model, plain or cross-fitted, or one for each class.

    Raises MissingError where there is no file, DamagedError where it is cut short or contradicts itself,
    InputError where it is something else or was written by a newer scpf.
    """
    if not path.is_file():
        raise MissingError(
            f"{path}: no such file", "train one with: scpf train distance LOG --output MODEL.npz"
        )
    try:
        arrays = load_arrays(path, MAX_BYTES)
        header = json.loads(arrays[HEADER].tobytes())
        if header.get("format") != FORMAT:
            raise InputError(f"{path}: not a distance model", "scpf train distance writes them")
        if header["version"] > VERSION:
            raise InputError(f"{path}: version {header['version']} is newer than this scpf", "update scpf")
        if "classes" not in header:
            return _read(header, arrays, "", path)
        models = [_read(entry, arrays, f"{k}/", path) for k, entry in enumerate(header["classes"])]
        by_class = {each.trained_on.landmark_class: each for each in models}
        if not models or len(by_class) < len(models):
            raise ValueError("no class, or one class twice")
        return DistanceByClass(by_class)
    except (KeyError, IndexError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise DamagedError(
            f"{path}: not a whole distance model ({error})", "train or copy it again"
        ) from error


def _version(arrays: Arrays) -> int:
    """The least that can read the arrays of a model."""
    return 3 if any(name.endswith(".warp") for name in arrays) else 1


def _entry(model: DistanceModel | CrossFittedDistance, arrays: Arrays, prefix: str) -> dict[str, Any]:
    """The header of one class; its arrays go into ``arrays``, each name after ``prefix``."""
    if not isinstance(model, CrossFittedDistance):
        return {"model": _pack(model, arrays, prefix)}
    arrays[f"{prefix}held_out.stamps_ns"] = model.stamps_ns
    arrays[f"{prefix}held_out.boxes_px"] = model.boxes_px
    for name in HELD_OUT:
        arrays[f"{prefix}held_out.{name}"] = getattr(model.held_out, name)
    return {"model": _pack(model.model, arrays, prefix), "held_out": True}


def _read(
    entry: Mapping[str, Any], arrays: Arrays, prefix: str, path: Path
) -> DistanceModel | CrossFittedDistance:
    mine = {name.removeprefix(prefix): each for name, each in arrays.items() if name.startswith(prefix)}
    model = _unpack(entry["model"], mine, path)
    return _held_out(model, mine) if entry.get("held_out") else model


def _pack(model: DistanceModel, arrays: Arrays, before: str) -> dict[str, Any]:
    """The header of one model; its arrays go into ``arrays``."""
    if model.gate is not None:
        for name in ("shares", "means", "variances"):
            arrays[f"{before}gate.{name}"] = getattr(model.gate, name)
    for name, expert in zip(model.names, model.experts, strict=True):
        prefix, found = before + name, expert.hyperparameters
        arrays[f"{prefix}.scalars"] = np.array([found.signal_m2, found.noise_m2, expert.offset_m])
        arrays[f"{prefix}.length_scales"] = found.length_scales
        if expert.warp is not None:
            arrays[f"{prefix}.warp"] = np.array([expert.warp.power, expert.warp.scale_m])
        arrays[f"{prefix}.factor"] = expert.factor[np.tril_indices(len(expert.factor))]
        for member in ("centre", "scale", "inputs", "weights", "lowest", "highest"):
            arrays[f"{prefix}.{member}"] = getattr(expert, member)
    about = model.trained_on
    return {
        "experts": {name: list(inputs) for name, inputs in zip(model.names, model.inputs, strict=True)},
        "landmark_class": about.landmark_class,
        "image_px": [about.image_width_px, about.image_height_px],
        "camera_matrix": about.camera_matrix.tolist(),
        "notes": dict(about.notes),
    }


def _unpack(member: Mapping[str, Any], arrays: Arrays, path: Path) -> DistanceModel:
    names = tuple(member["experts"])
    inputs = tuple(tuple(str(name) for name in member["experts"][expert]) for expert in names)
    if not names or names != expert_names(len(names)):
        raise ValueError(f"experts {names}")
    unknown = {name for each in inputs for name in each} - set(FEATURES)
    if unknown:
        raise InputError(
            f"{path}: uses features that this scpf does not know: {sorted(unknown)}", "update scpf"
        )
    gate = None
    if len(names) > 1:
        gate = Gate(
            _array(arrays, "gate.shares", (len(names),), positive=True),
            _array(arrays, "gate.means", (len(names), 2)),
            _array(arrays, "gate.variances", (len(names), 2), positive=True),
        )
    experts = tuple(_expert(arrays, name, len(each)) for name, each in zip(names, inputs, strict=True))
    width, height = (int(side) for side in member["image_px"])
    matrix = np.array(member["camera_matrix"], dtype=np.float64).reshape(3, 3)
    if width <= 0 or height <= 0:
        raise ValueError(f"an image of {width}×{height} px")
    notes = {str(key): str(value) for key, value in member["notes"].items()}
    about = TrainedOn(str(member["landmark_class"]), width, height, matrix, notes)
    return DistanceModel(gate, experts, inputs, about)


def _held_out(model: DistanceModel, arrays: Arrays) -> CrossFittedDistance:
    stamps = np.asarray(arrays["held_out.stamps_ns"])
    n = len(stamps)
    mean, variance, function = (_array(arrays, f"held_out.{name}", (n,)) for name in HELD_OUT[:3])
    expert, in_range = arrays["held_out.expert"], arrays["held_out.in_range"]
    if (
        stamps.dtype != np.int64
        or expert.shape != (n,)
        or in_range.shape != (n,)
        or in_range.dtype != np.bool_
    ):
        raise ValueError("the held-out predictions do not fit each other")
    if expert.dtype.kind != "i" or not ((expert >= 0) & (expert < len(model.names))).all():
        raise ValueError("a held-out prediction of an expert that is not there")
    found = Predictions(mean, variance, function, expert.astype(np.intp), in_range)
    return CrossFittedDistance(model, stamps, _array(arrays, "held_out.boxes_px", (n, 4)), found)


def _expert(arrays: Arrays, prefix: str, d: int) -> GaussianProcess:
    warp = _warp(arrays, f"{prefix}.warp")
    signal, noise, offset = _array(arrays, f"{prefix}.scalars", (3,), positive=warp is None).tolist()
    if not min(signal, noise) > 0.0:  # only the mean of warped distances may be otherwise
        raise ValueError(f"{prefix}: the variances are not positive")
    n = len(arrays[f"{prefix}.weights"])
    factor = np.zeros((n, n))
    factor[np.tril_indices(n)] = _array(arrays, f"{prefix}.factor", (n * (n + 1) // 2,))
    if not (np.diag(factor) > 0.0).all():
        raise ValueError(f"{prefix}: the factor's diagonal is not positive")
    lengths = _array(arrays, f"{prefix}.length_scales", (d,), positive=True)
    return GaussianProcess(
        Hyperparameters(signal, lengths, noise),
        _array(arrays, f"{prefix}.centre", (d,)),
        _array(arrays, f"{prefix}.scale", (d,), positive=True),
        _array(arrays, f"{prefix}.inputs", (n, d)),
        offset,
        factor,
        _array(arrays, f"{prefix}.weights", (n,)),
        _array(arrays, f"{prefix}.lowest", (d,)),
        _array(arrays, f"{prefix}.highest", (d,)),
        warp,
    )


def _warp(arrays: Arrays, name: str) -> Warp | None:
    if name not in arrays:
        return None
    power, scale_m = _array(arrays, name, (2,)).tolist()
    if not (min(POWERS) <= power <= max(POWERS) and RANGE_M[0] <= scale_m <= RANGE_M[1]):
        raise ValueError(f"{name}: power {power:g}, scale {scale_m:g} m")
    return Warp(power, scale_m)


def _array(arrays: Arrays, name: str, shape: tuple[int, ...], *, positive: bool = False) -> Array:
    """The named array, checked: float64, of ``shape``, finite, and positive where it has to be."""
    values = arrays[name]
    if values.dtype != np.float64 or values.shape != shape:
        raise ValueError(f"{name} is {values.dtype} {values.shape}, not float64 {shape}")
    if not np.isfinite(values).all() or (positive and not (values > 0.0).all()):
        raise ValueError(f"{name} holds values that cannot be")
    return np.ascontiguousarray(values)
