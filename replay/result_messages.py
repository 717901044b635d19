"""The messages of a results file: what a step found, believed and got wrong, as ROS 2 messages.

Everything is also there in Foxglove's and ROS's own types where they have one: poses with covariance, log lines.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from scpf.ingest import messages
from scpf.models.association import Match
from scpf.models.instances import Instance
from scpf.models.observation import Distance, Observation
from scpf.models.particle_filter import Belief
from scpf.replay.step import Errors, Frame, Step

Array = NDArray[np.float64]

DEFINITIONS: Final = {
    "scpf_msgs/msg/Observation": """\
# A measured landmark. landmark_id is the match, "" where it was left out for reason. True values are "" and NaN
# where unknown. Variances: distance_variance_m2 predicts a measurement, function_variance_m2 the function alone.
scpf_msgs/Instance instance
float64 distance_m
float64 distance_variance_m2
float64 function_variance_m2
string expert
bool in_range
float64 bearing_rad
string landmark_id
string reason
string true_landmark_id
float64 true_distance_m
""",
    "scpf_msgs/msg/Observations": """\
# All that one image showed; unmeasured are instances without a distance.
std_msgs/Header header
uint32 frame
scpf_msgs/Observation[] observations
scpf_msgs/Instance[] unmeasured
""",
    "scpf_msgs/msg/Belief": """\
# Of the scPF: x, y in map (m), then vx, vy (m/s). covariance is row by row. particles (N × D, row by row) and
# log_weights (N) are empty unless they were asked for.
std_msgs/Header header
uint32 frame
string state
float64 ess
float64 log_evidence
float64[] mean
float64[] covariance
float32[] particles
float32[] log_weights
""",
    "scpf_msgs/msg/Errors": """\
# Position errors against the reference (m); baseline is the unconstrained particle filter.
# longitudinal: along the reference heading; lateral: to its left.
std_msgs/Header header
uint32 frame
float64 position_m
float64 longitudinal_m
float64 lateral_m
float64 baseline_position_m
float64 baseline_longitudinal_m
float64 baseline_lateral_m
""",
    "scpf_msgs/msg/Timing": """\
# Seconds that each stage of one step took.
std_msgs/Header header
uint32 frame
string[] stages
float64[] seconds
""",
}

LEVELS: Final = {"DEBUG": 10, "INFO": 20, "WARN": 30, "WARNING": 30, "ERROR": 40, "CRITICAL": 50, "FATAL": 50}

POSE_WITH_COVARIANCE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"


@lru_cache(maxsize=1)
def register_types() -> None:
    """Add the types of results to the drive log's type store; a second call does nothing."""
    from rosbags.typesys import get_types_from_msg

    types: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        types.update(get_types_from_msg(text, name))
    messages.typestore().register(types)


def to_observations(step: Step) -> Any:
    """scpf_msgs/Observations of a step."""
    stamp_ns = step.frame.stamp_ns
    truths = step.true_landmark_ids or ("",) * len(step.observations)
    rows = zip(step.observations, step.matches, step.true_distances_m, truths, strict=True)
    return messages.make(
        "scpf_msgs/msg/Observations",
        header=messages.to_header(stamp_ns, "camera"),
        frame=step.frame.index,
        observations=[_to_observation(*row) for row in rows],
        unmeasured=_to_instances(stamp_ns, step.unmeasured),
    )


def from_observation(message: Any) -> tuple[Observation, Match]:
    """Observation and match of a scpf_msgs/Observation; ValueError where its mask is damaged."""
    distance = Distance(
        float(message.distance_m),
        float(message.distance_variance_m2),
        float(message.function_variance_m2),
        message.expert,
        bool(message.in_range),
    )
    observation = Observation(messages.from_instance(message.instance), distance, float(message.bearing_rad))
    return observation, Match(message.landmark_id, message.reason)


def to_belief(frame: Frame, belief: Belief, *, particles: bool) -> Any:
    """scpf_msgs/Belief at a frame, with its particles where ``particles``."""
    none = np.zeros(0, dtype=np.float32)
    return messages.make(
        "scpf_msgs/msg/Belief",
        header=messages.to_header(frame.stamp_ns, "map"),
        frame=frame.index,
        state=belief.state,
        ess=belief.ess,
        log_evidence=belief.log_evidence,
        mean=np.array(belief.mean, dtype=np.float64),
        covariance=np.array(belief.covariance, dtype=np.float64).ravel(),
        particles=belief.states.astype(np.float32).ravel() if particles else none,
        log_weights=belief.log_weights.astype(np.float32) if particles else none,
    )


def to_estimate(stamp_ns: int, belief: Belief) -> Any:
    """A belief as PoseWithCovarianceStamped: it faces along its velocity, whose direction has no covariance here."""
    covariance = np.zeros(36)
    covariance[[0, 1, 6, 7]] = belief.covariance[:2, :2].ravel()
    yaw = float(np.arctan2(belief.mean[3], belief.mean[2])) if len(belief.mean) >= 4 else 0.0
    return _to_pose_with_covariance(stamp_ns, belief.mean[:2], yaw, covariance)


def to_gps(stamp_ns: int, position_m: Array, variance_m2: float) -> Any:
    """The rough position that the filters were given, as PoseWithCovarianceStamped."""
    covariance = np.zeros(36)
    covariance[[0, 7]] = variance_m2
    return _to_pose_with_covariance(stamp_ns, position_m, 0.0, covariance)


def to_reference(stamp_ns: int, T_map_body: Array) -> Any:
    """The reference pose as PoseStamped."""
    header, pose = messages.to_header(stamp_ns, "map"), messages.to_pose(T_map_body)
    return messages.make("geometry_msgs/msg/PoseStamped", header=header, pose=pose)


def to_errors(step: Step) -> Any:
    """scpf_msgs/Errors of a step; NaN where there is no reference."""
    unknown = Errors(float("nan"), float("nan"), float("nan"))
    own, baseline = step.errors or unknown, step.baseline_errors or unknown
    return messages.make(
        "scpf_msgs/msg/Errors",
        header=messages.to_header(step.frame.stamp_ns, "map"),
        frame=step.frame.index,
        position_m=own.position_m,
        longitudinal_m=own.longitudinal_m,
        lateral_m=own.lateral_m,
        baseline_position_m=baseline.position_m,
        baseline_longitudinal_m=baseline.longitudinal_m,
        baseline_lateral_m=baseline.lateral_m,
    )


def to_timing(step: Step) -> Any:
    """scpf_msgs/Timing of a step."""
    return messages.make(
        "scpf_msgs/msg/Timing",
        header=messages.to_header(step.frame.stamp_ns, ""),
        frame=step.frame.index,
        stages=list(step.timing_s),
        seconds=np.array(list(step.timing_s.values()), dtype=np.float64),
    )


def to_log(stamp_ns: int, level: str, text: str) -> Any:
    """A note as rcl_interfaces/Log; a level that is not known counts as INFO."""
    return messages.make(
        "rcl_interfaces/msg/Log",
        stamp=messages.to_time(stamp_ns),
        level=LEVELS.get(level.upper(), LEVELS["INFO"]),
        name="scpf",
        msg=text,
        file="",
        function="",
        line=0,
    )


def _to_observation(observation: Observation, match: Match, true_distance_m: float | None, truth: str) -> Any:
    distance = observation.distance
    return messages.make(
        "scpf_msgs/msg/Observation",
        instance=_to_instances(0, (observation.instance,))[0],
        distance_m=distance.mean_m,
        distance_variance_m2=distance.variance_m2,
        function_variance_m2=distance.function_variance_m2,
        expert=distance.expert,
        in_range=distance.in_range,
        bearing_rad=observation.bearing_rad,
        landmark_id=match.landmark_id,
        reason=match.reason,
        true_landmark_id=truth,
        true_distance_m=float("nan") if true_distance_m is None else true_distance_m,
    )


def _to_instances(stamp_ns: int, instances: tuple[Instance, ...]) -> list[Any]:
    found: list[Any] = messages.to_instances(stamp_ns, instances).instances
    return found


def _to_pose_with_covariance(stamp_ns: int, position_m: Array, yaw_rad: float, covariance: Array) -> Any:
    x, y = (float(value) for value in position_m)
    half = (yaw_rad + np.pi) % (2 * np.pi) / 2 - np.pi / 2  # of a yaw in −π … π, so that w ≥ 0
    turn = {"x": 0.0, "y": 0.0, "z": float(np.sin(half)), "w": float(np.cos(half))}
    pose = messages.make(
        "geometry_msgs/msg/Pose",
        position=messages.make("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
        orientation=messages.make("geometry_msgs/msg/Quaternion", **turn),
    )
    inner = messages.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=covariance)
    return messages.make(POSE_WITH_COVARIANCE, header=messages.to_header(stamp_ns, "map"), pose=inner)
