"""One cell is made: planned, cut on a simulated lathe of its own, measured. Whatever happens becomes rows."""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING

from console.site.study.cells import COLUMNS, FAULT, MADE, REFUSED, Cell, Row, Value
from profiles.problem import Problem, ProblemError

if TYPE_CHECKING:
    from console.session.cut.run import RunResult
    from console.session.cut.telemetry import CutFigures
    from profiles.roundness import RoundnessResult

FULL = "full"


@dataclass(frozen=True, slots=True)
class CellResult:
    """What became of a cell, by which software."""

    number: int
    rows: tuple[Row, ...]
    software: str


def make(content: bytes) -> CellResult:
    """Make a packed cell. Nothing is raised but what ends the process."""
    cell: Cell = pickle.loads(content)
    try:
        rows = _rows(cell)
    except ProblemError as error:
        rows = (failed(cell, REFUSED, *error.problems),)
    except Exception as fault:
        # A study of a night goes on; the row says what happened, and where to look for it.
        if os.environ.get("TRILOBE_TRACEBACK"):
            raise
        rows = (fault_row(cell, fault),)
    return CellResult(cell.number, rows, software())


def software() -> str:
    """Return the version that makes cells here."""
    return f"trilobe {version('trilobe')}"


def failed(cell: Cell, outcome: str, *problems: Problem) -> Row:
    """Return the row of a cell that could not be made."""
    said = "; ".join(str(problem) for problem in problems)
    codes = " ".join(dict.fromkeys(problem.code for problem in problems))
    return _row(cell, {"outcome": outcome, "reason_code": codes, "reason": " ".join(said.split())})


def fault_row(cell: Cell, fault: BaseException) -> Row:
    """Return the row of a cell that met a fault of the program, or whose process ended."""
    code, said = "session.fault", " ".join(f"{type(fault).__name__}: {fault}".split())
    return _row(cell, {"outcome": FAULT, "reason_code": code, "reason": said})


def _row(cell: Cell, values: dict[str, Value]) -> Row:
    known: Row = {"cell": cell.number, **cell.names, **values}
    return {column: known.get(column) for column in COLUMNS}


def _rows(cell: Cell) -> tuple[Row, ...]:
    if cell.problems or cell.job is None or cell.machine is None:
        raise ProblemError(*cell.problems)
    # Slow to import, and not needed by who only hands out cells.
    from console.session.cut.engine import CutContext
    from console.session.cut.in_process import simulated_context
    from console.session.cut.run import plan_run, run, run_once
    from console.session.learning.learning import learn
    from console.session.stages import Stage
    from drivers.cutting.strategy import Strategy
    from drivers.lathe.heartbeat import cut_condition

    machine = cell.machine
    plan = plan_run(
        cell.job,
        machine,
        Strategy(cell.strategy),
        watchdog=cut_condition(machine),
        stage=Stage(cell.stage),
        simulated=True,
    )

    def open_machine() -> CutContext:
        return simulated_context(machine, cell.true)[0]

    def nothing(*_: object) -> None:
        return None

    if cell.parts > 1:
        learned = learn(plan, open_machine, nothing, cell.parts)
        return tuple(
            _made(cell, learned, part.roundness, part.figures, part.collisions, number)
            for number, part in enumerate(learned.parts, start=1)
        )
    one = run(plan, open_machine, nothing) if cell.compare else run_once(plan, open_machine(), nothing)
    return (_made(cell, one, one.after, one.figures, one.collisions, 1),)


def _made(
    cell: Cell,
    result: RunResult,
    roundness: RoundnessResult | None,
    figures: CutFigures,
    collisions: tuple[str, ...],
    part: int,
) -> Row:
    job, before = result.plan.job, result.before
    values: dict[str, Value] = {
        "part": part,
        "outcome": MADE,
        "tolerance_um": job.roundness_tolerance_um,
        "before_ront_um": None if before is None else before.ront_um,
        "tool_error_um": figures.tool_error_um,
        "tool_error_rms_um": figures.tool_error_rms_um,
        "following_error_um": figures.following_error_um,
        "spindle_rpm": figures.spindle_speed_rpm,
        "cut_duration_s": result.plan.cut.duration_s,
        "collisions": " ".join(collisions),
    }
    if roundness is not None:
        judged = cell.stage == FULL and figures.verdict.proven
        values |= {
            "ront_um": roundness.ront_um,
            "within_tolerance": roundness.ront_um <= job.roundness_tolerance_um if judged else None,
            "lobe_um_pp": 2.0 * roundness.amplitude_um(job.jaws),
            "mean_deviation_um": roundness.mean_deviation_um,
        }
    return _row(cell, values)
