"""One line for each recorded run: what was cut, by whom, how it ended, and how round the part is."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any

from console.session.data.history import form_of
from profiles.metrology.conformity import DecisionRule
from profiles.problem import Problem
from profiles.strict_values import from_json, number_or_none

MODEL = "none"
"""Name of the compensation where nothing learned was used."""

NOT_PROVEN = "not_proven"  # of `CutJudgement`, which takes numpy with it


class RunOutcome(StrEnum):
    """How a run ended."""

    DONE = "done"
    HELD = "held"  # the operator ended the cut after a turn
    EARLY = "early"  # the controller or somebody else ended it: not the planned cut
    STOPPED = "stopped"
    FAILED = "failed"  # refused or failed; `reason` says why
    KILLED = "killed"  # its console, or the power
    NOT_STARTED = "not_started"  # armed, and not started
    OPEN = "open"  # no end in the record: still running, or killed and not yet reported


@dataclass(frozen=True, slots=True, kw_only=True)
class RunEnding:
    """How a run ended, after how many turns of the cut, and the reason: a code, or the name of a stop.

    `by` is who stopped it: the name of the operator, "console", or a signal; empty where that is not recorded.
    `problems` are those of an early end, whose codes are its reason.
    """

    how: RunOutcome
    turn: float | None = None
    reason: str = ""
    by: str = ""
    problems: tuple[Problem, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRow:
    """One run. What was not recorded is None.

    `started` is UTC, `compensation` the learned version or "none", `inverted` the name of the identified response
    that a cut with nothing learned has inverted, None for the model's. `ront_um` is RONt of the product (not of a
    part cut for comparison), least squares circle, as filtered in `console.session.cut.run`; None where it was not
    measured. `cylt_um` is its cylindricity, `worst_ront_um` RONt of its least round section, at `worst_z_mm`; None
    where it was not measured so. `passed` is None of a part that was not meant to be good, and of an
    `unproven` one, which its gauge proves neither good nor bad. `diameter_mm` is its mean diameter, that may be
    off by `diameter_tolerance_um` either way, None where that is not judged. Of a cut
    that is not `proven` the polls do not tell whether the tool kept to its plan. `damaged` says that some of its
    data cannot be read.
    """

    run_id: str
    started: datetime
    job: str
    machine: str
    simulated: bool
    strategy: str
    operator: str | None = None
    stage: str | None = None
    compensation: str | None = None
    inverted: str | None = None
    ended: RunEnding = RunEnding(how=RunOutcome.OPEN)
    ront_um: float | None = None
    cylt_um: float | None = None
    worst_ront_um: float | None = None
    worst_z_mm: float | None = None
    tolerance_um: float | None = None
    diameter_mm: float | None = None
    nominal_diameter_mm: float | None = None
    diameter_tolerance_um: float | None = None
    passed: bool | None = None
    unproven: bool = False
    proven: bool = True
    damaged: bool = False

    @property
    def least_round_um(self) -> float | None:
        """RONt of the section that is least round, or of the only one; None where it is not known."""
        return self.ront_um if self.worst_ront_um is None else self.worst_ront_um

    @property
    def failed(self) -> bool:
        """Whether the part is out of tolerance, or the cut is not the planned one."""
        return self.passed is False or self.ended.how in FAILED_HOW


REASONS, PROBLEMS = "reasons", "problems"  # keys of events: codes, and all that is known

FAILED_HOW = frozenset(
    {RunOutcome.HELD, RunOutcome.EARLY, RunOutcome.STOPPED, RunOutcome.FAILED, RunOutcome.KILLED}
)

_INVERTED, _MODEL_RESPONSE = "inverted", "model"
COMPLETE = ("result", "cut")
ENDS = (*COMPLETE, "held", "ended_early", "stopped", "ended")
STARTS = ("armed", "started")

_COLUMNS = (
    "runs.run_id, runs.started_utc, runs.job, runs.machine, runs.simulated, runs.strategy, runs.operator,"
    " runs.stage, runs.compensation, runs.tolerance_um, runs.setup"
)

FAILED = f"""(
    (SELECT passed FROM measurements WHERE measurements.run_id = runs.run_id AND product = 1
        ORDER BY number DESC LIMIT 1) IS 0
    OR NOT EXISTS (SELECT 1 FROM events WHERE kind IN {COMPLETE} AND events.run_id = runs.run_id)
        AND EXISTS (SELECT 1 FROM events WHERE kind IN {ENDS[2:]} AND events.run_id = runs.run_id)
)"""
"""The same as `RunRow.failed`, where it is asked of the file."""


def rows_where(database: sqlite3.Connection, where: str, keys: Sequence[object], limit: int) -> list[RunRow]:
    """Return the runs of a condition on `runs`, newest first by their order in the file. sqlite3.Error.

    What belongs to a run is read only for those returned; where it is damaged the run itself is still listed.
    """
    query = f"SELECT {_COLUMNS} FROM runs WHERE {where} ORDER BY runs.rowid DESC LIMIT ?"
    found = database.execute(query, (*keys, limit)).fetchall()
    run_ids = [run[0] for run in found]
    if not all(isinstance(run_id, str) for run_id in run_ids):
        error = sqlite3.DatabaseError("a run without an id")  # no console writes one: its page is damaged
        error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
        raise error
    try:
        ends, parts = _ends(database, run_ids), _parts(database, run_ids)
    except sqlite3.DatabaseError:
        return [_row_alone(database, run) for run in found]
    return [_row(run, ends.get(run[0], []), parts.get(run[0])) for run in found]


def _row_alone(database: sqlite3.Connection, run: Sequence[Any]) -> RunRow:
    """Return a run whose events or measurements may lie on a damaged page."""
    try:
        ends, parts = _ends(database, [run[0]]), _parts(database, [run[0]])
    except sqlite3.DatabaseError:
        return _row(run, [], None, damaged=True)
    return _row(run, ends.get(run[0], []), parts.get(run[0]))


Event = tuple[str, str]
"""Kind and data."""


def _ends(database: sqlite3.Connection, run_ids: Sequence[str]) -> dict[str, list[Event]]:
    """Return, for each run, the events that say how it was begun and ended, in their order."""
    kinds = (*ENDS, *STARTS)
    query = (
        "SELECT run_id, kind, data FROM events INDEXED BY events_by_kind"
        f" WHERE kind IN ({_marks(kinds)}) AND run_id IN ({_marks(run_ids)}) ORDER BY run_id, number"
    )
    found: dict[str, list[Event]] = {}
    for run_id, kind, data in database.execute(query, (*kinds, *run_ids)):
        found.setdefault(run_id, []).append((kind, data))
    return found


_FIGURES = ("ront_um", "tolerance_um", "passed", "diameter_mm", "nominal_diameter_mm", "diameter_tolerance_um")


FORM = """CASE WHEN json_valid(data) THEN json_object(
    'CYLt_um', json_extract(data, '$.CYLt_um'), 'sections', json_extract(data, '$.sections')) END"""
"""What `form_of` reads, of the data of a measurement."""
_RULE = "CASE WHEN json_valid(data) THEN json_extract(data, '$.uncertainty.decision_rule') END"


def _parts(database: sqlite3.Connection, run_ids: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the newest measurement of each run's product: its figures by their names."""
    query = (
        f"SELECT run_id, {FORM}, {', '.join(_FIGURES)}, {_RULE} FROM measurements"
        f" WHERE product = 1 AND run_id IN ({_marks(run_ids)}) ORDER BY run_id, number"
    )
    found = database.execute(query, tuple(run_ids))
    return {
        run_id: {**dict(zip((*_FIGURES, "rule"), part, strict=True)), **form_of(table_of(form or ""))}
        for run_id, form, *part in found
    }


def _marks(values: Iterable[object]) -> str:
    return ", ".join("?" for _ in values)


def _row(run: Sequence[Any], ends: list[Event], part: dict[str, Any] | None, *, damaged: bool = False) -> RunRow:
    run_id, started, job, machine, simulated, strategy, operator, stage, compensation, tolerance_um, setup = run
    figures = {**(part or {})}
    limit_um, passed = figures.pop("tolerance_um", None), figures.pop("passed", None)
    is_guarded = figures.pop("rule", None) not in (None, DecisionRule.SIMPLE)
    made = (
        _stage_and_compensation(ends)
        if stage is None
        else (stage, MODEL if compensation is None else str(compensation))
    )
    begun, ahead = date_of(started)
    return RunRow(
        run_id=run_id,
        started=begun,
        job=job,
        machine=machine,
        simulated=bool(simulated),
        strategy=strategy,
        operator=operator,
        stage=made[0],
        compensation=made[1],
        inverted=inverted_of(setup),
        ended=_ending(ends),
        **figures,
        tolerance_um=tolerance_um if tolerance_um is not None else limit_um,
        passed=None if passed is None else bool(passed),
        unproven=is_guarded and passed is None and stage in (None, "full"),
        proven=not any(table_of(data).get("cut_verdict") == NOT_PROVEN for _, data in ends),
        damaged=damaged or ahead,
    )


def inverted_of(setup: str | None) -> str | None:
    """Return the identified response that a recorded cut has inverted, None for the model's, or not recorded."""
    name = None if setup is None else table_of(setup).get(_INVERTED)
    return name if isinstance(name, str) and name != _MODEL_RESPONSE else None


def date_of(text: str) -> tuple[datetime, bool]:
    """Return a recorded date in UTC, and whether it cannot be read; the beginning of time then."""
    try:
        found = datetime.fromisoformat(text)
        return (found.replace(tzinfo=UTC) if found.tzinfo is None else found.astimezone(UTC)), False
    except (ValueError, TypeError, OverflowError):
        return datetime.min.replace(tzinfo=UTC), True


def _stage_and_compensation(ends: list[Event]) -> tuple[str | None, str | None]:
    """Return stage and compensation of a run of schema 1, which has them in some of its events."""
    for _, data in reversed(ends):
        event = table_of(data)
        stage = event.get("stage")
        if isinstance(stage, str) and "compensation" in event:
            version = event["compensation"]
            return stage, MODEL if version is None else str(version)
    return None, None


def _ending(ends: list[Event]) -> RunEnding:
    """Return how a run ended. The first end counts: a stop after a whole cut does not undo it."""
    kinds = [kind for kind, _ in ends]
    whole = next((table_of(data) for kind, data in ends if kind in COMPLETE), None)
    if whole is not None:
        return RunEnding(how=RunOutcome.DONE, turn=number_or_none(whole.get("turn")))
    for kind, data in ends:
        event = table_of(data)
        turn, reason = number_or_none(event.get("turn", event.get("turns"))), str(event.get("reason", ""))
        if kind == "held":
            return RunEnding(how=RunOutcome.HELD, turn=turn)
        if kind == "ended_early":
            told = recorded_problems(event)
            codes = ", ".join(each.code for each in told)
            return RunEnding(how=RunOutcome.EARLY, turn=turn, reason=codes, problems=told)
        by = str(event.get("by") or "")
        if kind == "stopped" and "started" in kinds:
            return RunEnding(how=RunOutcome.STOPPED, turn=turn, reason=reason, by=by)
        if kind == "ended":
            how = (
                RunOutcome.KILLED
                if reason == "killed"
                else RunOutcome.STOPPED
                if event.get("stopped")
                else RunOutcome.FAILED
            )
            return RunEnding(how=how, turn=turn, reason="" if how is RunOutcome.KILLED else reason, by=by)
    not_started = "armed" in kinds and "started" not in kinds
    return RunEnding(how=RunOutcome.NOT_STARTED if not_started else RunOutcome.OPEN)


def problem_events(problems: Iterable[Problem]) -> dict[str, object]:
    """Return problems as an event keeps them."""
    told = tuple(problems)
    return {REASONS: [each.code for each in told], PROBLEMS: [asdict(each) for each in told]}


def recorded_problems(event: Mapping[str, Any]) -> tuple[Problem, ...]:
    """Return the problems of an event."""
    told = event.get(PROBLEMS)
    return tuple(problem_of(each) for each in (told if isinstance(told, list) else ()) if isinstance(each, dict))


def problem_of(facts: Mapping[str, Any]) -> Problem:
    """Return a problem from its recorded facts; one that is missing is empty."""
    return Problem(**{each.name: str(facts.get(each.name, "")) for each in fields(Problem)})


def table_of(data: str) -> dict[str, Any]:
    """Return the values of an event; nothing of one that is damaged."""
    try:
        found = from_json(data)
    except (ValueError, TypeError):
        return {}
    return found if isinstance(found, dict) else {}
