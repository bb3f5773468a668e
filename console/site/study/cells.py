"""The cells of a study, each with all that it takes to make it, and what became of it as rows of a table.

A study is described by its file: read strictly, every mistake at once. What it names is not opened yet.
A cell is made in another process, perhaps on another computer: it refers to no file. Its rows depend on
nothing else.
"""

from __future__ import annotations

import io
import pickle
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

from console.escaping import csv_table
from console.session.data.calibrated_chuck import apply_calibrations
from console.session.data.kept_files import jobs_folder, machines_folder
from drivers.cutting.strategy import Strategy
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import TrueParameters, as_simulated
from drivers.simulator.plant.which_lathe import MOUNTED
from profiles.fields import Field, FieldType, fault, read_fields, schema_problem, spell_toml
from profiles.files import printable, read_toml, write_atomically
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError, ProfileError
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
LONGEST_NAME = 1024
MOST_CELLS = 100_000
MOST_PARTS = 100
SEED_LIMIT = 2**32 - 1
STAGES = ("partial", "full")

FIELDS = (
    Field(key="schema", kind=FieldType.WHOLE, at_least=1, at_most=1),
    Field(key="jobs", kind=FieldType.TEXTS, longest=LONGEST_NAME),
    Field(key="machines", kind=FieldType.TEXTS, longest=LONGEST_NAME),
    Field(key="plants", kind=FieldType.TEXTS, longest=LONGEST_NAME, default=("realistic",)),
    Field(key="strategies", kind=FieldType.TEXTS, choices=tuple(map(str, Strategy)), default=("cam",)),
    Field(key="stage", kind=FieldType.CHOICE, choices=STAGES, default="full"),
    Field(key="parts", kind=FieldType.WHOLE, at_least=1, at_most=MOST_PARTS, default=1),
    Field(key="compare", kind=FieldType.CHOICE, choices=("off", "on"), default="off"),
    Field(key="cut_length_mm", above=0.0, at_most=10_000.0, unit="mm", optional=True),
    Field(key="clamping_sd_percent", at_least=0.0, at_most=50.0, unit="%", optional=True),
)
"""Keys of a study besides `seeds`: a list, or a table with `from` and `count`."""

SEED_FIELDS = (
    Field(key="from", kind=FieldType.WHOLE, at_least=0, at_most=SEED_LIMIT, default=1),
    Field(key="count", kind=FieldType.WHOLE, at_least=1, at_most=MOST_CELLS),
)
_SEED = Field(key="seeds", kind=FieldType.WHOLE, at_least=0, at_most=SEED_LIMIT)


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


def pack_cell(cell: Cell) -> bytes:
    """Return a cell as bytes, for `pickle.loads` in another process."""
    written = io.BytesIO()
    _Packer(written).dump(cell)
    return written.getvalue()


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study. A cell is one of each: job, machine, plant, strategy, seed; it makes `parts` in a row.

    More parts than one learn from each other. `compare` cuts a part without compensation, too. `cut_length_mm`
    shortens (or lengthens) the cut of every job.
    """

    jobs: tuple[str, ...]
    machines: tuple[str, ...]
    plants: tuple[str, ...]
    strategies: tuple[str, ...]
    seeds: tuple[int, ...]
    stage: str
    parts: int
    compare: bool
    cut_length_mm: float | None
    clamping_sd_percent: float | None

    @property
    def size(self) -> int:
        """Number of cells."""
        lists = (self.jobs, self.machines, self.plants, self.strategies, self.seeds)
        size = 1
        for each in lists:
            size *= len(each)
        return size


def read_study(path: Path) -> Study:
    """Read a study.

    Raises ProfileError: `file.*`, `schema.*`, `key.*`, `value.*`, `study.*`, every mistake at once.
    """
    _, table = read_toml(path)
    where = printable(str(path))
    if problem := schema_problem(table, where=where):
        raise ProfileError(problem)
    given = {key: value for key, value in table.items() if key != "seeds"}
    values, problems = read_fields(FIELDS, given, where=where)
    seeds, wrong = _seeds(table.get("seeds", {"from": 1, "count": 1}), where)
    problems += wrong
    for key in ("jobs", "machines", "plants", "strategies"):
        problems += _check_list(key, values.get(key), where)
    problems += _check_list("seeds", table.get("seeds"), where) if not wrong else []
    if problems:
        raise ProfileError(*problems)
    values.pop("schema")
    named = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
    study = Study(**{**named, "seeds": seeds, "compare": values["compare"] == "on"})
    if study.size > MOST_CELLS:
        raise ProfileError(
            Problem(code="study.too_large", where=where, value=str(study.size), limit=str(MOST_CELLS))
        )
    return study


def _seeds(found: object, where: str) -> tuple[tuple[int, ...], list[Problem]]:
    if isinstance(found, Mapping):
        values, problems = read_fields(SEED_FIELDS, _texts(found), where=where, prefix="seeds.")
        if problems:
            return (), problems
        first, count = values["from"], values["count"]
        last = first + count - 1
        if last > SEED_LIMIT:
            problem = Problem(
                code="value.out_of_range", where=where, key="seeds", value=str(last), limit=f"<= {SEED_LIMIT}"
            )
            return (), [problem]
        return tuple(range(first, last + 1)), []
    listed = found if isinstance(found, list) else [found]
    problems = [
        Problem(code=code, where=where, key="seeds", value=spell_toml(each), limit=_SEED.limit)
        for each in listed
        if (code := fault(_SEED, each))
    ]
    return (() if problems else tuple(listed)), problems


def _texts(found: Mapping[Any, Any]) -> dict[str, object]:
    return {str(key): value for key, value in found.items()}


def _check_list(key: str, found: object, where: str) -> list[Problem]:
    """Return what is wrong with a list as such: empty, or something twice."""
    if not isinstance(found, list | tuple):
        return []
    if not found:
        return [Problem(code="study.empty_list", where=where, key=key)]
    twice = next((each for each, count in Counter(found).items() if count > 1), None)
    return [] if twice is None else [Problem(code="study.twice", where=where, key=key, value=spell_toml(twice))]


def cells(study: Study, data: Path, beside: Path) -> Iterator[Cell]:
    """Yield the cells in their order: by job, machine, plant, strategy, seed.

    Names are looked up in the data folder and the library; a path is relative to the folder `beside` which the
    study is. What cannot be opened or drawn is in `problems` of its cells.
    """

    @cache
    def job_named(name: str) -> Job:
        job = load_job(_resolve_path(name, beside), jobs_folder(data)).job
        return job if study.cut_length_mm is None else replace(job, cut_length_mm=study.cut_length_mm)

    @cache
    def machine_named(name: str) -> MachineProfile:
        return apply_calibrations(load_machine(_resolve_path(name, beside), machines_folder(data)), data).machine

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
            true = plant_named(_resolve_path(plant, beside), profile, seed, study.clamping_sd_percent)
            yield replace(bare, job=job_named(job), machine=as_simulated(profile, true), true=true)
        except ProblemError as error:
            yield replace(bare, problems=tuple(error.problems))


def _resolve_path(name: str, beside: Path) -> str:
    """Return a path as seen from here; a name stays one."""
    return str(beside / name) if "/" in name or name.endswith(".toml") else name


TABLE, PARQUET = "results.csv", "results.parquet"


def write_table(folder: Path, rows: Sequence[Row]) -> Path:
    """Write the results as CSV; numbers are not rounded. ProfileError `file.not_writable`."""
    path = folder / TABLE
    content = csv_table(COLUMNS, ([_format_value(row[column]) for column in COLUMNS] for row in rows))
    write_atomically(path, content.encode("utf-8", "backslashreplace"), overwrite=True)
    return path


def _format_value(value: Value) -> Value:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else value


def write_parquet(folder: Path, rows: Sequence[Row]) -> Path:
    """Write the results as Parquet, with pyarrow. ProfileError `file.not_writable`."""
    import pyarrow as arrow
    from pyarrow import parquet

    types: dict[type, Any] = {str: arrow.string(), int: arrow.int64(), float: arrow.float64(), bool: arrow.bool_()}
    schema = arrow.schema([(name, types[kind]) for name, kind in COLUMNS.items()])
    written = io.BytesIO()
    parquet.write_table(arrow.Table.from_pylist([dict(row) for row in rows], schema=schema), written)
    path = folder / PARQUET
    write_atomically(path, written.getvalue(), overwrite=True)
    return path
