"""How often the debrief names the right cause first, of simulated lathes with one fault each.

Nine kinds of fault, on a lathe that is otherwise `easy`, whose other deviations the seed draws. Parts in a row,
cut with the compensation of the model; then the debrief of the last one. `first`: the fault's own kind is the
likeliest. `wrong`: another kind is stated as sure.

    python -m benchmarks.faulty_plants [--seeds 5] [--first 1] [--parts 3] [--kind KIND ...]
        [--data FOLDER]
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import sys
import tempfile
from collections import Counter
from importlib.resources import files
from pathlib import Path
from random import Random
from typing import Any

from benchmarks.measure import extent, print_table
from console.__main__ import main as console

JOB = "lee-2001-experiment-1"
CUT_MM = 2.0
KINDS: dict[str, tuple[str, str, float, float]] = {
    "clamping": ("chuck", "clamping_sd_percent", 12.0, 25.0),
    "tool": ("tool", "thrust_factor", 0.55, 0.72),
    "gauge": ("gauge", "spindle_error_um", 4.0, 8.0),
    "drift": ("chuck", "lobe_turned_deg_per_part", 1.5, 4.0),
    "backlash": ("tool", "backlash_um", 5.0, 15.0),
    "friction": ("tool", "coulomb_friction_n", 4.0, 6.5),
    "thermal": ("warm-up", "drift_um", 40.0, 100.0),
    "angle": ("chuck", "lobe_turned_deg", 5.0, 12.0),
    "entry": ("cut", "passive_force_share", 1.2, 2.5),
}
"""Table and key of the fault, and its range."""

ALSO = {"gauge": ("spindle",)}
"""Kinds that the same evidence cannot tell from the fault; neither may be stated as sure."""


def plant(kind: str, seed: int) -> tuple[str, float]:
    """Return the text of a faulty plant, and its amount."""
    table, key, low, high = KINDS[kind]
    random = Random(f"{kind} {seed}")
    value = round(random.uniform(low, high), 3)
    spread = f"[spread]\n{key} = 0.0\n" if kind not in ("gauge", "drift", "backlash", "clamping") else ""
    more = f"spindle_error_deg = {random.uniform(-90.0, 90.0):.1f}\n" if kind == "gauge" else ""
    return f'schema = 1\nlike = "easy"\n[{table}]\n{key} = {value}\n{more}{spread}', value


def cut_parts(kind: str, seed: int, parts: int, folder: Path) -> None:
    """Cut the parts of a row into a data folder, unless it has them."""
    if folder.exists():
        return
    folder.mkdir(parents=True)
    own = (files("profiles.library.jobs") / f"{JOB}.toml").read_text(encoding="utf-8")
    job, lathe = folder / "job.toml", folder / "faulty.toml"
    job.write_text(own.replace("cut_length_mm = 8.0", f"cut_length_mm = {CUT_MM}"), encoding="utf-8")
    lathe.write_text(plant(kind, seed)[0], encoding="utf-8")
    words = ["run", str(job), "--sim", "--plant", str(lathe), "--seed", str(seed), "--strategy", "cam", "--json"]
    for part in range(1, parts + 1):
        _said(*words, "--lathe-part", str(part), "--data", str(folder))


def diagnosis(folder: Path) -> dict[str, Any] | None:
    """Return the diagnosis of the last part of a row; None if it was not cut, or is good."""
    newest = json.loads(_said("records", "list", "--json", "--data", str(folder)))["runs"][0]["run"]
    told = json.loads(_said("records", "debrief", newest, "--json", "--data", str(folder)))
    found: dict[str, Any] | None = told["diagnosis"]
    return found


def _said(*words: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()):
        console(list(words))
    return said.getvalue()


def main() -> None:
    """Run and print the table."""
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=extent(5, 1))
    options.add_argument("--first", type=int, default=1, help="the first of the seeds")
    options.add_argument("--parts", type=int, default=3)
    options.add_argument("--kind", nargs="+", choices=KINDS, default=list(KINDS)[-extent(len(KINDS), 1) :])
    options.add_argument("--data", type=Path, help="keep the parts there, or take those that are there")
    asked = options.parse_args()
    rows = []
    for kind in asked.kind:
        first = sure = wrong = 0
        named = Counter[str]()
        for seed in range(asked.first, asked.first + asked.seeds):
            with tempfile.TemporaryDirectory() as folder:
                data = (asked.data or Path(folder)) / f"{kind}-{seed}"
                cut_parts(kind, seed, asked.parts, data)
                found = diagnosis(data)
            best = "none" if found is None else found["best"]
            right = best in (kind, *ALSO.get(kind, ()))
            first, named[best] = first + right, named[best] + 1
            if found is not None and found["sure"]:
                sure, wrong = sure + right, wrong + (not right)
            print(kind, seed, plant(kind, seed)[1], json.dumps(found), file=sys.stderr, flush=True)
        said = ", ".join(f"{name} {count}" for name, count in named.most_common())
        rows.append((kind, str(asked.seeds), str(first), str(sure), str(wrong), said))
    print_table("Faulty plants", ("fault", "plants", "first", "sure", "sure and wrong", "said first"), rows)


if __name__ == "__main__":
    main()
