"""Parts of a simulated lathe over several commands: the record says which part of a job comes next on it.

Each command starts the lathe again. With the same seed it is the same lathe, which continues with the next blank
and the next clamping: a second part with the same ones would show nothing that the first has not.
"""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path

from console.session.data.record_file import FILE_NAME, record_error, rows
from drivers.simulator.plant.which_lathe import LATHE, WHICH, WhichLathe

TIMEOUT_S = 1.0

_NEXT = """
SELECT max(json_extract(setup, '$.lathe.part') + json_extract(setup, '$.lathe.parts')) FROM runs
WHERE simulated = 1 AND machine = ? AND coalesce(?, job) = job
AND json_extract(setup, '$.lathe.plant') = ? AND json_extract(setup, '$.lathe.seed') = ? AND EXISTS (
    SELECT 1 FROM events WHERE events.run_id = runs.run_id AND (
        events.kind = 'armed' OR (events.kind = 'step' AND json_extract(events.data, '$.step') = 'align')
    )
)
"""
"""A command clamps a blank as it aligns the machine, on the screens it is there before a cut is armed: what was
refused earlier has taken none.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class LatheParts:
    """The parts of a run: so many, from `part` on, of one job on one lathe; 0 for a cut in air."""

    lathe: WhichLathe
    part: int
    parts: int = 1

    def fields(self) -> dict[str, object]:
        """Return it as the record and JSON have it."""
        return {"plant": self.lathe.plant, "seed": self.lathe.seed, "part": self.part, "parts": self.parts}


def lathe_setup(lathe: WhichLathe | None, parts: LatheParts | None) -> dict[str, object]:
    """Return what the record has of a simulated lathe and, where they differ, its parts; nothing of a real one."""
    if lathe is None:
        return {}
    return {LATHE: {WHICH: str(lathe), **({} if parts is None else parts.fields())}}


def next_part(data: Path, job: str | None, machine: str, lathe: WhichLathe) -> int:
    """Return the number of the next part of a job (None: of any) on a lathe, from 1: after all clamped there.

    Raises SessionError: `record.unreadable`; as `rows`.
    """
    try:
        found = rows(data, _NEXT, (machine, job, lathe.plant, lathe.seed), TIMEOUT_S)
    except sqlite3.Error as error:
        raise record_error("record.unreadable", data / FILE_NAME, error) from error
    return int(found[0][0] or 1) if found else 1
