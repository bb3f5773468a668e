"""What depends on nothing but what is asked, found out once: most tests cut a few parts on a few lathes.

To run a program through takes a tenth of a short cut in simulation; to read what another process has found of
it, a third as long. To measure how a simulated lathe stops, which each process does before its first cut, takes
more than that cut; so does the summary of its servo loop.
"""

from __future__ import annotations

import os
import pickle
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TypeVar

import console.session.data.stop_records as stop_records
import drivers.cutting.planning
from drivers.commissioning.stop_record import StopRecord
from drivers.pmac.axes import AxisDefinition
from drivers.pmac.check import CheckedProgram, run_through
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.program_text import ProgramText
from profiles.axis import servo
from profiles.machine import MachineProfile

Found = TypeVar("Found")

FOLDER = "FOLDER_OF_THE_REMEMBERED"
"""The variable that names the folder for what all processes of a run of tests share."""

AT_MOST = 24
"""Programs that are kept: a long one is some megabytes."""

_kept: OrderedDict[Hashable, CheckedProgram] = OrderedDict()


def run_through_once(
    text: ProgramText,
    i_variables: Mapping[int, float],
    definitions: Sequence[AxisDefinition],
    start: Mapping[int, float],
    dialect: Dialect = PMAC,
) -> CheckedProgram:
    """Run a program through as the function of that name does; the same once more is what it was."""
    settings = tuple(sorted(i_variables.items()))
    asked = (text.number, text.lines, settings, tuple(definitions), tuple(start.items()), dialect.name)
    if asked in _kept:
        _kept.move_to_end(asked)
    else:
        _kept[asked] = once(asked, lambda: run_through(text, i_variables, definitions, start, dialect))
        if len(_kept) > AT_MOST:
            _kept.popitem(last=False)
    return _kept[asked]


_measure = stop_records.simulated_record
_summarise = servo._summary


def stop_record_once(machine: MachineProfile, dialect: Dialect, now: date) -> StopRecord:
    """Measure a simulated machine as the function of that name does."""
    record = once((dialect.name, machine), lambda: _measure(machine, dialect, now))
    return replace(record, measured_at=now)


@cache
def summary_once(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> servo.Eq9Summary:
    """Summarise the loop of a tool as the function of that name does, which imports more than all else."""
    return once((numerator, denominator), lambda: _summarise(numerator, denominator))


def remember() -> None:
    """Have the functions themselves remember, in this process, its copies and all others of this run."""
    drivers.cutting.planning.run_through = run_through_once  # type: ignore[attr-defined]
    stop_records.simulated_record = stop_record_once
    servo._summary = summary_once


def once(asked: Hashable, make: Callable[[], Found]) -> Found:
    """Return what another process of this run has found, or find it."""
    if FOLDER not in os.environ:
        return make()
    path = Path(os.environ[FOLDER]) / sha256(repr(asked).encode()).hexdigest()
    if path.exists():
        kept: Found = pickle.loads(path.read_bytes())
        return kept
    found = make()
    own = path.with_name(f"{path.name}-{os.getpid()}")
    own.write_bytes(pickle.dumps(found))
    own.replace(path)
    return found
