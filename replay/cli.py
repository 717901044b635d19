"""The command line: every command, and the one place where errors become a line and an exit code.

Exit codes: 0 done; 1 an error; 2 wrong usage; 3 finished, but something was skipped or lost; 130 interrupted.
Commands are named by import path and loaded when they are called: ``scpf --help`` imports none of them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final

from cyclopts import App, CycloptsError, Group, Parameter

from scpf.models.errors import ScpfError

COMMANDS: Final = (
    # group, name, where it lives, what the list of commands says of it
    ("Replay", "replay", "replay_command:replay", "Replay a drive log into a recording and results."),
    ("Replay", "view", "view_commands:view", "Open a recording in the Rerun viewer."),
    (
        "Replay",
        "screenshot",
        "view_commands:screenshot",
        "Render frames of a recording to PNG, without a screen.",
    ),
    (
        "Replay",
        "figures",
        "figures_command:figures",
        "A replay's plots as PNG files and one HTML page.",
    ),
    (
        "Replay",
        "evaluate",
        "evaluate_command:evaluate",
        "Compare estimators in Monte Carlo runs of a simulated drive.",
    ),
    (
        "Drive logs",
        "ingest",
        "ingest_commands:ingest",
        "Images, trajectory, calibration and map become a drive log.",
    ),
    (
        "Drive logs",
        "calibrate",
        "calibrate_command:calibrate",
        "Pictures of a chessboard become a calibration.",
    ),
    (
        "Drive logs",
        "simulate",
        "simulate_command:simulate",
        "Render a simulated bus ride, with the truth, as a drive log.",
    ),
    ("Drive logs", "convert", "convert_command:convert", "Convert ROS bags to MCAP."),
    ("Drive logs", "info", "ingest_commands:info", "What a log holds: topics, counts, rates, gaps."),
    ("Drive logs", "doctor", "doctor_command:doctor", "What is wrong with a log, or with this machine."),
    ("Drive logs", "recover", "recover_command:recover", "Save what can be read of a damaged log."),
    ("Drive logs", "label", "label_command:label", "Suggest masks on frames, as labelme files to correct."),
    (
        "Drive logs",
        "export",
        "export_command:export",
        "A trajectory as TUM, EuRoC or KITTI; PoleNet as ONNX.",
    ),
)
SUBCOMMANDS: Final = (
    # group and its help, then name, where it lives and help of each command
    (
        ("train", "Fit the models of a new camera or site."),
        ("distance", "training_commands:train_distance", "Fit the distance experts to drive logs."),
        ("segmenter", "segmenter_commands:train_segmenter", "Train the small segmentation network."),
    ),
    (
        ("map", "Make road maps."),
        ("from", "map_commands:map_from", "OpenStreetMap, GeoJSON, KML, CSV or points become a road map."),
        ("survey", "survey_command:map_survey", "Put landmarks where drives with reference poses saw them."),
    ),
)


def build_app(tokens: Sequence[str] = ()) -> App:
    """The ``scpf`` command with all its commands, none of them imported.

    A command named in ``tokens`` is described by its own docstring, the others by the line in the table.
    """
    from importlib.metadata import version

    app = App(
        name="scpf",
        version=version("scpf"),
        help="Replay drive logs through a soft-constrained particle filter; review every frame in Rerun.",
        result_action="return_value",
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(negative=()),  # no --no-overwrite, no --empty-logs
    )
    groups = {title: Group.create_ordered(title) for title in ("Replay", "Drive logs", "Models and maps")}
    for group, name, path, text in COMMANDS:
        app.command(f"scpf.replay.{path}", name=name, group=groups[group], **_listed(name, text, tokens))
    for (group, group_text), *commands in SUBCOMMANDS:
        sub = App(name=group, help=group_text, group=groups["Models and maps"])
        for name, path, text in commands:
            sub.command(f"scpf.replay.{path}", name=name, **_listed(name, text, tokens))
        app.command(sub)
    return app


def _listed(name: str, text: str, tokens: Sequence[str]) -> dict[str, str]:
    return {} if name in tokens else {"help": text}


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the console command; leaves through SystemExit."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    verbose = "-vv" in tokens
    sys.exit(run([token for token in tokens if token != "-vv"], verbose))


def run(tokens: Sequence[str], verbose: bool = False) -> int:
    """Run one command; returns its exit code. ``verbose`` prints the traceback of an error, too."""
    app = build_app(tokens)
    try:
        result = app(tokens, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        first = " ".join(str(error).split())
        return _complain(first, f"scpf {' '.join(tokens[:1])} --help".replace("  ", " "), 2)
    except ScpfError as error:
        if verbose:
            raise
        return _complain(error.message, error.hint, error.exit_code)
    except KeyboardInterrupt:
        return _complain("interrupted", "", 130)
    except BrokenPipeError:  # the reader of our output went away: `scpf info LOG | head`
        sys.stderr.close()
        return 0
    except OSError as error:
        if verbose:
            raise
        return _complain(f"{error.filename or ''}: {error.strerror or error}".lstrip(": "), "", 1)
    return result if isinstance(result, int) else 0


def _complain(message: str, hint: str, code: int) -> int:
    """Print the error as one line and its hint as another; names out of files cannot steer the terminal."""
    for prefix, text in (("scpf: ", message), ("      ", hint)):
        if text:
            plain = "".join(letter if letter.isprintable() else "\ufffd" for letter in text)
            print(prefix + plain, file=sys.stderr)
    return code
