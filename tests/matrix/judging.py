"""Whether what was seen in a cell is what is right, and why not."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory

from console.session.station.state import Activity
from drivers.cutting.planning import Strategy
from tests.matrix.cell import Seen, run_cell
from tests.matrix.checks import Kind
from tests.matrix.expected import SAME, TABLE, UNKNOWN, right
from tests.matrix.faults import NO_FAULT, Row
from tests.matrix.situations import Situation

HOLD = "M26=1"
"""Asks a cut to end at the end of its turn: it moves nothing, and may be sent twice."""

STRONGEST_FIRST = (Kind.LINE, Kind.RENEWAL)
_FOUND: dict[tuple[Situation, Strategy, float], Seen] = {}


def without_fault(situation: Situation, row: Row) -> Seen:
    """What is seen without the fault of a row; found once."""
    way = situation, row.strategy, row.cut_mm
    if way not in _FOUND:
        with TemporaryDirectory() as folder:
            sound = replace(NO_FAULT, strategy=row.strategy, cut_mm=row.cut_mm)
            _FOUND[way] = run_cell(sound, situation, Path(folder))
    return _FOUND[way]


def problems(row: Row, situation: Situation, seen: Seen) -> list[str]:
    """Return everything that is not as it should be."""
    target = right(row.name, situation)
    told = [] if any(_fits(way, seen) for way in target.split(" or ")) else [f"{_said(seen)}, not {target}"]
    again = _sent_again(seen, without_fault(situation, row))
    return [*told, *seen.wrong, *again, *_not_mended(seen, target), *_not_done(situation, seen, target)]


def unharmed(row: Row, situation: Situation) -> bool:
    """Whether the fault makes no difference there."""
    return TABLE[row.name][situation] == SAME


def _fits(target: str, seen: Seen) -> bool:
    state, _, codes = target.partition(": ")
    end, _, sent = state.partition(", ")
    return end == _end(seen) and sent_fits(sent, seen.sent) and told_fits(codes.split(), seen.told)


def _end(seen: Seen) -> str:
    return "armed" if seen.armed and seen.end is Activity.READY else seen.end.value


def sent_fits(target: str, sent: Collection[Kind]) -> bool:
    """The strongest that was sent is what is wanted; in parentheses is what may be sent besides."""
    may = {word.strip("()") for word in target.split()}
    must = {word for word in target.split() if not word.startswith("(")}
    return must <= set(strongest(sent)) <= may


def strongest(sent: Collection[Kind]) -> tuple[str, ...]:
    """The stops, or where there are none the strongest thing that was sent."""
    stops = tuple(kind.value for kind in Kind if kind in sent and kind in (Kind.ABORT, Kind.KILL))
    others = [kind.value for kind in STRONGEST_FIRST if kind in sent]
    return stops or tuple(others[:1]) or ("nothing",)


BEHIND = ("machine.left_behind", "machine.tool_left_behind", "machine.behind_after_change")


def told_fits(target: list[str], told: tuple[str, ...]) -> bool:
    """Each code is told, and nothing else.

    That the outcome of a look with its lease is unknown may be told, and of a fault how far the axis was behind.
    """
    left = list(told)
    for code in target:
        found = next((one for one in code.split("/") if one in left), None)
        if found is None:
            return False
        left.remove(found)
    may = {UNKNOWN, *(BEHIND if "machine.fault" in told else ())}
    return may.issuperset(left)


def _said(seen: Seen) -> str:
    return f"{_end(seen)}, {' '.join(strongest(seen.sent))}: {' '.join(seen.told)}"


def _sent_again(seen: Seen, usual: Seen) -> Iterator[str]:
    """What moves or writes goes out as without the fault, up to where it ends; so no line is sent again."""
    lines, others = ([line for line in each.lines if line != HOLD] for each in (seen, usual))
    pairs = zip_longest(lines, others[: len(lines)], fillvalue="nothing")
    odd = next(((line, other) for line, other in pairs if line != other), None)
    if odd is not None:
        yield f"{odd[0]} was sent, where without the fault it is {odd[1]}"


def _not_mended(seen: Seen, target: str) -> Iterator[str]:
    """A machine that was lost is found again at rest, once all is right; a link that is gone stays so."""
    lost = seen.end is Activity.LOST
    expected = Activity.STOPPED if lost and "link.lost" not in target else seen.end
    if seen.mended is not expected:
        yield f"when it was mended: {seen.mended.value}, not {expected.value}"


def _not_done(situation: Situation, seen: Seen, target: str) -> Iterator[str]:
    """A cut is done, and its part may be measured, where it has ended as without a fault, and nowhere else."""
    done = situation is Situation.CUTTING and target == right(NO_FAULT.name, situation)
    if seen.done is not done:
        yield "the part may be measured" if seen.done else "a cut that was made is not called done"
