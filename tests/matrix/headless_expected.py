"""What is right in each cell of the headless matrix: from the same rules, for a run that nobody sits at.

A cell reads `end, sent: codes`, as in `expected.py`; the codes are those of the error that the run ends with.
"""

from __future__ import annotations

from collections.abc import Mapping

from tests.matrix.expected import NO_ANSWER, SAME, UNKNOWN, UNTRIED
from tests.matrix.headless import INTERRUPT, Moment

REFUSED = "refused, lines"
"""Nothing has moved, so nothing is stopped: what was sent is what is being loaded."""

FAULT_A, FAULT_K = "stopped, ^A: machine.fault", "stopped, ^K: machine.fault"
OPENED = "stopped, ^K: machine.loop_open"
IN_PART, NO_WAY_OUT = "machine.tool_in_part", "machine.retract_not_possible"
TOOL_UNKNOWN = "machine.tool_unknown"
"""The tool has no zero: it is being searched, or it was lost. Where the tool stands is not guessed."""

UNSEEN = f"{REFUSED}: {NO_ANSWER} {UNKNOWN}"
SILENT = f"unproven, ^K: {NO_ANSWER} machine.rest_unknown machine.state_unknown"
GONE = "unproven, ^K: link.lost machine.state_unknown"
SETTING = "stopped, ^A: controller.setting"
ANOTHER_PROGRAM = "stopped, ^A: controller.program_differs"
NOT_AS_PLANNED = "stopped, ^A: controller.constant_differs"
CHANGED_IN_CUT = "stopped, ^A: cut.constant_differs"
NOT_LOADED = f"{REFUSED}: controller.constant_differs"
ENDED_EARLY = "stopped, ^A: cut.ended_early cut.constant_changed"
OUSTED = "stopped, ^A: owner.ousted"
NOT_ENABLED = "stopped, ^K: machine.not_enabled"
"""With a loop open nothing is started; what follows must not close it."""

ENDED_BY_OTHERS = "stopped, ^A: cut.ended_early cut.stopped_by_another"
DISTURBED = "stopped, ^A: cut.disturbed"
"""The whole length is cut, and the program did not come out of the part on its own."""

OVERRIDE, OUTSIDE = "stopped, ^A: cut.override", "stopped, ^A: cut.outside_plan"
RESET = f"stopped, ^K: controller.was_reset {TOOL_UNKNOWN}"
INTERRUPTED = "stopped, ^A: machine.stopped"
MOVING = "stopped, ^A: machine.moving machine.tool_unknown"

WITHOUT: Mapping[Moment, str] = {
    moment: "cut, nothing" if moment is Moment.ENDED else "cut, lines" for moment in Moment
}
"""Once the program has ended there is only the look that proves it."""


def _row(**cells: str) -> Mapping[Moment, str]:
    return {moment: cells.get(moment.name, UNTRIED) for moment in Moment}


HEADLESS: Mapping[str, Mapping[Moment, str]] = {
    "no fault": WITHOUT,
    "dropped-ack, once": _row(LOADING=UNSEEN, CHECKING=SAME, CUTTING=SAME),
    "cut-cable": _row(
        LOADING=f"{REFUSED}: link.lost {UNKNOWN} controller.buffer_may_be_open",
        POSITIONING=GONE,
        CUTTING=GONE,
        ENDED=GONE,
    ),
    "hang": _row(
        LOADING=f"{UNSEEN} link.not_in_step controller.buffer_may_be_open",
        POSITIONING=SILENT,
        CUTTING=SILENT,
    ),
    # Behind the end the tool is out, the part is made, and the drives go off.
    "amplifier-fault, tool": _row(
        LOADING=f"stopped, ^K: machine.not_enabled {TOOL_UNKNOWN}",
        HOMING=f"{FAULT_K} {TOOL_UNKNOWN}",
        POSITIONING=FAULT_K,
        CHECKING="stopped, ^K: machine.not_enabled machine.fault",
        STARTING=NOT_ENABLED,
        CUTTING=f"{FAULT_K} {NO_WAY_OUT}",
        RETRACTING=FAULT_K,
        ENDED=SAME,
    ),
    # An axis may stand on a limit and move off it; the other way it does not arrive.
    "limit, carriage positive": _row(
        LOADING="stopped, ^A: machine.fault",
        POSITIONING=FAULT_A,
        CHECKING=FAULT_A,
        STARTING=FAULT_A,
        CUTTING=f"{FAULT_A} {IN_PART}",
    ),
    "stranger-writes, a gain": _row(
        LOADING=f"{REFUSED}: controller.setting",
        POSITIONING=SETTING,
        CHECKING=SETTING,
        STARTING=f"{CHANGED_IN_CUT} or {CHANGED_IN_CUT} {IN_PART}",
        CUTTING=f"{CHANGED_IN_CUT} {IN_PART}",
    ),
    # Nothing is sent to the machine of another console, but the stop of what this one has moved.
    "stranger-writes, another owner": _row(
        LOADING=f"{REFUSED}: owner.held",
        HOMING=f"{OUSTED} {TOOL_UNKNOWN}",
        POSITIONING=OUSTED,
        CHECKING="refused, nothing: owner.held",
        STARTING=f"{OUSTED} or refused, nothing: owner.held",
        CUTTING=f"{OUSTED} {IN_PART}",
    ),
    "stranger-writes, a jog": _row(
        HOMING=f"stopped, ^A: machine.unexpected_motion {TOOL_UNKNOWN}",
        POSITIONING="stopped, ^A: machine.not_arrived or stopped, ^A: machine.jog_astray",
        CHECKING=MOVING,
        STARTING="stopped, ^A: controller.err001",
        ENDED="stopped, ^A: machine.not_retracted",
    ),
    "stranger-writes, a jog without end": _row(POSITIONING="stopped, ^A: machine.jog_astray"),
    "stranger-writes, a jog of the tool": _row(
        HOMING=f"stopped, ^A: machine.home_ended {TOOL_UNKNOWN}",
        POSITIONING="stopped, ^A: machine.unexpected_motion",
    ),
    "stranger-writes, a kill of the tool": _row(
        POSITIONING=OPENED, CHECKING=NOT_ENABLED, STARTING=NOT_ENABLED, CUTTING=SAME
    ),
    "stranger-writes, ^K": _row(
        HOMING=f"{OPENED} {TOOL_UNKNOWN}",
        POSITIONING=OPENED,
        CHECKING="stopped, ^K: machine.not_enabled",
        STARTING=NOT_ENABLED,
        CUTTING=f"{OPENED} {NO_WAY_OUT}",
        RETRACTING=OPENED,
        ENDED=SAME,
    ),
    "stranger-writes, ^A": _row(
        HOMING=f"stopped, ^A: machine.home_ended {TOOL_UNKNOWN}",
        POSITIONING="stopped, ^A: machine.not_arrived",
        CHECKING=SAME,
        CUTTING=f"{ENDED_BY_OTHERS} {IN_PART}",
        RETRACTING=DISTURBED,
    ),
    "stranger-writes, &1A": _row(CUTTING=f"{ENDED_BY_OTHERS} {IN_PART}"),
    # What is in full motion when its segment ends runs on, into the part or out of it.
    "stranger-writes, &1Q": _row(
        CUTTING=" or ".join((ENDED_BY_OTHERS, f"{ENDED_BY_OTHERS} {IN_PART}", f"{OUTSIDE} {IN_PART}", OUTSIDE)),
        RETRACTING=f"{DISTURBED} or {OUTSIDE}",  # the segment in progress may be the last, and end in full motion
    ),
    "stranger-writes, &1H": _row(CUTTING=f"{OVERRIDE} {IN_PART}"),
    "stranger-writes, &1%0": _row(CUTTING=f"{OVERRIDE} {IN_PART}"),
    # An override from before the start is met at the first look of the program.
    "stranger-writes, &1%50": _row(CHECKING=OVERRIDE, CUTTING=f"{OVERRIDE} {IN_PART}"),
    # In the first search nothing was homed yet, and no position is lost.
    "stranger-writes, $$$": _row(
        LOADING=UNSEEN,
        HOMING=f"{OPENED} {TOOL_UNKNOWN}",
        POSITIONING=RESET,
        CHECKING="stopped, ^K: machine.not_enabled machine.not_homed machine.not_at_start machine.tool_unknown",
        STARTING=f"{NOT_ENABLED} {TOOL_UNKNOWN}",
        CUTTING=RESET,
        RETRACTING=RESET,
    ),
    # The program takes its flag back where it begins.
    "stranger-writes, M26=1": _row(STARTING=SAME, CUTTING="stopped, ^A: cut.ended_early cut.held_by_another"),
    "stranger-writes, fewer turns": _row(
        LOADING=NOT_LOADED,
        POSITIONING=NOT_AS_PLANNED,
        STARTING=CHANGED_IN_CUT,
        # With so few turns left the feed may be over, and the tool out, when it is read.
        CUTTING=f"{CHANGED_IN_CUT} {IN_PART} or {CHANGED_IN_CUT} or {ENDED_EARLY}",
    ),
    "stranger-writes, a deeper cut": _row(
        LOADING=NOT_LOADED,
        POSITIONING=NOT_AS_PLANNED,
        STARTING=f"{CHANGED_IN_CUT} or {OUTSIDE} {IN_PART}",
        CUTTING=f"{OUTSIDE} {IN_PART} or {CHANGED_IN_CUT} {IN_PART}",
        RETRACTING=CHANGED_IN_CUT,
    ),
    "stranger-writes, a larger lobe": _row(
        POSITIONING=NOT_AS_PLANNED, CUTTING=f"{OUTSIDE} {IN_PART} or {CHANGED_IN_CUT} {IN_PART}"
    ),
    # A program that is rewritten behind the last comparison runs, and is stopped where it leaves the plan.
    "stranger-writes, another program": _row(
        LOADING=SAME, POSITIONING=ANOTHER_PROGRAM, CHECKING=ANOTHER_PROGRAM, STARTING=OUTSIDE, CUTTING=SAME
    ),
    "garbled-line, a home search": _row(HOMING=f"stopped, ^A: machine.unexpected_motion {TOOL_UNKNOWN}"),
    "garbled-line, a jog": _row(POSITIONING="stopped, ^A: machine.jog_astray"),
    "garbled-line, a depth": _row(LOADING=NOT_LOADED),
    "garbled-line, an entry of a table": _row(LOADING=f"{REFUSED}: controller.table_differs"),
    # Nobody is to be stopped by who does not have the machine. A stop while the drives are off is a kill.
    INTERRUPT.name: _row(
        CLAIMING="interrupted, nothing",
        LOADING="stopped, ^K: machine.stopped machine.tool_unknown",
        HOMING=f"{INTERRUPTED} {TOOL_UNKNOWN}",
        POSITIONING=INTERRUPTED,
        CUTTING=f"{INTERRUPTED} {IN_PART}",
        ENDED=INTERRUPTED,
    ),
}

KNOWN: Mapping[tuple[str, Moment], str] = {
    (INTERRUPT.name, Moment.LOADING): "A download that is interrupted is sent to its end; nothing moves by it.",
}
"""What is not yet as it should be, and where. A cell that has become right must leave."""

TRIED = tuple(
    (name, moment)
    for name, cells in HEADLESS.items()
    for moment, said in cells.items()
    if said != UNTRIED and (name != "no fault" or moment is Moment.CUTTING)
)
"""Without a fault each of them is the same part."""


def right_of(row: str, moment: Moment) -> str:
    """Return what is right in a cell, with what happens without a fault where that is meant."""
    said = HEADLESS[row][moment]
    return WITHOUT[moment] if said == SAME else said
