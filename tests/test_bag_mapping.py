"""Topic mappings: a bag of each known kind becomes a drive log, and so does one that a user describes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_builders import (
    NAVIGATION_TYPE,
    STEP_NS,
    T0,
    applanix_store,
    camera_info,
    header,
    jpeg,
    navigation,
    watonobus_bag,
)
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from scpf.ingest.bag_mapping import parse_mapping, read_mapping
from scpf.ingest.bag_mappings import BUILT_IN
from scpf.ingest.bag_output import Split
from scpf.ingest.bag_report import Options
from scpf.ingest.bags import convert
from scpf.ingest.drive_log import DriveLog
from scpf.models.errors import InputError, ScpfError, UsageError
from scpf.models.geodesy import Origin, geodetic_from_enu
from scpf.models.trajectory import yaw_of

ROS2 = applanix_store(Stores.ROS2_HUMBLE)


def test_a_watonobus_bag_is_a_drive_log(tmp_path: Path) -> None:
    report = convert([watonobus_bag(tmp_path / "a.bag")], tmp_path / "a.mcap", Options(verify=True))
    assert (report.mapping, report.lossless, report.verified) == ("watonobus", True, True)
    with DriveLog(tmp_path / "a.mcap") as log:
        images = list(log.images())
        assert [image.stamp_ns for image in images] == [T0 + k * STEP_NS for k in range(20)]
        assert bytes(images[3].data) == jpeg(30).tobytes()
        # The images are rectified: P is their camera, and no distortion is left.
        camera = log.camera()
        assert camera is not None
        assert (camera.matrix[0, 0], camera.matrix[1, 2], camera.distortion.any()) == (650.0, 11.0, False)
        trajectory, origin = log.trajectory(), log.origin()
        assert trajectory is not None
        assert origin == Origin(43.47, -80.54, 330.0)
        assert list(trajectory.stamps_ns) == [image.stamp_ns for image in images]
        # 10 m/s for 19 frames of 1/13 s with heading 30°: 30° clockwise from North is 60° from East.
        moved = trajectory.positions_m[-1] - trajectory.positions_m[0]
        np.testing.assert_allclose(moved[:2], 10 * 19 / 13 * np.array([0.5, np.sqrt(0.75)]), atol=0.05)
        assert np.degrees(yaw_of(trajectory.poses()[0])) == pytest.approx(60.0, abs=1e-6)
        # Roll to the right lifts the left side; nose down (pitch −2°) points the x axis down.
        x_axis, y_axis = trajectory.poses()[0][:3, 0], trajectory.poses()[0][:3, 1]
        assert x_axis[2] == pytest.approx(np.sin(np.radians(-2.0)))
        assert y_axis[2] == pytest.approx(np.cos(np.radians(-2.0)) * np.sin(np.radians(1.0)), rel=0.01)
        fix = next(log.messages(["/ins/fix"])).message
        assert (fix.latitude, fix.longitude) == pytest.approx((43.47, -80.54))
        np.testing.assert_allclose(
            np.diag(fix.position_covariance.reshape(3, 3)), [0.04, 0.01, 0.09], rtol=1e-6
        )
        imu = next(log.messages(["/ins/imu"])).message
        assert np.degrees(imu.angular_velocity.z) == pytest.approx(-3.0)
        assert imu.linear_acceleration.y == pytest.approx(-0.2)
        native = next(log.messages(["/lvx_client_node/gsof/49"])).message
        assert native.lla.latitude == 43.47
        assert log.count("/lvx_client_node/gsof/50") == 2
        assert log.count("/pylon_camera_node_center/image_rect/compressed") == 0
    assert (
        report.topics["/pylon_camera_node_center/image_rect/compressed"].renamed_to
        == "/camera/image/compressed"
    )


def test_each_part_of_a_split_is_a_drive_log(tmp_path: Path) -> None:
    source = watonobus_bag(tmp_path / "a.bag", frames=40)
    report = convert([source], tmp_path / "a.mcap", Options(split=Split(duration_s=1.0), verify=True))
    assert (report.verified, len(report.paths), report.derived["/ins/pose"]) == (True, 4, 40)
    for path in report.paths:
        with DriveLog(Path(path)) as log:
            trajectory = log.trajectory()
            assert trajectory is not None
            assert list(trajectory.stamps_ns) == [image.stamp_ns for image in log.images()]
            assert log.origin() == Origin(43.47, -80.54, 330.0)
            assert log.metadata()["scpf_conversion"] == {"inputs": "a.bag", "mapping": "watonobus"}


def test_no_mapping_leaves_the_topics_alone(tmp_path: Path) -> None:
    report = convert([watonobus_bag(tmp_path / "a.bag")], tmp_path / "a.mcap", Options(mapping="none"))
    with DriveLog(tmp_path / "a.mcap") as log:
        assert sorted(log.channels) == sorted(report.topics)
    with pytest.raises(UsageError, match="needs ROS 2"):
        Options("ros1", mapping="watonobus")


@pytest.mark.parametrize("name", ["applanix", "trimble"])
def test_drivers_are_known_by_their_types(tmp_path: Path, name: str) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = {"applanix": NAVIGATION_TYPE, "trimble": "trimble_gsof_msgs/msg/NavigationSolution49"}[name]
    renames = {"applanix_msgs": "trimble_gsof_msgs", "NavigationSolutionGsof49": "NavigationSolution49"}
    types: dict[str, Any] = {}
    for typename, (_, fields) in ROS2.fielddefs.items():
        if typename.startswith("applanix_msgs") and "Performance" not in typename:
            text = ROS2.generate_msgdef(typename, ros_version=2)[0]
            if name == "trimble":
                for old, new in renames.items():
                    typename, text = typename.replace(old, new), text.replace(old, new)
            assert fields
            types.update(get_types_from_msg(text, typename))
    store.register({key: value for key, value in types.items() if key not in store.fielddefs})
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        channel = bag.add_connection("/somewhere/else", kind, typestore=store)
        info = bag.add_connection("/cam/b/camera_info", "sensor_msgs/msg/CameraInfo", typestore=store)
        other = bag.add_connection("/cam/a/camera_info", "sensor_msgs/msg/CameraInfo", typestore=store)
        image = bag.add_connection(
            "/cam/b/image_raw/compressed", "sensor_msgs/msg/CompressedImage", typestore=store
        )
        for k in range(5):
            stamp_ns = T0 + k * STEP_NS
            # This driver stamps with the seconds of the GPS week: no date, so that the record's own time counts.
            message = navigation(ROS2, 302_400 * 10**9, k)
            bag.write(channel, stamp_ns, ROS2.serialize_cdr(message, NAVIGATION_TYPE))
            for topic in (other, info):
                bag.write(topic, stamp_ns, store.serialize_cdr(camera_info(store, stamp_ns), topic.msgtype))
            picture = store.types["sensor_msgs/msg/CompressedImage"](header(store, stamp_ns), "jpeg", jpeg(k))
            bag.write(image, stamp_ns, store.serialize_cdr(picture, image.msgtype))
    report = convert([tmp_path / "bag"], tmp_path / "a.mcap", Options(verify=True))
    assert (report.mapping, report.lossless, report.verified) == (name, True, True)
    assert "camera_info is taken from /cam/b/camera_info, not from /cam/a/camera_info" in report.notes
    with DriveLog(tmp_path / "a.mcap") as log:
        trajectory = log.trajectory()
        assert trajectory is not None
        # Week 2121, 302,400 s and one a record, 18 leap seconds: 2020-09-02T11:59:42Z and after.
        assert list(trajectory.stamps_ns) == [1_599_047_982 * 10**9 + k * 10**9 for k in range(5)]
        camera = log.camera()
        assert camera is not None
        assert (camera.matrix[0, 0], bool(camera.distortion.any())) == (700.0, True)


def plain_bag(path: Path, topic: str = "/odom") -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    make = store.types
    with Writer1(path) as bag:
        odometry = bag.add_connection(topic, "nav_msgs/msg/Odometry", typestore=store)
        fix = bag.add_connection("/sensing/gnss/fix", "sensor_msgs/msg/NavSatFix", typestore=store)
        image = bag.add_connection("/cam/image", "sensor_msgs/msg/Image", typestore=store)
        for k in range(5):
            stamp_ns = T0 + k * STEP_NS
            point = make["geometry_msgs/msg/Point"](float(k), 2.0, 0.0)
            turn = make["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            pose = make["geometry_msgs/msg/PoseWithCovariance"](
                make["geometry_msgs/msg/Pose"](point, turn), np.zeros(36)
            )
            zero = make["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            twist = make["geometry_msgs/msg/TwistWithCovariance"](
                make["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36)
            )
            message = make["nav_msgs/msg/Odometry"](header(store, stamp_ns, "map"), "base_link", pose, twist)
            bag.write(odometry, stamp_ns, store.serialize_ros1(message, odometry.msgtype))
            status = make["sensor_msgs/msg/NavSatStatus"](0, 1)
            message = make["sensor_msgs/msg/NavSatFix"](
                header(store, stamp_ns), status, 43.47, -80.54 + k * 1e-5, 330.0, np.eye(3).ravel(), 2
            )
            bag.write(fix, stamp_ns, store.serialize_ros1(message, fix.msgtype))
            pixels = np.zeros((4, 8, 3), dtype=np.uint8)
            pixels[:, :, 0] = 200
            message = make["sensor_msgs/msg/Image"](
                header(store, stamp_ns), 4, 8, "rgb8", 0, 24, pixels.ravel()
            )
            bag.write(image, stamp_ns, store.serialize_ros1(message, image.msgtype))
    return path


def test_plain_topics(tmp_path: Path) -> None:
    from scpf.replay.frames import decode

    source = plain_bag(tmp_path / "a.bag")
    assert not convert([source], tmp_path / "0.mcap").mapping  # generic topics are mapped only when asked for
    report = convert([source], tmp_path / "a.mcap", Options(mapping="plain"))
    assert report.lossless
    assert any("where the odometry's frame begins is not known" in note for note in report.notes)
    with DriveLog(tmp_path / "a.mcap") as log:
        trajectory = log.trajectory()
        assert trajectory is not None
        np.testing.assert_array_equal(trajectory.positions_m[:, 0], np.arange(5.0))
        assert log.gps() is None
        image = next(log.images())
        assert image.format == "png"
        assert decode(image.data, "")[0, 0].tolist() == [200, 0, 0]
    origin = Origin(43.47, -80.54, 330.0)
    convert([source], tmp_path / "b.mcap", Options(mapping="plain", origin=origin))
    with DriveLog(tmp_path / "b.mcap") as log:
        assert log.origin() == origin
        gps = log.gps()
        assert gps is not None
        latitude, longitude, _ = geodetic_from_enu(np.append(gps[1][4], 0.0), origin)
        assert (latitude[0], longitude[0]) == pytest.approx((43.47, -80.53996))
        assert gps[2][0] == 1.0


def test_a_fix_and_an_imu_are_a_reference(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        imu = bag.add_connection("/ins/imu", "sensor_msgs/msg/Imu", typestore=store)
        fix = bag.add_connection("/ins/fix", "sensor_msgs/msg/NavSatFix", typestore=store)
        for k in range(5):
            stamp_ns = T0 + k * STEP_NS
            turn = make["geometry_msgs/msg/Quaternion"](0.0, 0.0, np.sin(0.1 * k), np.cos(0.1 * k))
            zero = make["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            nine = np.zeros(9)
            message = make["sensor_msgs/msg/Imu"](
                header(store, stamp_ns - 1000), turn, nine, zero, nine, zero, nine
            )
            if k < 4:
                bag.write(imu, stamp_ns - 1000, store.serialize_cdr(message, imu.msgtype))
            status = make["sensor_msgs/msg/NavSatStatus"](0, 1)
            place = (43.47 + k * 1e-5, -80.54, 330.0)
            late_ns = stamp_ns + (10**9 if k == 4 else 0)
            message = make["sensor_msgs/msg/NavSatFix"](header(store, late_ns), status, *place, nine, 0)
            bag.write(fix, late_ns, store.serialize_cdr(message, fix.msgtype))
    (tmp_path / "m.toml").write_text(
        "[[rule]]\ntopic = '/ins/fix'\nto = 'fix'\n[[rule]]\ntopic = '/ins/imu'\nto = 'imu'\n"
    )
    report = convert([tmp_path / "bag"], tmp_path / "a.mcap", Options(mapping=str(tmp_path / "m.toml")))
    assert report.losses == ["/ins/fix cannot become fix (1 messages): no attitude of the Imu within 0.2 s"]
    with DriveLog(tmp_path / "a.mcap") as log:
        trajectory = log.trajectory()
        assert trajectory is not None
        np.testing.assert_allclose(
            [yaw_of(pose) for pose in trajectory.poses()], 0.2 * np.arange(4), atol=1e-9
        )
        np.testing.assert_allclose(trajectory.positions_m[:, 1], 1.111 * np.arange(4), atol=0.01)
        assert log.count("/ins/fix") == 5


def test_autoware(tmp_path: Path) -> None:
    report = convert([plain_bag(tmp_path / "a.bag", "/localization/kinematic_state")], tmp_path / "a.mcap")
    assert (report.mapping, report.derived["/ins/pose"]) == ("autoware", 5)


def test_a_mapping_that_a_user_writes(tmp_path: Path) -> None:
    text = """
name = "ours"
[[rule]]
topic = "re:/lvx.*/49"
to = "navigation"
time = "log"
[rule.fields]
heading_rad = "velocity.east"
height_m = "lla.latitude"
"""
    (tmp_path / "ours.toml").write_text(text)
    source = watonobus_bag(tmp_path / "a.bag")
    report = convert([source], tmp_path / "a.mcap", Options(mapping=str(tmp_path / "ours.toml")))
    assert (report.mapping, report.lossless) == ("ours", True)
    with DriveLog(tmp_path / "a.mcap") as log:
        assert log.origin() == Origin(43.47, -80.54, 43.47)
        trajectory = log.trajectory()
        assert trajectory is not None
        assert yaw_of(trajectory.poses()[0]) == pytest.approx(np.pi / 2 - 5.0 + 2 * np.pi)
    (tmp_path / "ours.toml").write_text(text.replace("velocity.east", "nowhere"))
    report = convert([source], tmp_path / "b.mcap", Options(mapping=str(tmp_path / "ours.toml")))
    assert not report.lossless
    assert "no heading_deg: the message has no number nowhere" in report.losses[0]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("x = [", "is not TOML"),
        ("", "holds no rule"),
        ("[[rule]]\ntopic = '/a'\nto = 'imgae'", "rule 1: to = 'imgae'"),
        ("[[rule]]\ntopic = '/a'", "rule 1: to is missing"),
        ("[[rule]]\ntopik = '/a'\nto = 'image'", "'topik' is not known"),
        ("[[rule]]\ntopic = 're:('\nto = 'image'", "not a regular expression"),
        (
            "[[rule]]\ntopic = '/a'\nto = 'navigation'\n[rule.fields]\nlatitude = 'a'",
            "'latitude' is not known",
        ),
        ("[[rule]]\ntopic = '/a'\nto = 'navigation'\ntime = 'now'", "time = 'now'"),
    ],
)
def test_mistakes_in_a_mapping_are_named(text: str, complaint: str) -> None:
    with pytest.raises(ScpfError, match=complaint.replace("(", r"\(")):
        parse_mapping(text, "x", "x.toml")


def test_mappings_by_name() -> None:
    assert [read_mapping(name).name for name in BUILT_IN] == list(BUILT_IN)
    with pytest.raises(UsageError) as caught:
        read_mapping("watonobos")
    assert caught.value.hint == "did you mean watonobus?"
    with pytest.raises(InputError, match="fits no topic"):
        convert_nothing()


def convert_nothing() -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        convert([plain_bag(Path(folder) / "a.bag")], Path(folder) / "a.mcap", Options(mapping="watonobus"))


def test_the_mapping_in_the_manual(tmp_path: Path) -> None:
    text = (Path(__file__).parent.parent / "docs" / "CONVERT.md").read_text(encoding="utf-8")
    mapping = parse_mapping(text.split("```toml\n")[1].split("```")[0], "x", "docs/CONVERT.md")
    assert [rule.to for rule in mapping.rules] == ["image", "camera_info", "navigation"]
