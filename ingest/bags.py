"""ROS bags to MCAP: ROS 1 bags, rosbag2 recordings and MCAP files become one MCAP, of ROS 2 messages or of ROS 1's own.

Recordings are merged by log time; on equal times the order of the inputs, then that of recording, is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Final

from scpf.ingest.bag_mapping import Candidate, Rule, assign, detect, made_by, read_mapping
from scpf.ingest.bag_output import BagOutput
from scpf.ingest.bag_plan import Plan, make_plan
from scpf.ingest.bag_report import ConversionReport, Options, TopicReport
from scpf.ingest.bag_source import BagSource
from scpf.ingest.bag_sources import Mcap, open_sources
from scpf.ingest.bag_types import header_sequence
from scpf.ingest.topics import FRAME_METADATA, IMAGE_TOPIC, MAP_ATTACHMENT
from scpf.models.errors import InputError, UsageError

if TYPE_CHECKING:
    from scpf.ingest.bag_derive import Derivation
    from scpf.models.geodesy import Origin

CONVERSION_METADATA: Final = "scpf_conversion"

Progress = Callable[[int, int], None]


def convert(
    inputs: Sequence[Path], output: Path, options: Options | None = None, progress: Progress | None = None
) -> ConversionReport:
    """Convert recordings, merged by log time, to the MCAP ``output``.

    Log times, order and counts are kept; publish times and sequence numbers too where the input has them (MCAP;
    ``seq`` of ROS 1 headers). A topic that cannot be converted is left out, with its reason in the report; so is
    what of a recording cannot be read. Raises InputError where no topic matches, or none can be converted, and
    DamagedError for a recording that gives nothing: what was written stays in ``output``.partial.
    """
    options = options or Options()
    if not inputs:
        raise UsageError("no recording to convert")
    report = ConversionReport(str(output), encoding=options.encoding)
    road_map, origin = _road_map(options)
    with ExitStack() as stack:
        named = [source for path in inputs for source in open_sources(path, stack)]
        sources = [source for _, source in named]
        plan = make_plan(sources, options, report)
        rules = _rules(plan, options, report)
        with BagOutput(
            output, profile=options.encoding, compression=options.compression, split=options.split,
            overwrite=options.overwrite,
        ) as out:  # fmt: skip
            plan.open_channels(
                out, {topic: rule for topic, rule in rules.items() if _renamed(plan, topic, rule)}
            )
            if road_map is not None:
                out.attachments.append((MAP_ATTACHMENT, "application/geo+json", road_map))
            _extras(sources, out)
            derivation = _derivation(out, origin, rules)
            if road_map is not None and origin is None:
                report.notes.append(
                    "the map is not georeferenced: whether the poses lie on it is for you to see to"
                )
            inputs_named = {"inputs": ", ".join(name for name, _ in named), "mapping": report.mapping}
            out.describe(CONVERSION_METADATA, inputs_named)
            if derivation is not None:
                out.before_end = derivation.complete_part
            _copy(plan, out, derivation, rules, report, progress)
            chosen = any(topic.counted for topic in report.topics.values())
            if chosen and not any(topic.read for topic in report.topics.values()) and plan.ranged:
                raise InputError(
                    "no message lies between --start and --end", "they count from the first message, in s"
                )
            if derivation is not None:
                derivation.finish()
                origin = derivation.origin
                report.losses += derivation.losses
                report.notes += derivation.notes
                report.derived = derivation.counts
            _describe(named, origin, out, report)
        report.paths = [str(path) for path in out.paths]
        report.notes += [f"{name} is left from an earlier run" for name in out.stale_parts()]
        if not plan.ranged:
            _count(report.topics.values())
        if options.verify:
            from scpf.ingest.bag_verify import verify

            verify(plan, out.paths, report)
    return report


def _road_map(options: Options) -> tuple[bytes | None, Origin | None]:
    """The road map to attach, and the origin of ``map``, as far as they are given."""
    if options.road_map is None:
        return None, options.origin
    from scpf.ingest.maps import encode_map, read_map

    road_map = read_map(options.road_map)
    return encode_map(road_map), options.origin or road_map.origin


def _derivation(out: BagOutput, origin: Origin | None, rules: dict[str, Rule]) -> Derivation | None:
    """What makes the drive log's topics; it is loaded only where there are any to make."""
    if not rules:
        return None
    from scpf.ingest.bag_derive import Derivation

    derivation = Derivation(out, origin)
    derivation.prepare(rules)
    return derivation


def _rules(plan: Plan, options: Options, report: ConversionReport) -> dict[str, Rule]:
    """Which rule of the mapping takes which topic."""
    if options.mapping == "none" or options.encoding == "ros1":
        return {}
    candidates = sorted(
        {
            Candidate(route.report.topic, route.passage.type)
            for route in plan.routes.values()
            if route.passage.store
        },
        key=lambda c: (c.topic, c.type),
    )
    mapping = detect(candidates) if options.mapping == "auto" else read_mapping(options.mapping)
    if mapping is None:
        return {}
    taken, notes = assign(mapping, candidates)
    if not taken:
        raise InputError(
            f"the mapping {mapping.name} fits no topic", f"topics: {', '.join(sorted(report.topics))}"
        )
    report.mapping = mapping.name
    report.notes += notes
    rules = {}
    for candidate, rule in taken.items():
        there = [name for name in made_by(rule) if name in report.topics and name != candidate.topic]
        if there:
            report.notes.append(
                f"{candidate.topic} is not mapped: the recording has {', '.join(there)} already"
            )
        else:
            rules[candidate.topic] = rule
    return rules


def _renamed(plan: Plan, topic: str, rule: Rule) -> bool:
    """Whether a topic's messages are the drive log's as they are: encoded images, which nobody wants twice."""
    types = {route.passage.type for route in plan.routes.values() if route.report.topic == topic}
    taken = {route.report.topic for route in plan.routes.values()}
    return (
        rule.to == "image"
        and types == {"sensor_msgs/msg/CompressedImage"}
        and IMAGE_TOPIC not in taken - {topic}
    )


def _extras(sources: Sequence[BagSource], out: BagOutput) -> None:
    """Attachments and metadata of MCAP inputs; of two with one name, the first input's."""
    for source in sources:
        if isinstance(source, Mcap):
            known = {name for name, _, _ in out.attachments}
            out.attachments += [entry for entry in source.attachments() if entry[0] not in known]
            for name, values in source.metadata():
                out.metadata.setdefault(name, values)


def _copy(
    plan: Plan,
    out: BagOutput,
    derivation: Derivation | None,
    rules: dict[str, Rule],
    report: ConversionReport,
    progress: Progress | None,
) -> None:
    total = sum(topic.counted for topic in report.topics.values())
    derived = {topic: rule for topic, rule in rules.items() if not report.topics[topic].renamed_to}
    done = 0
    for route, message in plan.messages():
        if progress is not None:
            done += 1
            progress(done, total)
        topic, passage = route.report, route.passage
        topic.read += 1
        data = message.data
        sequence = message.sequence
        try:
            if passage.convert is not None:
                if sequence is None and passage.counted_header:
                    sequence = header_sequence(data)
                data = passage.convert(data)
        except InputError as error:
            lost = topic.read - topic.written
            topic.problem = f"{lost} messages left out, the last at {message.log_time_ns} ns: {error.message}"
            continue
        assert route.channel is not None
        out.write(route.channel, message.log_time_ns, data, message.publish_time_ns, sequence)
        topic.written += 1
        if derivation is not None and topic.topic in derived:
            derivation.take(route, derived[topic.topic], message.log_time_ns, data)


def _describe(
    named: Sequence[tuple[str, BagSource]], origin: Origin | None, out: BagOutput, report: ConversionReport
) -> None:
    """What the report and the output's metadata say of the whole."""
    for name, source in named:
        report.losses += [f"{name}: {loss}" for loss in source.losses]
    if origin is not None and (report.mapping or FRAME_METADATA not in out.metadata):
        out.describe(FRAME_METADATA, {name: repr(float(value)) for name, value in origin._asdict().items()})
    lost = {f"lost {topic.topic}": topic.problem for topic in report.topics.values() if topic.problem}
    lost |= {f"lost {k}": text for k, text in enumerate(report.losses, 1)}
    out.describe(CONVERSION_METADATA, {**out.metadata[CONVERSION_METADATA], **lost})


def _count(topics: Iterable[TopicReport]) -> None:
    """Say where a recording counts other messages than it holds."""
    for topic in topics:
        if topic.read != topic.counted and not topic.problem:
            topic.problem = f"the recording counts {topic.counted} messages and holds {topic.read}"
