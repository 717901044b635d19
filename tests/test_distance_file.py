"""Distance models on disk: what comes back is what was saved, and files cannot lie."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from distance_scenes import ABOUT, LENS, QUICK, changed, scene, version
from hypothesis import given, settings
from hypothesis import strategies as st

from scpf.models import distance_file
from scpf.models.cross_fitted import CrossFittedDistance
from scpf.models.distance import DistanceModel, Predictions
from scpf.models.distance_fit import fit
from scpf.models.distance_settings import PRESETS
from scpf.models.errors import DamagedError, InputError, MissingError, ScpfError
from scpf.models.features import measure
from scpf.models.instances import Instance


@pytest.fixture(scope="module")
def trained() -> tuple[DistanceModel, list[Instance], np.ndarray]:
    instances, distances = scene()
    model = fit(measure(instances, 1024, 768), distances, PRESETS["paper"], 0, ABOUT)
    return model, instances, distances


def test_the_model_that_ships_still_loads() -> None:
    path = Path(distance_file.__file__).with_name("distance.npz")
    assert version(path) == 1
    model = DistanceModel.load(path)
    assert model.names == ("close", "far")
    (found,) = model.predict([scene(1)[0][0]], 1024, 768)
    assert found is not None


def test_a_file_round_trip_is_bit_equal(
    trained: tuple[DistanceModel, list[Instance], np.ndarray], tmp_path: Path
) -> None:
    model, instances, _ = trained
    model.save(tmp_path / "m.npz")
    again = DistanceModel.load(tmp_path / "m.npz")
    assert again.predict(instances, 1024, 768) == model.predict(instances, 1024, 768)
    assert again.metadata == model.metadata
    assert again.trained_on.landmark_class == "light_pole"
    np.testing.assert_array_equal(again.trained_on.camera_matrix, LENS.matrix)
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]
    assert again.for_frame(0) is again


def test_cross_fitted_distances_answer_for_their_samples_alone(
    trained: tuple[DistanceModel, list[Instance], np.ndarray], tmp_path: Path
) -> None:
    model, instances, _ = trained
    few = instances[:3]
    boxes = np.array([[i.box_px[0], i.box_px[2], i.box_px[1], i.box_px[3]] for i in few])
    held_out = Predictions(
        np.array([11.0, 22.0, 33.0]), np.ones(3), np.full(3, 0.5), np.array([0, 1, 1]), np.ones(3, bool)
    )
    CrossFittedDistance(model, np.array([100, 100, 200]), boxes, held_out).save(tmp_path / "c.npz")
    again = distance_file.load(tmp_path / "c.npz")
    assert isinstance(again, CrossFittedDistance)
    found = again.for_frame(100).predict([few[1], few[2], few[0]], 1024, 768)
    assert [d.mean_m for d in (found[0], found[2]) if d] == [22.0, 11.0]
    assert found[1] is not None
    alone = model.predict([few[2]], 1024, 768)[0]  # a sample, but of another frame
    assert alone is not None
    assert found[1].mean_m == pytest.approx(alone.mean_m)
    assert [d.mean_m for d in again.for_frame(200).predict(few[2:], 1024, 768) if d] == [33.0]
    with pytest.raises(InputError, match="cross-fitted"):
        DistanceModel.load(tmp_path / "c.npz")


@pytest.fixture(scope="module")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    instances, distances = scene(90)
    path = tmp_path_factory.mktemp("model") / "small.npz"
    fit(measure(instances, 1024, 768), distances, QUICK, 0, ABOUT).save(path)
    return path


def test_refusals(small_file: Path, tmp_path: Path) -> None:
    with pytest.raises(MissingError):
        DistanceModel.load(tmp_path / "none.npz")
    with pytest.raises(InputError, match="newer"):
        DistanceModel.load(changed(small_file, header={"version": 99}))
    with pytest.raises(InputError, match="not a distance model"):
        DistanceModel.load(changed(small_file, header={"format": "other"}))
    with pytest.raises(DamagedError):
        DistanceModel.load(changed(small_file, **{"far.weights": np.array([{"a": 1}], dtype=object)}))
    with pytest.raises(DamagedError, match=r"far\.centre"):
        DistanceModel.load(changed(small_file, **{"far.centre": np.full(4, np.nan)}))
    with pytest.raises(DamagedError):
        DistanceModel.load(changed(small_file, **{"close.weights": np.zeros(3)}))
    with pytest.raises(DamagedError):
        DistanceModel.load(changed(small_file, header={"model": {}}))
    text = tmp_path / "text.npz"
    text.write_text("not an archive")
    with pytest.raises(DamagedError):
        DistanceModel.load(text)


@given(st.floats(0.0, 0.999))
@settings(max_examples=25, deadline=None)
def test_a_file_cut_short_is_damaged(small_file: Path, share: float) -> None:
    data = small_file.read_bytes()
    cut = small_file.with_name("cut.npz")
    cut.write_bytes(data[: int(share * len(data))])
    with pytest.raises(DamagedError):
        DistanceModel.load(cut)


@given(st.integers(0, 10**9), st.integers(1, 255))
@settings(max_examples=60, deadline=None)
def test_a_changed_byte_is_no_other_exception(small_file: Path, place: int, by: int) -> None:
    data = bytearray(small_file.read_bytes())
    data[place % len(data)] ^= by
    bad = small_file.with_name("bad.npz")
    bad.write_bytes(data)
    with contextlib.suppress(ScpfError):
        DistanceModel.load(bad)
