"""The cells of a study, each with all that it takes to make it, and what became of it as rows of a table.

A cell is made in another process, perhaps on another computer: it refers to no file. Its rows depend on
nothing else.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

from console.session.data.calibrated_chuck import calibrated
from console.session.data.kept_files import jobs_folder, machines_folder
from console.site.study.description import Study
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import TrueParameters
from drivers.simulator.plant.which_lathe import MOUNTED
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.store import load_job, load_machine

MADE, REFUSED, FAULT = "made", "refused", "fault"
"""What became of a cell: its parts are measured; refused or stopped, with the code; or a fault of the program."""

Value = str | int | float | bool | None
Row = dict[str, Value]

COLUMNS: dict[str, type] = {
    "cell": int,
    "job": str,
    "machine": str,
    "plant": str,
    "strategy": str,
    "seed": int,
    "part": int,
    "outcome": str,
    "reason_code": str,
    "reason": str,
    "ront_um": float,
    "tolerance_um": float,
    "within_tolerance": bool,
    "before_ront_um": float,
    "lobe_um_pp": float,
    "mean_deviation_um": float,
    "tool_error_um": float,
    "tool_error_rms_um": float,
    "following_error_um": float,
    "spindle_rpm": float,
    "cut_duration_s": float,
    "collisions": str,
}
"""Columns of the results, with their types; an empty place is not known, or does not apply."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One cell. `problems` are why it cannot be made; then there may be no `job`, `machine` or `true` plant."""

    number: int
    names: Row
    strategy: str
    stage: str
    parts: int
    compare: bool
    job: Job | None = None
    machine: MachineProfile | None = None
    true: TrueParameters | None = None
    problems: tuple[Problem, ...] = field(default=())


def _read_only(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(values)


class _Packer(pickle.Pickler):
    def reducer_override(self, value: Any) -> Any:
        """Pass read-only tables on as what they are made of."""
        return (_read_only, (dict(value),)) if isinstance(value, MappingProxyType) else NotImplemented


def packed(cell: Cell) -> bytes:
    """Return a cell as bytes, for `pickle.loads` in another process."""
    written = io.BytesIO()
    _Packer(written).dump(cell)
    return written.getvalue()


def cells(study: Study, data: Path, beside: Path) -> Iterator[Cell]:
    """Yield the cells in their order: by job, machine, plant, strategy, seed.

    Names are looked up in the data folder and the library; a path is relative to the folder `beside` which the
    study is. What cannot be opened or drawn is in `problems` of its cells.
    """

    @cache
    def job_named(name: str) -> Job:
        job = load_job(_placed(name, beside), jobs_folder(data)).job
        return job if study.cut_length_mm is None else replace(job, cut_length_mm=study.cut_length_mm)

    @cache
    def machine_named(name: str) -> MachineProfile:
        return calibrated(load_machine(_placed(name, beside), machines_folder(data)), data).machine

    combined = product(study.jobs, study.machines, study.plants, study.strategies, study.seeds)
    for number, (job, machine, plant, strategy, seed) in enumerate(combined, start=1):
        names: Row = {"job": job, "machine": machine, "plant": plant, "strategy": strategy, "seed": seed}
        bare = Cell(
            number=number,
            names=names,
            strategy=strategy,
            stage=study.stage,
            parts=study.parts,
            compare=study.compare,
        )
        try:
            if plant == MOUNTED:
                raise ProblemError(Problem(code="study.mounted", value=plant))
            profile = machine_named(machine)
            true = plant_named(_placed(plant, beside), profile, seed, study.clamping_sd_percent)
            yield replace(bare, job=job_named(job), machine=profile, true=true)
        except ProblemError as error:
            yield replace(bare, problems=tuple(error.problems))


def _placed(name: str, beside: Path) -> str:
    """Return a path as seen from here; a name stays one."""
    return str(beside / name) if "/" in name or name.endswith(".toml") else name
