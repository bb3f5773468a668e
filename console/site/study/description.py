"""A study as its file describes it: read strictly, every mistake at once. What it names is not opened yet."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.cutting.strategy import Strategy
from profiles.fields import Field, Kind, fault, read_fields, schema_problem, spelled
from profiles.files import printable, read_toml
from profiles.problem import Problem, ProfileError

LONGEST_NAME = 1024
MOST_CELLS = 100_000
MOST_PARTS = 100
SEED_LIMIT = 2**32 - 1
STAGES = ("partial", "full")

FIELDS = (
    Field(key="schema", kind=Kind.WHOLE, at_least=1, at_most=1),
    Field(key="jobs", kind=Kind.TEXTS, longest=LONGEST_NAME),
    Field(key="machines", kind=Kind.TEXTS, longest=LONGEST_NAME),
    Field(key="plants", kind=Kind.TEXTS, longest=LONGEST_NAME, default=("realistic",)),
    Field(key="strategies", kind=Kind.TEXTS, choices=tuple(map(str, Strategy)), default=("cam",)),
    Field(key="stage", kind=Kind.CHOICE, choices=STAGES, default="full"),
    Field(key="parts", kind=Kind.WHOLE, at_least=1, at_most=MOST_PARTS, default=1),
    Field(key="compare", kind=Kind.CHOICE, choices=("off", "on"), default="off"),
    Field(key="cut_length_mm", above=0.0, at_most=10_000.0, unit="mm", optional=True),
    Field(key="clamping_sd_percent", at_least=0.0, at_most=50.0, unit="%", optional=True),
)
"""Keys of a study besides `seeds`: a list, or a table with `from` and `count`."""

SEED_FIELDS = (
    Field(key="from", kind=Kind.WHOLE, at_least=0, at_most=SEED_LIMIT, default=1),
    Field(key="count", kind=Kind.WHOLE, at_least=1, at_most=MOST_CELLS),
)
_SEED = Field(key="seeds", kind=Kind.WHOLE, at_least=0, at_most=SEED_LIMIT)


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
        problems += _listed(key, values.get(key), where)
    problems += _listed("seeds", table.get("seeds"), where) if not wrong else []
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
        Problem(code=code, where=where, key="seeds", value=spelled(each), limit=_SEED.limit)
        for each in listed
        if (code := fault(_SEED, each))
    ]
    return (() if problems else tuple(listed)), problems


def _texts(found: Mapping[Any, Any]) -> dict[str, object]:
    return {str(key): value for key, value in found.items()}


def _listed(key: str, found: object, where: str) -> list[Problem]:
    """Return what is wrong with a list as such: empty, or something twice."""
    if not isinstance(found, list | tuple):
        return []
    if not found:
        return [Problem(code="study.empty_list", where=where, key=key)]
    twice = next((each for each, count in Counter(found).items() if count > 1), None)
    return [] if twice is None else [Problem(code="study.twice", where=where, key=key, value=spelled(twice))]
