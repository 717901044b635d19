"""The short table that a replay leaves on the terminal."""

from __future__ import annotations

from typing import Any

from scpf.replay.outputs import Outputs


def table(summary: dict[str, Any], outputs: Outputs) -> str:
    """The short table for the terminal, the written files on its last lines."""
    rows = []
    preset = summary["settings"]["preset"]
    for label, key in (
        (f"position error ({preset})", "position"),
        ("plain PF beside it", "baseline_position"),
    ):
        errors = summary["errors"].get(key)
        if errors:
            rows.append(
                f"{label:<24} mean {errors['mean']:.2f} m   median {errors['median']:.2f}"
                f"   95 % {errors['p95']:.2f}   worst {errors['max']:.2f}"
            )
    poles, rate = summary["poles_per_frame"], summary["rate"]
    counted = "   ".join(f"{number}: {count}" for number, count in poles.items())
    rows.append(f"{'poles a frame':<24} {counted}")
    rows.append(
        f"{'rate':<24} {rate['frames_per_s']:.1f} frames/s   {rate['real_time_factor']:.2f} × real time"
    )
    if "latency_median_ms" in rate:
        rows.append(
            f"{'from due to done':<24} median {rate['latency_median_ms']:.0f} ms"
            f"   95 % {rate['latency_p95_ms']:.0f}   worst {rate['latency_max_ms']:.0f}"
            f"   dropped {rate['dropped']}"
        )
    files = [outputs.recording, outputs.results, outputs.summary]
    if "images" in summary:
        files.insert(1, outputs.recording.with_name(summary["images"]))
    return "\n".join([*rows, *map(str, files)])
