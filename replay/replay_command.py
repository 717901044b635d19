"""``scpf replay``: from a drive log to a recording, results and a table of figures."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter


def replay(
    logs: tuple[Path, ...] = (),
    /,
    *,
    output: Annotated[Path, Parameter(alias="-o")] = Path(),
    name: str = "",
    preset: Literal["paper", "default", "pf", "ekf"] | None = None,
    config: Path | None = None,
    show_config: bool = False,
    segmenter: str | None = None,
    threshold: float | None = None,
    bfloat16: Annotated[bool | None, Parameter(negative="--no-bfloat16")] = None,
    device: Literal["auto", "cpu", "cuda", "mps"] | None = None,
    distance_model: str | None = None,
    gps: Literal["auto", "log", "emulated", "none"] | None = None,
    no_gps: bool = False,
    gps_sigma: float | None = None,
    seed: int | None = None,
    gps_outage: tuple[str, ...] = (),
    rate: float = float("inf"),
    pace: str = "max",
    late: Literal["drop", "wait"] = "wait",
    step: bool = False,
    start: float = 0.0,
    stop: float = float("inf"),
    duration: float | None = None,
    loop: int = 1,
    images: Literal["embed", "separate", "none"] = "embed",
    surface_terms: Annotated[bool | None, Parameter(negative="--no-surface-terms")] = None,
    timing: bool = False,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Replay drive logs through segmentation, distance prediction and the particle filter.

    Each leaves NAME.rrd (open it with `scpf view`), NAME.results.mcap and NAME.json.

    On a terminal, keys steer it: space pauses and goes on, n is one frame while paused, + and - double and halve the
    pace (from `max`, - is real time), q ends it with whole files of what was done.

    Examples:

        scpf replay sample_logs/ring_road.mcap -o out

        scpf replay drive.mcap -o out --name no-gps --no-gps --segmenter recorded

        scpf replay drive.mcap -o out --rate 13 --gps-outage 20:80

        scpf replay drive.mcap -o out --start 60 --duration 30 --loop 3

    Parameters
    ----------
    logs
        One or more drive logs (MCAP), as `scpf ingest` and `scpf convert` write them; each is a replay of its own.
    output
        Folder for the three files of each; made where it is missing.
    name
        What the files are called; the log's own name by default, and always where there are several.
    preset
        The filter's configuration: the paper's, this project's best (`default`), the plain particle filter, or an
        extended Kalman filter of range and bearing. By default the paper's.
    config
        Settings as TOML (--show-config prints them all), or the NAME.json of an earlier replay, to run it again. What
        is typed beside it counts more.
    show_config
        Print the settings as TOML and stop.
    segmenter
        `polenet` (the default), `thorough` (it looks thrice at each picture, finds more on real streets and takes 3.5
        times as long; `thorough:FILE` with weights of your own), `recorded` (masks that the log holds), or a weights
        file: PoleNet's (.safetensors), or a Mask R-CNN of torchvision or Detectron2 (.pth, .pkl).
    threshold
        Detections of a lower score are left out. By default 0.9, as in the paper.
    bfloat16
        Run the network in bfloat16: faster on CPUs that compute it themselves. Results then differ a little between
        machines.
    device
        Where the network computes; `auto` takes a GPU where there is one. By default the CPU.
    distance_model
        `default` (the one that ships), or a file that `scpf train distance` wrote.
    gps
        Where the rough GPS comes from: the log, the disturbed reference, or nowhere after the start. By default
        (`auto`) the log where it has one, else the reference.
    no_gps
        The same as --gps none.
    gps_sigma
        Standard deviation a axis of the emulated GPS, m. By default 3.
    seed
        Seed of GPS noise and particles: the same seed gives the same results. By default 0.
    gps_outage
        No GPS from A to B, as A:B in seconds after the log's first image; may be given several times.
    rate
        Thin the log's frames to this many a second; by default all are replayed.
    pace
        `max`: as fast as it goes, nothing dropped. `realtime`, or a factor such as 0.5: each frame at its own time.
    late
        At a live pace, a frame that comes later than its interval: run it all the same, or drop it and count it.
    step
        Pause after every frame: n or Enter is the next one, space goes on without stopping.
    start
        Where to begin, seconds after the log's first image.
    stop
        Where to end, seconds after the log's first image.
    duration
        How many seconds to replay from --start on, in place of --stop.
    loop
        Replay that many times over. Each pass after the first has the next seed, and files of its own: NAME.2.rrd ...
    images
        `embed` puts the log's own image bytes into the recording. `separate` puts them into LOG.images.rrd beside it,
        once for all runs of that log and stretch in the folder; `scpf view` opens both. `none` leaves them out. Without
        them the sample drive's recording has a fifth of the size.
    surface_terms
        Also record what each constraint by itself says of every place around the vehicle: road, speed, GPS, the range
        and the bearing of each landmark. The map has a tab for them. From 25 kB more a frame.
    timing
        Also record what each stage took; two runs then differ. The summary has the times in any case.
    overwrite
        Replace files of that name.
    quiet
        No progress on stderr.
    format
        How to print the result on stdout.
    """
    import json

    from scpf.models.errors import UsageError
    from scpf.replay import replay_options as options
    from scpf.replay.controls import HINT, Controls
    from scpf.replay.engine import replay as run
    from scpf.replay.keys import Keyboard
    from scpf.replay.pace import PaceSettings
    from scpf.replay.progress import Progress
    from scpf.replay.replay_table import table
    from scpf.replay.settings import check
    from scpf.replay.settings import preset as settings_of
    from scpf.replay.settings_file import read_settings, to_toml

    settings = settings_of(preset or "paper") if config is None else read_settings(config, preset)
    if no_gps and gps not in (None, "none"):
        raise UsageError(f"--gps {gps} --no-gps: either, or")
    gps = "none" if no_gps else gps
    outages_s = tuple(options.interval(text) for text in gps_outage) or None
    typed = {
        "segmenter": segmenter,
        "score_threshold": threshold,
        "bfloat16": bfloat16,
        "device": device,
        "distance_model": distance_model,
        "seed": seed,
        "surface": replace(settings.surface, **options.given(terms=surface_terms)),
        "gps": replace(settings.gps, **options.given(source=gps, sigma_m=gps_sigma, outages_s=outages_s)),
    }
    settings = replace(settings, **options.given(**typed))
    check(settings)
    if show_config:
        print(to_toml(settings), end="")
        return 0
    window = options.window(start, stop, duration, rate)
    pacing = PaceSettings(options.pace_factor(pace), late)
    jobs = options.jobs(logs, output, name, settings, loop)
    keyboard = Keyboard()
    if step and not keyboard.present:
        raise UsageError("--step takes its keys from a terminal, and there is none")
    for job in jobs:
        if not overwrite:
            job.outputs.refuse_existing()
    output.mkdir(parents=True, exist_ok=True)
    summaries = []
    with keyboard:
        controls = Controls(keyboard, step)
        for job in jobs:
            try:
                with Progress(quiet, controls) as progress:
                    if keyboard.present and job is jobs[0]:
                        progress.say(HINT)
                    summary = run(
                        job.log,
                        job.outputs,
                        job.settings,
                        window,
                        progress.step,
                        record_timing=timing,
                        images=images,
                        pace=pacing,
                        controls=controls,
                    )
            except KeyboardInterrupt:
                partial = job.outputs.recording.with_suffix(".partial.rrd")
                if partial.exists():
                    print(f"scpf: what was replayed so far is in {partial}", file=sys.stderr)
                raise
            summaries.append(summary)
            for warning in summary["warnings"]:
                print(f"scpf: {job.log}: {warning}", file=sys.stderr)
            if format == "text":
                print(table(summary, job.outputs), flush=True)
            if controls.ended:
                break
    if format == "json":
        print(json.dumps(summaries[0] if len(summaries) == 1 else summaries, indent=1))
    return 3 if any(summary["warnings"] for summary in summaries) else 0
