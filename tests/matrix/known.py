"""Cells that are not yet as they should be, by what is wrong there. One that has become right must leave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tests.matrix.expected import ONCE, TABLE
from tests.matrix.situations import Situation

JOGGING, HOMING, DOWNLOADING = Situation.JOGGING, Situation.HOMING, Situation.DOWNLOADING
OFF, IDLE, ARMED = Situation.OFF, Situation.IDLE, Situation.ARMED
CUTTING, STOPPING = Situation.CUTTING, Situation.STOPPING

MUTE = ("hang", "watchdog", "slow-background, 2.5 s")
SPOILT = ("extra-line, once", "nul, once", "bare-bel, once")


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """One thing that is wrong, and where."""

    what: str
    cells: tuple[tuple[str, Situation], ...]


def _cells(rows: tuple[str, ...], *situations: Situation) -> tuple[tuple[str, Situation], ...]:
    return tuple((row, situation) for row in rows for situation in situations)


WRONG: tuple[Wrong, ...] = (
    Wrong(
        what="One answer that is lost is waited for longer than a lease lasts, so that the card ends the motion.",
        cells=_cells(("dropped-ack, once", "stranger-writes, the handshake"), JOGGING, HOMING, CUTTING),
    ),
    Wrong(
        what="A look whose answer comes spoiled is not asked again, as one without an answer is.",
        cells=_cells(SPOILT, OFF, IDLE, JOGGING, HOMING, ARMED, CUTTING),
    ),
    Wrong(
        what="A renewal or a line of a program without its answer leaves the drives in doubt, and yet control-A "
        "goes out, by an older look.",
        cells=(
            *_cells(tuple(row for row, cells in TABLE.items() if tuple(cells.values()) == ONCE), DOWNLOADING),
            *_cells(tuple(f"{row.split(',')[0]}, 1 s" for row in ("dropped-ack", *SPOILT)), JOGGING, HOMING),
            *_cells(tuple(f"{row.split(',')[0]}, 1 s" for row in ("dropped-ack", *SPOILT)), DOWNLOADING),
            *_cells(("cut-cable", *MUTE), JOGGING, HOMING, DOWNLOADING),
        ),
    ),
    Wrong(
        what="Behind the first stop the card is told that nothing is guarded any more, and for 2 s its answer is "
        "waited for, before the stop is repeated.",
        cells=_cells(MUTE, CUTTING, STOPPING),
    ),
    Wrong(
        what="A renewal, and the question behind a lease that has run out, wait 2 s for their answers: the first "
        "stop comes seconds behind the last one.",
        cells=(
            *_cells(("late-reply, 500 ms, for 2 s",), JOGGING, HOMING, CUTTING),
            *_cells(MUTE, JOGGING, HOMING, CUTTING),
        ),
    ),
    Wrong(
        what="While rest is proven a look may take 0.1 s, more than which a slow line needs: the machine is lost.",
        cells=_cells(("late-reply, 150 ms, each", "9600-baud"), STOPPING),
    ),
    Wrong(
        what="What the card reports while a stop is proven, and behind it, is not told: a fault, another owner.",
        cells=_cells(
            (
                *(f"limit, {axis} {way}" for axis in ("tool", "carriage") for way in ("positive", "negative")),
                "stranger-writes, another owner",
            ),
            STOPPING,
        ),
    ),
    Wrong(
        what="A loop that trips between the last look and control-A is closed by it again; the second control-A "
        "goes out before the next look, and the fault is not told.",
        cells=_cells(
            (
                *(f"amplifier-fault, {axis}" for axis in ("tool", "spindle", "carriage")),
                *("encoder-loss, spindle", "following-error-trip, spindle"),
            ),
            STOPPING,
        ),
    ),
    Wrong(
        what="Drives that another host switches on where hands may be are neither told nor switched off.",
        cells=(("stranger-writes, a jog", OFF),),
    ),
)

KNOWN: Mapping[tuple[str, Situation], str] = {cell: wrong.what for wrong in WRONG for cell in wrong.cells}
"""By row and situation: what is wrong there."""
