"""What depends on nothing but what is asked, found out once: most tests cut a few parts on a few lathes.

To run a program through takes a tenth of a short cut in simulation; to measure how a simulated lathe stops, which
each process does before its first cut, takes more than that cut.
"""

from __future__ import annotations

import os
import pickle
from collections import OrderedDict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from hashlib import sha256
from pathlib import Path

import console.session.data.stop_records as stop_records
from drivers.commissioning.stop_record import StopRecord
from drivers.pmac.axes import AxisDefinition
from drivers.pmac.check import CheckedProgram, run_through
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.program_text import ProgramText
from profiles.machine import MachineProfile

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
        _kept[asked] = run_through(text, i_variables, definitions, start, dialect)
        if len(_kept) > AT_MOST:
            _kept.popitem(last=False)
    return _kept[asked]


_measure = stop_records.simulated_record


def stop_record_once(machine: MachineProfile, dialect: Dialect, now: date) -> StopRecord:
    """Measure a simulated machine as the function of that name does, or find what another process has measured."""
    name = sha256(f"{dialect.name} {machine!r}".encode()).hexdigest()
    path = Path(os.environ[FOLDER]) / name if FOLDER in os.environ else None
    if path is not None and path.exists():
        found: StopRecord = pickle.loads(path.read_bytes())
        return replace(found, measured_at=now)
    record = _measure(machine, dialect, now)
    if path is not None:
        own = path.with_name(f"{name}-{os.getpid()}")
        own.write_bytes(pickle.dumps(record))
        own.replace(path)
    return record
