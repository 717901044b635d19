"""Our records to ROS messages, through CDR, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scpf.ingest import messages
from scpf.ingest.gps_messages import from_fix, to_fix
from scpf.models.camera import Camera
from scpf.models.geodesy import Origin
from scpf.models.instances import Instance, instance_from_mask

ORIGIN = Origin(43.47, -80.54, 330.0)


def through_cdr(message: Any, typename: str) -> Any:
    store = messages.typestore()
    return store.deserialize_cdr(store.serialize_cdr(message, typename), typename)


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_times_round_trip(stamp_ns: int) -> None:
    assert messages.from_time(messages.to_time(stamp_ns)) == stamp_ns


@settings(deadline=None)
@given(
    st.tuples(*[st.floats(-180, 180)] * 3),
    st.tuples(*[st.floats(-1e5, 1e5)] * 3),
)
def test_poses_round_trip(angles: tuple[float, ...], position: tuple[float, ...]) -> None:
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    transform[:3, 3] = position
    pose = through_cdr(messages.to_pose(transform), "geometry_msgs/msg/Pose")
    np.testing.assert_allclose(messages.from_pose(pose.position, pose.orientation), transform, atol=1e-9)


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_instances_round_trip(height: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mask = rng.random((height, width)) < 0.5
    mask[0, 0] = True
    instance = Instance((1.5, 2.0, 30.25, 40.0), mask, (3, 4), 0.5, "sign", "pole-7")
    message = messages.to_instances(123, [instance], [12.5])
    back = through_cdr(message, "scpf_msgs/msg/Instances").instances[0]
    got = messages.from_instance(back)
    assert (got.box_px, got.offset_px, got.score) == (instance.box_px, instance.offset_px, instance.score)
    assert (got.landmark_class, got.landmark_id) == ("sign", "pole-7")
    np.testing.assert_array_equal(got.mask, mask)
    assert back.distance_m == 12.5
    assert np.isnan(back.visible_fraction)


def test_distances_belong_to_instances_one_by_one() -> None:
    with pytest.raises(ValueError, match="zip"):
        messages.to_instances(0, [instance_from_mask(np.ones((2, 2), bool))], [1.0, 2.0])


@pytest.mark.parametrize(("width", "height"), [(3, 3), (2**31, 2**31), (0, 5)])
def test_a_mask_that_lies_about_its_size_is_refused(width: int, height: int) -> None:
    message = messages.to_instances(0, [instance_from_mask(np.ones((2, 2), bool))]).instances[0]
    message.mask_width_px, message.mask_height_px = width, height
    with pytest.raises(ValueError, match=r"mask|run lengths"):
        messages.from_instance(message)


@pytest.mark.parametrize(
    ("model", "count"), [("plumb_bob", 5), ("rational_polynomial", 8), ("equidistant", 4)]
)
def test_cameras_round_trip(model: str, count: int) -> None:
    matrix = np.array([[700.0, 0, 320], [0, 701, 240], [0, 0, 1]])
    camera = Camera(640, 480, matrix, np.arange(count) * 0.01, model)
    info = through_cdr(messages.to_camera_info(5, camera), "sensor_msgs/msg/CameraInfo")
    back = messages.from_camera_info(info, camera.T_body_camera)
    assert (back.width_px, back.height_px, back.distortion_model) == (640, 480, model)
    np.testing.assert_array_equal(back.matrix, matrix)
    np.testing.assert_array_equal(back.distortion, camera.distortion)


def test_fixes_round_trip_to_a_micrometre() -> None:
    position = np.array([812.5, -433.25, 2.0])
    fix = through_cdr(
        to_fix(7, position, np.array([4.0, 5.0, 9.0]), ORIGIN, "gps"), "sensor_msgs/msg/NavSatFix"
    )
    np.testing.assert_allclose(from_fix(fix, ORIGIN), position, atol=1e-6)
    np.testing.assert_array_equal(np.diag(fix.position_covariance.reshape(3, 3)), [4.0, 5.0, 9.0])


def test_definitions_are_complete() -> None:
    text = messages.definition("scpf_msgs/msg/Instances").decode()
    assert "MSG: scpf_msgs/Instance" in text
    assert "MSG: std_msgs/Header" in text
