"""The matrix as a page for people: docs/fault-matrix.md."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from tests.matrix.expected import SAME, TABLE, UNTRIED
from tests.matrix.headless import Moment
from tests.matrix.headless_expected import HEADLESS
from tests.matrix.headless_expected import KNOWN as HEADLESS_KNOWN
from tests.matrix.known import KNOWN, WRONG
from tests.matrix.situations import Situation

_HEAD = """# The fault matrix

What the console makes of each fault ([faults.md](faults.md)) in each state that it may be in: first as the screens
work it, then as `console run` does, which makes one part and has nobody at its keys. Each cell is tried on the
simulated lathe, with the heartbeat that a host keeps, and all that was sent and every axis is looked at.

In no cell does anything move that was not ordered, nor behind the end. No line that moves or writes is sent more
often than without the fault, and none behind a stop. No position is shown that the card did not have between
request and reply. Nothing switches an amplifier on. No exception is shown. What moves without an answer is
stopped within a second, and a stop that is not proven goes out five times a second. When the fault is gone nothing
goes on by itself, and a machine that was lost is found again at rest, unless its link is gone for good. A cut that
ends otherwise than planned is not called done: its part is not measured, and nothing is learned from it.

A cell says how it ends, the strongest thing that was sent (a stop, before a line, before a renewal of the lease,
before nothing but looks), and the alarms, or the reasons of a refusal:

- **ready**, **armed**: the console goes on. **stopped**: rest is proven, and F2 goes on. **lost**: it cannot be
  proven; the lease ends what moves.
- `–` is as without the fault. An empty cell is not tried: another one says the same, or its fault is of something
  that is not there. A stop in parentheses may be sent, when a look fails on the way to rest.
- *no answer* is one of `link.silent`, `link.out_of_step` and `link.not_in_step`: nothing came, or something else,
  or the way back in step was not found.
- Control-A is sent only while every loop was seen closed and nothing is in doubt. A fault of the line puts that in
  doubt, an amplifier fault or a trip opens a loop: then it is control-K, and the spindle coasts.

*Drives off* is with hands in the machine. The jog is one of the carriage, the home search that of the tool. The
download is that of a program, the cut one of experiment 1 at 1000 rpm. What is being stopped is that cut, by
Space, and the fault comes at that moment.

## At the screens

"""

_HEADLESS = """
## A part that nobody sits at

`console run` claims the machine, loads the program and reads it back, switches the drives on and homes, goes to
the start, compares everything once more (*checking*), starts, cuts, takes the tool out, and looks whether all is
at rest and the tool clear (*ended*). The fault comes in the middle of it: of *claiming* with the first line that
is sent, of *loading* with the first line of the path, of *homing* in the search of the tool, of *positioning* with
the carriage on its way; *starting* is behind the last comparison.

It ends with a part, or with an error: **refused** or **interrupted**, nothing has moved, or the machine is
another's; **stopped**, rest is proven, and the error says whether the tool is in the part and can be taken out;
**unproven**, the machine may move until its lease ends it. Only a part that is made is measured. What was sent and
what has moved is judged as above, also while the machine is left behind with its drives off.

"""

_LIMITS = """
## What cannot be seen

- An axis whose encoder does not count looks as if it rested. After a trip by a lost encoder the spindle may coast
  on while the console proves rest: it goes by what the card reports. The alarm names the axis.
- Control-A closes a loop that has tripped, or was opened by another host, since the last look, where it stands.
  The card trips it again if the cause lasts; the next look then finds it open, and the next stop is control-K.
- What another host moves, switches on or writes is not prevented. During a motion of this console the next look
  judges it: what was not ordered is stopped at that look. The constants of a program that runs are read in turn,
  within a second, unless an axis has left its plan before. At rest, what another host moves is that host's, and is
  left alone; what it has switched off or rewritten is refused with the next order, and a feed override is met at
  the first look of the program. Between the last comparison and the start a program may be rewritten: it then
  runs until an axis leaves the plan, or it ends otherwise than the planned one.
- A line that arrives otherwise than it was sent is seen by what it does. What is loaded is read back, so that it
  does nothing; a jog has begun by the time of the next look.
"""


def page() -> str:
    """Return the page."""
    return "".join(
        (_HEAD, *_table(), *_not_yet([wrong.what for wrong in WRONG]), _HEADLESS, *_headless(), _LIMITS)
    )


def _table() -> Iterator[str]:
    yield _row("fault", *(situation.value for situation in Situation))
    yield _row(*("---",) * (len(Situation) + 1))
    for name, cells in TABLE.items():
        said = (_cell(name, situation, cell) for situation, cell in cells.items())
        yield _row(name if name == "no fault" else f"`{name}`", *said)


def _headless() -> Iterator[str]:
    yield _row("fault", *(moment.value for moment in Moment))
    yield _row(*("---",) * (len(Moment) + 1))
    for name, cells in HEADLESS.items():
        said = (_ways(cell) + _mark(HEADLESS_KNOWN, name, moment) for moment, cell in cells.items())
        yield _row(name if name == "no fault" else f"`{name}`", *said)
    yield from _not_yet(HEADLESS_KNOWN.values())


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |\n"


def _cell(row: str, situation: Situation, said: str) -> str:
    return _ways(said) + _mark(KNOWN, row, situation)


def _mark(known: Collection[tuple[str, Situation]] | Collection[tuple[str, Moment]], row: str, column: str) -> str:
    return " \\*" if (row, column) in known else ""


def _ways(said: str) -> str:
    if said in (SAME, UNTRIED):
        return "–" if said == SAME else ""
    return " or ".join(map(_way, said.split(" or ")))


def _way(said: str) -> str:
    state, _, codes = said.partition(": ")
    end, _, sent = state.partition(", ")
    told = [_code(code) for code in codes.split()]
    return f"**{end}**, {sent}" + (f": {' '.join(told)}" if told else "")


def _code(code: str) -> str:
    return "*no answer*" if "/" in code else f"`{code}`"


def _not_yet(wrong: Collection[str]) -> Iterator[str]:
    if not wrong:
        return
    yield "\n### Not yet so\n\nIn the cells with an asterisk it is not yet as the table says:\n\n"
    for what in wrong:
        yield f"- {what}\n"
