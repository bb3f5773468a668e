"""How round parts in a row become on a simulated lathe that learns, over many seeds.

RONt (LSC, 50 UPR, free) of the worst of five sections, and CYLt (MZCY) over them, of the first, the third and the
last part in um, as median and worst of the seeds; `mid` is RONt mid-cut of the third. `floor` is the median of
what a perfect controller of the same lathes leaves, that knows how their lobe changes along Z, computed in
`learning_floor`. `worse` counts the seeds whose third part has a larger CYLt than their first.

Each row of parts is told on the error output as it ends.

    python -m benchmarks.learning [--seeds 40] [--first 1] [--parts 10] [--plant realistic] [--clamping-sd 5]
        [--job JOB ...] [--how all|lobe|fixed|before ...] [--fingerprint] [--trial-band]

`--how`: `all` is as the console learns; `constant` has one amplitude along Z, and `middle` learns nothing of the
sections off the middle; `lobe` learns the lobe and its overtones alone; `fixed` has the gains 1 and 0.7 in place
of the optimal ones; `before` both of these; `loop` is `all` with the gains of the tool that `console tune show`
proposes for the first of these lathes; `unwatched` follows no step and no drift between
parts. `--plant` is a preset or a file (docs/plant.md). `--job square` has four jaws, `six` has six, `long` a cut
of 40 mm. With `--fingerprint` an indicator shows each clamping before it is cut, with
`--trial-band` a band of the first part is cut and indicated before the rest.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import statistics
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from benchmarks.designed_loop import MACHINE, machine_text, proposed, sweep
from benchmarks.learning_floor import floor_of
from benchmarks.measure import extent, print_table
from console.__main__ import main as console
from console.session.learning import learning
from console.session.learning.order_learning import LearnHow
from profiles.store import load_job, load_machine

JOBS = ("lee-2001-experiment-1", "two-jaw-tube", "square", "six", "long")
MADE = {
    "square": {"jaws": 4, "lobe_jaws": 4, "lobe_error_um_pp": 20.0},
    "six": {"jaws": 6, "lobe_jaws": 6, "lobe_error_um_pp": 12.0},
    "long": {"overhang_mm": 60.0, "cut_length_mm": 40.0, "lobe_overhang_mm": 60.0, "lobe_error_um_pp": 15.0},
}
"""Jobs that are the first one with another chuck, or longer, at the force of the first one."""

HOWS = {
    "all": LearnHow(),
    "lobe": LearnHow(every_order=False),
    "fixed": LearnHow(optimal=False),
    "before": LearnHow(every_order=False, optimal=False),
    "loop": LearnHow(),
    "constant": LearnHow(along=False),
    "middle": LearnHow(along=False),
    "unwatched": LearnHow(changes=False),
}
CUT_MM = 8.0
DESIGNED_FOR = "realistic", 1
"""Plant and seed of the lathe for which `--how loop` designs gains, by the sweeps of docs/tuning.md."""

OFF = """\
schema = 1
source = "realistic, with a weak amplifier and a wrench that pulled harder"
[tool]
mass_factor = 1.05
thrust_factor = 0.9
coulomb_friction_n = 3.0
current_lag_ms = 0.2
encoder_noise_um = 0.3
[spindle]
speed_ripple_percent = 0.2
radial_error_um_pp = 1.2
[chuck]
lobe_factor = 1.05
[cut]
passive_force_share = 0.4
edge_force_n_per_mm = 7.0
[gauge]
eccentricity_um = 5.0
noise_um = 0.05
"""
"""Realistic, with a gain that is 10 % and a force that is 5 % off."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One row of the table: a job on a plant, and how it learns."""

    job: str
    how: str
    plant: str
    clamping_sd: float | None
    parts: int
    fingerprint: bool = False
    band: bool = False


def machine_file(how: str, folder: Path) -> str:
    """Return the machine: the bundled one, or a file of it with the designed gains, or with one lobe along Z."""
    path = folder / f"{MACHINE}.toml"
    if how == "loop":
        path.write_text(machine_text(designed()), encoding="utf-8")
    elif how == "constant":
        own = (files("profiles.library.machines") / f"{MACHINE}.toml").read_text(encoding="utf-8")
        path.write_text(own.replace("[chuck]\n", '[chuck]\nlobe_along = "one"\n'), encoding="utf-8")
    else:
        return MACHINE
    return str(path)


@cache
def designed() -> dict[str, float]:
    """Return the gains that `console tune show` proposes for one lathe: the same for all seeds of a row."""
    plant, seed = DESIGNED_FOR
    with tempfile.TemporaryDirectory() as data:
        sweep(plant, seed, Path(data))
        settings: dict[str, float] = proposed(Path(data))["settings"]
    return settings


def _changed(own: Traversable, changed: Mapping[str, object]) -> str:
    lines = []
    for line in own.read_text(encoding="utf-8").splitlines():
        key = line.partition("=")[0].strip()
        lines.append(f"{key} = {changed[key]}\n" if key in changed else f"{line}\n")
    return "".join(lines)


def job_file(name: str, folder: Path) -> Path:
    """Write a job with a shorter cut: a bundled one, or one of those that are `MADE`."""
    own = files("profiles.library.jobs") / f"{JOBS[0] if name in MADE else name}.toml"
    path = folder / f"{name}.toml"
    path.write_text(_changed(own, {"cut_length_mm": CUT_MM, **MADE.get(name, {})}), encoding="utf-8")
    return path


def run(row: Row, seed: int) -> dict[str, Any] | None:
    """Return the result of one row of parts, as `console run --json` gives it, with its computed floor.

    None where the row was ended before its last part; the console has said why on stderr.
    """
    learning.HOW = replace(HOWS[row.how], fingerprint=row.fingerprint, band=row.band)
    said = io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(said):
        path, lathe = job_file(row.job, Path(folder)), machine_file(row.how, Path(folder))
        words = [
            "run",
            str(path),
            "--machine",
            lathe,
            "--sim",
            "--plant",
            row.plant,
            "--seed",
            str(seed),
            "--strategy",
            "cam",
        ]
        if row.clamping_sd is not None:
            words += ["--clamping-sd", f"{row.clamping_sd:g}"]
        code = console([*words, "--learn", str(row.parts), "--json", "--data", folder])
        job, machine = load_job(str(path)).job, load_machine(lathe).machine
    if code:
        print(f"{row.job}, {row.how}, seed {seed}: ended, exit code {code}", file=sys.stderr, flush=True)
        return None
    floor = floor_of(job, machine, row.plant, seed, row.clamping_sd)
    result = {**json.loads(said.getvalue()), "floor": floor}
    parts = " ".join(f"{part['RONt_um']:.2f}/{part['CYLt_um']:.2f}" for part in result["passes"])
    floors = f"{floor.ront_um:.2f}/{floor.cylt_um:.2f}"
    print(f"{row.job}, {row.how}, seed {seed}: {parts}; floor {floors}", file=sys.stderr, flush=True)
    return result


def cells(row: Row, rows: Sequence[dict[str, Any] | None]) -> tuple[str, ...]:
    """Return the row of the table."""
    results = [each for each in rows if each is not None]
    if not results:
        return (row.job, row.how, *["-"] * 10, f"{len(rows)} of {len(rows)}")
    third = min(2, row.parts - 1)
    of = [result["passes"] for result in results]
    worst = [[max(s["RONt_um"] for s in parts[at]["sections"]) for parts in of] for at in (0, third, -1)]
    whole = [[float(parts[at]["CYLt_um"]) for parts in of] for at in (0, third, -1)]
    floors = [result["floor"] for result in results]
    worse = sum(after > first for first, after in zip(whole[0], whole[1], strict=True))
    return (
        row.job,
        row.how,
        _spread([float(parts[third]["RONt_um"]) for parts in of]),
        *map(_spread, worst),
        f"{statistics.median(each.worst_um for each in floors):.2f}",
        *map(_spread, whole),
        f"{statistics.median(each.cylt_um for each in floors):.2f}",
        f"{worse} of {len(results)}",
        f"{len(rows) - len(results)} of {len(rows)}",
    )


def _spread(values: Sequence[float]) -> str:
    return f"{statistics.median(values):.2f} / {max(values):.2f}"


def main() -> None:
    """Run and print the table."""
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=extent(40, 1))
    options.add_argument("--first", type=int, default=1, help="the first of the seeds")
    options.add_argument("--parts", type=int, default=extent(10, 2))
    options.add_argument("--plant", default="realistic")
    options.add_argument("--clamping-sd", type=float)
    options.add_argument("--job", nargs="+", default=JOBS[: extent(len(JOBS), 1)])
    options.add_argument("--how", nargs="+", choices=HOWS, default=["all"])
    options.add_argument("--fingerprint", action="store_true")
    options.add_argument("--trial-band", action="store_true")
    asked = options.parse_args()
    rows = []
    if "loop" in asked.how:
        designed()  # once, before the processes that share it are made
    with ProcessPoolExecutor() as pool:
        for job in asked.job:
            for how in asked.how:
                row = Row(
                    job=job,
                    how=how,
                    plant=asked.plant,
                    clamping_sd=asked.clamping_sd,
                    parts=asked.parts,
                    fingerprint=asked.fingerprint,
                    band=asked.trial_band,
                )
                rows.append(
                    cells(row, list(pool.map(partial(run, row), range(asked.first, asked.first + asked.seeds))))
                )
    head = ("job", "how", "mid", "RONt first", "third", "last", "floor", "CYLt first", "third", "last", "floor")
    print_table(f"{asked.plant}: um, median / worst", (*head, "worse", "ended"), rows)


if __name__ == "__main__":
    main()
