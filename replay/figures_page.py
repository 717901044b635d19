"""One self-contained HTML page of a replay: its figures, its table of errors, and what ran."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence

import numpy as np

from scpf.replay.recorded_run import RecordedRun
from scpf.replay.summary import statistics

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
img { max-width: 100%; height: auto; } figure { margin: 2rem 0; } figcaption { font-weight: 600; }
table { border-collapse: collapse; } th, td { padding: .3rem .9rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; } pre { background: #f6f6f6; padding: 1rem; overflow-x: auto; }
"""


def page(run: RecordedRun, pictures: Sequence[tuple[str, bytes]]) -> str:
    """The page (HTML) with ``pictures`` (caption, PNG); it loads nothing from anywhere."""
    figures = "\n".join(
        f"<figure><figcaption>{html.escape(caption)}</figcaption>"
        f'<img alt="{html.escape(caption)}" src="data:image/png;base64,{base64.b64encode(png).decode()}"></figure>'
        for caption, png in pictures
    )
    name = html.escape(run.name)
    settings = html.escape(json.dumps(run.configuration, indent=1))
    seconds = run.times_s[-1]
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{name}</title><style>{STYLE}</style></head>
<body>
<h1>{name}</h1>
<p>{len(run.frames)} frames in {seconds:.1f} s, preset <code>{html.escape(run.settings.preset)}</code>, segmenter
<code>{html.escape(run.settings.segmenter)}</code>, seed {run.settings.seed}; {run.poles.mean():.2f} poles a frame.</p>
{_table(run)}
{figures}
<details><summary>Configuration</summary><pre>{settings}</pre></details>
</body></html>
"""


def _table(run: RecordedRun) -> str:
    """Errors against the reference; a sentence where there is none."""
    columns = {
        f"position, {run.settings.preset}": run.errors_m[:, 0],
        "position, plain PF": run.baseline_error_m,
        "longitudinal": run.errors_m[:, 1],
        "lateral": run.errors_m[:, 2],
    }
    rows = []
    for label, values in columns.items():
        found = statistics(list(values))
        if found:
            spread = float(np.nanmedian(np.abs(values)))
            cells = (found["mean"], spread, found["rmse"], found["p95"], found["max"])
            rows.append(
                f"<tr><td>{html.escape(label)}</td>"
                + "".join(f"<td>{cell:.2f}</td>" for cell in cells)
                + "</tr>"
            )
    if not rows:
        return "<p>There is no reference to compare with.</p>"
    head = "".join(f"<th>{each}</th>" for each in ("error, m", "mean", "median |·|", "RMSE", "95 %", "worst"))
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"
