"""``scpf simulate``: a drive log of a simulated bus ride past light poles, or a training set of such pictures."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from scpf.replay.status_line import StatusLine


def simulate(
    *,
    output: Annotated[Path, Parameter(alias="-o")],
    labels: Literal["labelme", "coco", "ids"] | None = None,
    count: int | None = None,
    map: Path | None = None,
    start_m: float = 0.0,
    duration: float = 10.0,
    stop_at_m: float | None = None,
    rate: float | None = None,
    seed: int = 0,
    world_seed: int | None = None,
    weather: str = "random",
    width: int | None = None,
    quality: int | None = None,
    map_error: float = 1.5,
    gps_sigma: float = 3.0,
    raw: Path | None = None,
    workers: int = 2,
    overwrite: bool = False,
    quiet: Annotated[bool, Parameter(alias="-q")] = False,
    format: Literal["text", "json"] = "text",
) -> int:
    """Render a bus ride along a road map into a drive log that also holds the truth.

    The log has pictures, calibration, reference, rough GPS, the mask of every pole with its id, and two maps: as
    surveyed (map.geojson) and true (true_map.geojson). The same seed gives the same bytes, however many workers share
    the work. Finished frames lie in NAME.frames until all is written: the same command goes on after an interruption.

    With --labels, a folder of labelled pictures instead, from random places along the road: other poles, weather,
    season and camera at each.

    Examples:

        scpf simulate -o drive.mcap

        scpf simulate -o rain.mcap --weather rain --start-m 1200 --duration 60 --width 1024 --seed 7

        scpf simulate -o campus.mcap --map campus.geojson --map-error 0 --raw campus_raw

        scpf simulate --labels coco --count 2000 -o poles

    Parameters
    ----------
    output
        The drive log to write; with --labels the folder.
    labels
        Write a training set: a JSON of labelme beside each picture, one COCO file, or images of ids for
        `scpf train segmenter`. Poles that are too small, thin or hidden to be judged are marked "ignored".
    count
        Number of its pictures.
    map
        Road map (.geojson of `scpf map from`) to drive along; by default the University of Waterloo's Ring Road.
    start_m
        Where the drive begins, in metres along the centre line.
    duration
        Length of the drive in seconds.
    stop_at_m
        Where the bus stops for some seconds, in metres along the centre line.
    rate
        Pictures a second; 13 unless told. A long drive at 2 has many places for few pictures, as
        `scpf train distance` needs them. Raw files are of a camera at 13.
    seed
        Seed of everything that is drawn.
    world_seed
        Seed of what stands along the road: drives with the same one pass the same poles. By default --seed.
    weather
        clear, cloudy, overcast, rain, lowsun, dusk, or random: one of them, with another sun and haze.
    width
        Width of the pictures in px, a multiple of 4 from 64 to 2048; they are 4:3. 2048 unless told; 1024 in training
        sets, where some pictures are smaller or wide.
    quality
        JPEG quality, 1 to 100; 85 unless told, 90 in training sets.
    map_error
        Mean distance in m of a mapped pole from where it stands, the same all along the drive; 0 for an exact map.
    gps_sigma
        Deviation of the rough GPS in m an axis.
    raw
        Also write the raw files into this new folder: SBET, SMRMSG, GSOF, $GRP in a capture and NMEA, a camera's
        folder, an MP4, a ROS 1 bag and a rosbag2. Without PyAV the MP4 is left out: exit code 3.
    workers
        Rendering processes; each takes some 0.7 GB of memory.
    overwrite
        Replace an existing log, and frames of other settings.
    quiet
        No progress on stderr.
    format
        Form of the report on stdout.
    """
    from dataclasses import asdict

    from scpf.ingest.maps import read_map
    from scpf.models.errors import UsageError
    from scpf.sample_logs.drive_frames import DriveSettings
    from scpf.sample_logs.simulation import DriveReport, frames_folder, simulate_drive
    from scpf.sample_logs.training_places import SetSettings
    from scpf.sample_logs.training_set import SetReport, simulate_set
    from scpf.sample_logs.vehicle import RATE_HZ

    if not 1 <= workers <= 64:
        raise UsageError(f"--workers {workers} is not 1 to 64")
    if (labels is None) != (count is None):
        raise UsageError(
            "--labels and --count go together", "--labels coco --count 2000 -o FOLDER, for example"
        )
    drive_only = {
        "--start-m": start_m != 0.0,
        "--duration": duration != 10.0,
        "--stop-at-m": stop_at_m is not None,
        "--rate": rate is not None,
        "--world-seed": world_seed is not None,
        "--map-error": map_error != 1.5,
        "--gps-sigma": gps_sigma != 3.0,
        "--raw": raw is not None,
    }
    odd = [name for name, is_given in drive_only.items() if is_given]
    if labels is not None and odd:
        raise UsageError(f"{', '.join(odd)}: of drives, not of training sets")
    if rate is not None and raw is not None:
        raise UsageError("--rate and --raw: raw files are of a camera at 13 Hz", "leave one of them out")
    road_map = None if map is None else read_map(map)
    progress = RenderProgress(quiet)
    report: DriveReport | SetReport
    try:
        if labels is not None and count is not None:
            wanted = SetSettings(
                count, seed, weather, 1024 if width is None else width, 90 if quality is None else quality
            )
            report = simulate_set(
                output, wanted, labels, progress, road_map=road_map, workers=workers, overwrite=overwrite
            )
        else:
            width_px, jpeg_quality = 2048 if width is None else width, 85 if quality is None else quality
            settings = DriveSettings(
                start_m,
                duration,
                seed,
                world_seed,
                weather,
                width_px,
                jpeg_quality,
                map_error,
                gps_sigma,
                stop_at_m,
                RATE_HZ if rate is None else rate,
            )
            report = simulate_drive(
                output, settings, progress, road_map=road_map, raw=raw, workers=workers, overwrite=overwrite
            )
    except KeyboardInterrupt:
        progress.say(f"finished frames are kept in {frames_folder(output)}: the same command goes on")
        raise
    finally:
        progress.close()
    left_out = report.left_out if isinstance(report, DriveReport) else []
    if format == "json":
        print(json.dumps(asdict(report), indent=1))
    elif isinstance(report, DriveReport):
        lost = f", {report.dropped} dropped by the camera" if report.dropped else ""
        print(f"{report.path}: {report.frames} frames in {report.duration_s:.3f} s ({report.weather}){lost}")
        print(f"  {report.poles_shown} sightings of poles, {report.poles_mapped} poles in the map")
    else:
        shares = ", ".join(f"{number} {name}" for name, number in report.weathers.items())
        print(f"{report.path}: {report.pictures} pictures ({shares}), {report.poles} labelled poles")
    if format == "text":
        for reason in left_out:
            print(f"  left out: {reason}")
    return 3 if left_out else 0


class RenderProgress:
    """What a rendering says on stderr: lines that stay, and on a terminal one that is redrawn."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._status = StatusLine(quiet)
        self._begun = self._drawn = time.monotonic()

    def say(self, line: str) -> None:
        """A line that stays."""
        if not self._quiet:
            self.close()
            print(line, file=sys.stderr, flush=True)

    def frame(self, done: int, resumed: int, count: int) -> None:
        """Note that ``done`` of ``count`` frames are finished, ``resumed`` of them by an earlier run."""
        now = time.monotonic()
        if done == resumed:
            self._begun = now
            if resumed:
                self.say(f"{resumed} of {count} frames are there already")
            return
        if not self._status.shown or (now - self._drawn < 0.2 and done < count):
            return
        self._drawn = now
        rate = (done - resumed) / max(now - self._begun, 1e-3)
        left_s = (count - done) / rate
        self._status.show(f"frame {done}/{count}  {rate:.2f} frames/s  {left_s:.0f} s left")

    def close(self) -> None:
        """Take the redrawn line away."""
        self._status.clear()
