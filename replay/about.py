"""The About page of a recording."""

from __future__ import annotations

import json
from typing import Any


def about(log_name: str, configuration: dict[str, Any]) -> str:
    """The recording's About page: what ran, and how to read each view."""
    settings = configuration["settings"]
    return f"""# {log_name}

Preset `{settings["preset"]}`, segmenter `{settings["segmenter"]}`, seed {settings["seed"]},
{settings["filter"]["particles"]} particles, GPS `{settings["gps"]["source"]}`, σ = {settings["gps"]["sigma_m"]} m.

## How to read the views
- **Camera**: masks and outlines take the colour of the landmark that they were matched to; grey ones were left out, and
  the label says why. The label gives the predicted distance ± one standard deviation.
- **Distances**: the prediction with its ±1 σ band, and the true distance from the reference beside it.
- **World**: road edges, poles with the circle of the predicted distance, particles by weight (bright = heavy), estimate
  with its 2 σ ellipse, reference, GPS fixes, and the plain particle filter beside it. The **surface** under them is the
  paper's constraint surface Σ max(C, 0) above its minimum, cut at 15 m (dark = every constraint kept); hover to read a
  cell. The other tabs hold the joint log-probability and the whole map; after `--surface-terms` also **each
  constraint**: its own log-probability, from 0 (kept) to −20, and the GPS fix's. *Range 1* is the nearest pole's.
- **Errors**: distance from the reference: total, along and across the road; the plain particle filter for comparison.
- **Filter**: effective sample size and log-evidence. The state lane reads *tracking* (a landmark constrains),
  *unconstrained* (none in sight), *lost* (no particle is near what was observed) or *initialising* (neither a reference
  pose nor a GPS fix has said yet where the drive begins).

## Configuration
```json
{json.dumps(configuration, indent=1)}
```
"""
