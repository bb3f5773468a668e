"""A study is carried out: its cells are handed out, and what comes back is kept at once.

The rows of a cell depend on the cell alone, and the results are in the order of the cells. So they are the
same, byte by byte, by however many workers, in one go or after kills.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

from console.session.ending_signal import held_back
from console.session.errors import SessionError
from console.site.study.cells import MADE, Cell, Row, packed
from console.site.study.journal import Journal, journal
from console.site.study.making import CellResult, fault_row, make, software
from console.site.study.workers import Workers
from profiles.problem import Problem

AHEAD = 2
"""Cells that wait for each worker: none has to wait for its next."""

Opens = Callable[[], AbstractContextManager[Workers]]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a study is: cells that are kept, those of this call among them, and those that could not be made."""

    cells: int
    kept: int
    made_now: int
    bad: int


Told = Callable[[Progress], object]


def carry_out(all_cells: Iterable[Cell], folder: Path, opens: Opens, told: Told) -> tuple[Row, ...]:
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
            told(Progress(len(ordered), len(kept.made), len(kept.made) - begun_with, bad))

        tell()
        if left:
            _make_all(left, opens, kept, tell)
        return tuple(row for cell in ordered for row in kept.made[cell.number])


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
                        under_way[workers.executor.submit(make, packed(waiting[0]))] = waiting[0]
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
