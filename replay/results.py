"""The results: the numbers of every step as MCAP, for Foxglove, ROS tools and the evaluation; and their summary."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from scpf.ingest.drive_log import DriveLogWriter
from scpf.ingest.topics import MAP_ATTACHMENT, SCPF_METADATA
from scpf.replay import result_messages as to
from scpf.replay.step import Step
from scpf.replay.summary import Tally, json_safe, summarise

OBSERVATIONS_TOPIC: Final = "/scpf/observations"
ESTIMATE_TOPIC: Final = "/scpf/estimate"
BASELINE_TOPIC: Final = "/scpf/baseline"
BELIEF_TOPIC: Final = "/scpf/belief"
ERRORS_TOPIC: Final = "/scpf/errors"
TIMING_TOPIC: Final = "/scpf/timing"
LOG_TOPIC: Final = "/scpf/log"
REFERENCE_TOPIC: Final = "/scpf/reference"
GPS_TOPIC: Final = "/scpf/gps"

CONFIGURATION_ATTACHMENT: Final = "configuration.json"


class Results:
    """Writes ``NAME.results.mcap``, called ``NAME.results.mcap.partial`` until it is whole.

    ``configuration`` is what ran: settings, versions, seed, hash of the log. With ``particles``, every particle is
    kept too, which makes the file some ten times as large.
    """

    def __init__(
        self,
        path: Path,
        configuration: Mapping[str, Any],
        geojson: Mapping[str, Any] | None = None,
        *,
        particles: bool = False,
    ) -> None:
        to.register_types()
        self.path = path
        self._configuration = dict(configuration)
        self._geojson = geojson
        self._particles = particles
        self._tally = Tally()
        # Whoever asks for results has dealt with a file of that name already.
        self._log = DriveLogWriter(path, overwrite=True)

    def __enter__(self) -> Self:
        self._log.__enter__()
        configuration = json_safe(self._configuration)
        self._attach(CONFIGURATION_ATTACHMENT, "application/json", configuration)
        if self._geojson is not None:
            self._attach(MAP_ATTACHMENT, "application/geo+json", self._geojson)
        self._log.metadata(SCPF_METADATA, {"kind": "results"})
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._log.__exit__(kind, error, trace)

    def log(self, step: Step) -> None:
        """Add one step at its frame's stamp."""
        frame = step.frame
        stamp_ns = frame.stamp_ns
        write = self._log.write_message
        write(OBSERVATIONS_TOPIC, "scpf_msgs/msg/Observations", to.to_observations(step), stamp_ns)
        for topic, belief in ((ESTIMATE_TOPIC, step.belief), (BASELINE_TOPIC, step.baseline)):
            if belief is not None:
                write(topic, to.POSE_WITH_COVARIANCE, to.to_estimate(stamp_ns, belief), stamp_ns)
        if step.belief is not None:
            message = to.to_belief(frame, step.belief, particles=self._particles)
            write(BELIEF_TOPIC, "scpf_msgs/msg/Belief", message, stamp_ns)
        write(TIMING_TOPIC, "scpf_msgs/msg/Timing", to.to_timing(step), stamp_ns)
        if frame.T_map_body is not None:
            reference = to.to_reference(stamp_ns, frame.T_map_body)
            write(REFERENCE_TOPIC, "geometry_msgs/msg/PoseStamped", reference, stamp_ns)
        if frame.gps_m is not None:
            gps = to.to_gps(stamp_ns, frame.gps_m, frame.gps_variance_m2)
            write(GPS_TOPIC, to.POSE_WITH_COVARIANCE, gps, stamp_ns)
        if step.errors is not None or step.baseline_errors is not None:
            write(ERRORS_TOPIC, "scpf_msgs/msg/Errors", to.to_errors(step), stamp_ns)
        for level, text in step.notes:
            write(LOG_TOPIC, "rcl_interfaces/msg/Log", to.to_log(stamp_ns, level, text), stamp_ns)
        self._tally.add(step)

    def summary(self) -> dict[str, Any]:
        """Statistics of the steps so far, and the configuration; plain values that are valid JSON."""
        return summarise(self._tally, self._configuration)

    def _attach(self, name: str, media_type: str, document: Any) -> None:
        self._log.attach(name, media_type, json.dumps(document, allow_nan=False).encode())
