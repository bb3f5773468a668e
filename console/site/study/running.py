"""A study is carried out: its cells are handed out, and what comes back is kept at once.

The rows of a cell depend on the cell alone, and the results are in the order of the cells. So they are the
same, byte by byte, by however many workers, in one go or after kills.

A cell is planned, cut on a simulated lathe of its own, and measured; what happens becomes rows. The journal has
a line for each cell that was made, so that a killed study resumes where it was. A line is whole or not there: what
a kill has cut short is cut off at the next start, and its cell is made again.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import pickle
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

from console.session.data.kept_files import file_error
from console.session.ending_signal import held_back
from console.session.errors import SessionError
from console.site.study.cells import COLUMNS, FAULT, MADE, REFUSED, Cell, Row, Value, pack_cell
from console.site.study.workers import Workers
from profiles.files import open_regular, printable
from profiles.problem import Problem, ProblemError
from profiles.strict_values import from_json

if TYPE_CHECKING:
    from console.session.cut.run import RunResult

AHEAD = 2
"""Cells that wait for each worker: none has to wait for its next."""

Opens = Callable[[], AbstractContextManager[Workers]]
NAME = "journal.jsonl"
FULL = "full"


@dataclass(frozen=True, slots=True)
class StudyProgress:
    """How far a study is: cells that are kept, those of this call among them, and those that could not be made."""

    cells: int
    kept: int
    made_now: int
    bad: int


DebriefEvent = Callable[[StudyProgress], object]


class Journal:
    """An open journal. `made` has the rows of each cell that is in it."""

    def __init__(self, descriptor: int, made: dict[int, tuple[Row, ...]]) -> None:
        self._descriptor, self.made = descriptor, made

    def add(self, number: int, rows: Sequence[Row]) -> None:
        """Add a cell; it is on the disk when this returns. OSError."""
        _append(self._descriptor, {"cell": number, "rows": rows})
        self.made[number] = tuple(rows)


@contextmanager
def journal(folder: Path, identity: str) -> Iterator[Journal]:
    """Open the journal of a study in its folder, both made where missing; one process at a time.

    Raises:
        SessionError: `study.running`, another process has it; `study.other`, it is of another study, or of other
            jobs, machines, plants, or software; `study.journal`, it is none.
        ProfileError: `file.not_writable`.
    """
    path = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = open_regular(path, os.O_RDWR | os.O_CREAT)
    except OSError as error:
        raise file_error("file.not_writable", path, error) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise SessionError(Problem(code="study.running", where=printable(str(folder)))) from None
        except OSError:  # a file system without locks
            pass
        yield Journal(descriptor, _read(descriptor, path, identity))
    except OSError as error:
        raise file_error("file.not_writable", path, error) from error
    finally:
        os.close(descriptor)


def _read(descriptor: int, path: Path, identity: str) -> dict[int, tuple[Row, ...]]:
    with open(descriptor, "rb", closefd=False) as file:
        content = file.read()
    whole = content[: content.rfind(b"\n") + 1]
    os.ftruncate(descriptor, len(whole))
    os.lseek(descriptor, 0, os.SEEK_END)
    head, *lines = whole.splitlines() or [b""]
    where = printable(str(path))
    if not whole:
        _append(descriptor, {"study": identity})
        return {}
    try:
        if from_json(head)["study"] != identity:
            raise SessionError(Problem(code="study.other", where=where))
        return dict(map(_cell, lines))
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SessionError(Problem(code="study.journal", where=where)) from error


def _cell(line: bytes) -> tuple[int, tuple[Row, ...]]:
    found = from_json(line)
    rows = tuple({column: row[column] for column in COLUMNS} for row in found["rows"])
    return int(found["cell"]), rows


def _append(descriptor: int, table: dict[str, object]) -> None:
    content = (json.dumps(table, ensure_ascii=False) + "\n").encode("utf-8", "backslashreplace")
    while content:
        content = content[os.write(descriptor, content) :]
    os.fsync(descriptor)


def carry_out(all_cells: Iterable[Cell], folder: Path, opens: Opens, told: DebriefEvent) -> tuple[Row, ...]:
    """Make the cells that the journal in a folder does not have; return the rows of all.

    `opens` opens the workers, `told` is called at the beginning and after each cell. Raises SessionError: as
    `journal` and `opens`; `study.other_software`, a worker has another version; `study.lost_workers`.
    """
    ordered = list(all_cells)
    with journal(folder, identity_of(ordered)) as kept:
        left = [cell for cell in ordered if cell.number not in kept.made]
        begun_with = len(kept.made)

        def tell() -> None:
            bad = sum(any(row["outcome"] != MADE for row in rows) for rows in kept.made.values())
            told(StudyProgress(len(ordered), len(kept.made), len(kept.made) - begun_with, bad))

        tell()
        if left:
            _make_all(left, opens, kept, tell)
        return tuple(row for cell in ordered for row in kept.made[cell.number])


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
        rows = (failed_row(cell, REFUSED, *error.problems),)
    except Exception as fault:
        # A study of a night goes on; the row says what happened, and where to look for it.
        if os.environ.get("TRILOBE_TRACEBACK"):
            raise
        rows = (fault_row(cell, fault),)
    return CellResult(cell.number, rows, software())


def software() -> str:
    """Return the version that makes cells here."""
    return f"trilobe {version('trilobe')}"


def failed_row(cell: Cell, outcome: str, *problems: Problem) -> Row:
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
            _result_row(
                cell,
                replace(learned, after=part.roundness, figures=part.figures, whole=part.whole),
                part.collisions,
                number,
            )
            for number, part in enumerate(learned.parts, start=1)
        )
    one = run(plan, open_machine, nothing) if cell.compare else run_once(plan, open_machine(), nothing)
    return (_result_row(cell, one, one.collisions, 1),)


def _result_row(
    cell: Cell,
    result: RunResult,
    collisions: tuple[str, ...],
    part: int,
) -> Row:
    job, before, roundness, figures = result.plan.job, result.before, result.after, result.figures
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
        values |= {
            "ront_um": roundness.ront_um,
            "within_tolerance": result.within_tolerance,
            "lobe_um_pp": 2.0 * roundness.amplitude_um(job.jaws),
            "mean_deviation_um": roundness.mean_deviation_um,
        }
    return _row(cell, values)


def identity_of(ordered: Sequence[Cell]) -> str:
    """Return a hash of everything that the results depend on."""
    known: dict[int, str] = {}  # hashes of jobs and machines, which many cells have in common

    def hash_of(thing: object) -> str:
        if id(thing) not in known:
            known[id(thing)] = hashlib.sha256(_bytes(thing)).hexdigest()
        return known[id(thing)]

    found = hashlib.sha256(software().encode())
    for cell in ordered:
        found.update(_bytes((replace(cell, job=None, machine=None), hash_of(cell.job), hash_of(cell.machine))))
    return found.hexdigest()


def _bytes(thing: object) -> bytes:
    return repr(thing).encode("utf-8", "backslashreplace")


def _make_all(left: list[Cell], opens: Opens, kept: Journal, tell: Callable[[], None]) -> None:
    """Make cells. Those in whose company a process has died are made again, one at a time."""
    while left:
        for cell in _handed_out(left, opens, kept, tell):
            if _handed_out([cell], opens, kept, tell):
                kept.add(cell.number, [fault_row(cell, ProcessLookupError("its process ended, twice"))])
                tell()
        left = [cell for cell in left if cell.number not in kept.made]


def _handed_out(left: Sequence[Cell], opens: Opens, kept: Journal, tell: Callable[[], None]) -> list[Cell]:
    """Hand out cells and keep what comes back; return those that were on their way when a process died."""
    waiting, under_way = deque(left), dict[Future[CellResult], Cell]()
    with opens() as workers:
        try:
            while waiting or under_way:
                while waiting and len(under_way) < AHEAD * workers.count:
                    with held_back():  # a process that begins has to be told what to begin with
                        under_way[workers.executor.submit(make, pack_cell(waiting[0]))] = waiting[0]
                    waiting.popleft()
                done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in done:
                    _keep(under_way[future], future, kept)
                    del under_way[future]
                    tell()
        except BrokenExecutor:
            return [cell for cell in under_way.values() if cell.number not in kept.made]
    return []


def _keep(cell: Cell, future: Future[CellResult], kept: Journal) -> None:
    try:
        made = future.result()
    except BrokenExecutor:
        raise
    except CancelledError as error:
        raise SessionError(Problem(code="study.lost_workers")) from error
    except Exception as fault:
        # What the cluster says of a cell whose workers died under it, and what could not be sent back.
        kept.add(cell.number, [fault_row(cell, fault)])
        return
    if made.software != software():
        raise SessionError(Problem(code="study.other_software", value=made.software, limit=software()))
    kept.add(cell.number, made.rows)
