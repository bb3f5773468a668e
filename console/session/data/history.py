"""Earlier parts in the run record: the last measured roundness of each job."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from profiles.problem import ProblemError
from profiles.strict_values import from_json, number, number_or_none, text

RECENT = 20  # parts of a job that are kept one by one
LOCK_TIMEOUT_S = 0.1  # how long to wait for a writer; a list of jobs is not worth more

# By row, the order in which they were added: a clock may have been set back meanwhile.
_QUERY = """
SELECT events.data, events.at_utc FROM events JOIN runs USING (run_id)
WHERE events.kind = 'measured' AND runs.simulated = ? ORDER BY events.rowid
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class LastResult:
    """The last measured part of a job.

    `ront_um` is RONt of the least squares circle, free state, filtered as in `console.session.cut.run`, of the
    least round section, at `z_mm` where there are several; None if no section was measured. `cylt_um` is its CYLt.
    `strategy` is how it was cut ("none": without compensation), `parts` how many were measured in all.
    `recent` has time, `ront_um` and strategy of the latest parts, oldest first; this one is the last.
    """

    ront_um: float | None
    measured_at: datetime
    strategy: str
    parts: int
    recent: tuple[tuple[datetime, float | None, str], ...] = ()
    cylt_um: float | None = None
    z_mm: float | None = None


LastResults = Mapping[str, LastResult]
"""By the name of the job, as in its file."""


def last_results(folder: Path, *, simulated: bool) -> LastResults:
    """Return the last results in the record in `folder`, of the simulator's parts or of real ones.

    For a record that is missing, locked or unreadable the mapping is empty.
    """
    # The first page is painted before anything is read.
    import sqlite3

    from console.session.data.record_file import rows

    try:
        measured = rows(folder, _QUERY, (int(simulated),), LOCK_TIMEOUT_S)
    except (ProblemError, sqlite3.Error):
        return {}
    results: dict[str, LastResult] = {}
    for data, at_utc in measured:
        try:
            event = from_json(data)
            job, form = text(event["job"]), form_of(event)
            ront_um = form["worst_ront_um"]
            if ront_um is None and event["ront_um"] is not None:
                ront_um = number(event["ront_um"])
            strategy = text(event.get("strategy", ""))
            measured_at = datetime.fromisoformat(at_utc).astimezone(UTC)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
            continue  # written by another version
        before = results.get(job)
        parts, recent = (0, ()) if before is None else (before.parts, before.recent)
        results[job] = LastResult(
            ront_um=ront_um,
            measured_at=measured_at,
            strategy=strategy,
            parts=parts + 1,
            recent=(*recent[1 - RECENT :], (measured_at, ront_um, strategy)),
            cylt_um=form["cylt_um"],
            z_mm=form["worst_z_mm"],
        )
    return results


def form_of(form: Mapping[str, Any]) -> dict[str, float | None]:
    """Return CYLt and the least round section of a measured part as fields of `RunRow`; None: not kept."""
    listed, known = form.get("sections"), list[tuple[float, float]]()
    for each in listed if isinstance(listed, list) else ():
        row = [number_or_none(each.get(key)) for key in ("RONt_um", "z_mm")] if isinstance(each, dict) else [None]
        known += [(row[0], row[1])] if row[0] is not None and row[1] is not None else []
    ront_um, z_mm = max(known, default=(None, None))
    return {"cylt_um": number_or_none(form.get("CYLt_um")), "worst_ront_um": ront_um, "worst_z_mm": z_mm}
