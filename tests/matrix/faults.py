"""The rows of the matrix, every fault in each form that matters, and what is right in each of its cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName
from drivers.simulator.faults.catalogue import Value
from drivers.simulator.machine import SimulatedLathe
from tests.matrix.rig import HELD_MM, SHORT_MM, Situation

AXES = tuple(AxisName)


@dataclass(frozen=True, kw_only=True)
class Row:
    """A fault with what it is told; without `for_s` it lasts until it is mended. `name` is that of the row.

    `moves` are the axes that the fault itself moves or energises. Of `unseen` nobody can know where it is, as its
    encoder does not count. One that is `early` is there before what it meets is ordered. `strategy` is that of
    the cut, `cut_mm` its length, and what the chuck holds may be a `shell`. `later` are further lines of another
    host, so many seconds behind its first one.
    """

    name: str
    fault: str
    for_s: float | None = None
    given: Mapping[str, Value] = field(default_factory=dict)
    moves: frozenset[AxisName] = frozenset()
    early: bool = False
    strategy: Strategy = Strategy.PVT
    cut_mm: float = SHORT_MM
    shell: bool = False
    later: tuple[tuple[float, str], ...] = ()

    @property
    def unseen(self) -> str:
        return str(self.given["motor"]) if self.fault == "encoder-loss" else ""

    def inject(self, sim: SimulatedLathe) -> None:
        if self.fault:
            lasting = {} if self.for_s is None else {"for": self.for_s}
            sim.faults.ask(self.fault, {**self.given, **lasting})
        for after_s, line in self.later:
            sim.faults.ask(self.fault, {"after": after_s, "line": line})


def _once(fault: str, **given: Value) -> Row:
    return Row(name=f"{fault}, once", fault=fault, given={"replies": 1, **given})


def _lasting(fault: str, **given: Value) -> Row:
    return Row(name=fault, fault=fault, given=given)


def _named(name: str, fault: str, *, for_s: float | None = None, **given: Value) -> Row:
    return Row(name=f"{fault}, {name}", fault=fault, for_s=for_s, given=given)


def _on_each_axis(fault: str) -> tuple[Row, ...]:
    return tuple(_named(axis.value, fault, motor=axis.value) for axis in AXES)


def _stranger(name: str, line: str, *moves: AxisName) -> Row:
    return Row(
        name=f"stranger-writes, {name}", fault="stranger-writes", given={"line": line}, moves=frozenset(moves)
    )


def _garbled(name: str, find: str, replace: str, strategy: Strategy = Strategy.PVT) -> Row:
    return Row(
        name=f"garbled-line, {name}",
        fault="garbled-line",
        given={"find": find, "replace": replace},
        early=True,
        strategy=strategy,
    )


SPOILING = ("dropped-ack", "extra-line", "nul", "bare-bel")
"""What can be wrong with a reply so that it cannot be read."""

SPOILT_S = 1.0
"""Longer than a lease, and than a look that is repeated."""

STRANGERS = {
    "a gain": "I130=264",
    "a limit": "I113=400000",
    "no PLCs": "I5=0",
    "the handshake": "I3=0 I6=0",
    "an open buffer": "OPEN PROG 900",
    "another owner": "P1000=7",
}
"""What another host may write. The gain is half of what it was."""

ABORTS = ("^A", "&1A")
ENDS = {
    "a kill of the tool": "#1K",
    "^K": "^K",
    **{name: name for name in ABORTS},
    "&1Q": "&1Q",
    "&1H": "&1H",
    "&1%0": "&1%0",
    "&1%50": "&1%50",
    "$$$": "$$$",
    "M26=1": "M26=1",
}
"""How another host may end, hold, or slow down what goes on; control characters are written with a caret."""

OTHER_CUTS = {
    "fewer turns": "P23=5",
    "a deeper cut": "P11=P11+500",
    "a larger lobe": "P12=P12*4 P15=P15*4",
    "another program": "OPEN PROG 2 CLEAR X0 CLOSE",
}
"""What another host may make of a cut by pvt that is loaded. 500 counts of the tool are 0.1 mm."""

ALONG = {"the lobe along Z": "P83=P83*2", "the mean along Z": "P89=P89+1"}
"""What another host may make of the change of a path along Z: by 1 um of lobe, by 0.2 um of mean, at its ends.

By timebase it is the same; its program begins at the index, where the axes of these cells have no zero.
"""

HELD_S, HELD_SHORTLY_S = 2.0, 0.8
"""Of the 2.3 s that are left of the cut: nearly all, and a part."""

KEPT_OUT, DRIFTS = "an axis definition", "a gain that drifts"
HELD = {
    "half the gain": ("I130=264", "I130=528", HELD_S),
    "twice the scale": ("I108=192", "I108=96", HELD_SHORTLY_S),
    "the servo time": ("I10=4000000", "I10=3713707", HELD_S),
    "the time base": ("I193=0", "I193=1798", HELD_S),
    "the compensation register": ("M900->D:$46 M900=M900+12288", "M900=M900-12288", HELD_S),
    KEPT_OUT: ("&1#1->1.02X", "&1#1->X", HELD_S),
}
"""What another host changes, and how it puts that back before the end of the feed, s later."""

DRIFT_STEPS = 20


def _held(name: str, line: str, *later: tuple[float, str]) -> Row:
    return replace(_stranger(f"{name}, put back", line), cut_mm=HELD_MM, later=later)


def _drift() -> Row:
    """The gain becomes half of it in small steps, each as long as the others."""
    gains = [round(528.0 * (1.0 - 0.5 * step / DRIFT_STEPS)) for step in range(1, DRIFT_STEPS + 1)]
    first, *lines = (f"I130={gain}" for gain in (*gains, 528))
    step_s = HELD_S / DRIFT_STEPS
    return _held(DRIFTS, first, *((step_s * n, line) for n, line in enumerate(lines, start=1)))


NO_FAULT = Row(name="no fault", fault="")

ROWS: tuple[Row, ...] = (
    NO_FAULT,
    *(_once(fault) for fault in SPOILING),
    *(_named("1 s", fault, for_s=SPOILT_S) for fault in SPOILING),
    _named("500 ms, once", "late-reply", replies=1),
    _named("500 ms, for 2 s", "late-reply", for_s=2.0),
    _named("150 ms, each", "late-reply", delay_ms=150.0),
    _lasting("split-segments"),
    _lasting("wrong-checksum"),
    _lasting("9600-baud"),
    _lasting("cut-cable"),
    _named("0.1 s", "hang", for_s=0.1),
    _named("0.4 s", "hang", for_s=0.4),
    _lasting("hang"),
    *_on_each_axis("encoder-loss"),
    *_on_each_axis("index-lost"),
    *_on_each_axis("amplifier-fault"),
    *(
        _named(f"{axis} {direction}", "limit", motor=axis.value, direction=direction)
        for axis in AXES
        for direction in ("positive", "negative")
    ),
    *_on_each_axis("following-error-trip"),
    _lasting("spindle-ripple"),
    _lasting("watchdog"),
    _lasting("slow-background"),
    _named("2.5 s", "slow-background", cycle_ms=2500.0),
    *(_stranger(name, line) for name, line in STRANGERS.items()),
    _stranger("a jog", "#3J:2000", AxisName.CARRIAGE),
    _stranger("a jog without end", "#3J+", AxisName.CARRIAGE),
    _stranger("a jog of the tool", "#1J:-3000", AxisName.TOOL),
    # What closes loops energises all of them.
    *(_stranger(name, line, *(AXES if name in ABORTS else ())) for name, line in ENDS.items()),
    *(_stranger(name, line) for name, line in OTHER_CUTS.items()),
    *(replace(_stranger(name, line), cut_mm=HELD_MM, shell=True) for name, line in ALONG.items()),
    *(_held(name, line, (after_s, back)) for name, (line, back, after_s) in HELD.items()),
    _drift(),
    _garbled("a home search", "#1HM", "#3HM"),
    _garbled("a jog", "#3J=", "#3J=9"),
    _garbled("a depth", "P11=1", "P11=2"),
    _garbled("an entry of a table", " 4618 ", " 4628 ", Strategy.CAM),
    replace(_garbled("an entry of one row", " 3656 ", " 3657 ", Strategy.CAM), cut_mm=HELD_MM, shell=True),
)


SAME = "-"
"""As without a fault."""

UNTRIED = ""
"""A cell that is not tried: the fault is of something that is not ordered there."""

NO_ANSWER = "link.silent/link.out_of_step/link.not_in_step"
UNKNOWN = "link.outcome_unknown"

ABORTED = "stopped, ^A"
ABORTED_IN_DOUBT = "stopped, ^A (^K)"
"""After a stop, an answer that does not come puts the drives in doubt, and the repetition is control-K."""

LAPSED = "stopped, ^A: heartbeat.lapsed"
"""The card has ended the motion without its host; the host has looked on, and stops what rests."""

FAULT_A, FAULT_K = "stopped, ^A: machine.fault", "stopped, ^K: machine.fault"
"""Every loop closed, as after a limit; or one of them open, as after a trip: then control-A would close it."""

TIMEOUT = "stopped, ^A: machine.timeout"
SILENT = f"stopped, ^K: {NO_ANSWER}"
SILENT_LINE = f"stopped, ^K: {NO_ANSWER} {UNKNOWN}"
SILENT_CUT = f"{SILENT} or {LAPSED}"
LOST = f"lost, ^K: {NO_ANSWER} machine.rest_unknown"
LOST_LINE = f"lost, ^K: {NO_ANSWER} {UNKNOWN} link.not_in_step controller.buffer_may_be_open machine.rest_unknown"
LOST_STOPPING = "lost, ^A ^K: machine.rest_unknown"
GONE = "lost, ^K: link.lost"
GONE_LINE = f"lost, ^K: link.lost {UNKNOWN} controller.buffer_may_be_open"
GONE_STOPPING = "lost, ^A (^K): link.lost"
NOT_AS_IT_WAS = "ready, lines: controller.setting"
UNGUARDED = "stopped, ^A: heartbeat.plc_silent"
OUSTED, OUSTED_MOVING = "ready, nothing: owner.ousted", "stopped, ^A: owner.ousted"

ONCE = (SAME, SAME, SAME, SAME, SILENT_LINE, SAME, SAME, ABORTED_IN_DOUBT)
LONGER = (SILENT, SILENT, SILENT, SILENT, SILENT_LINE, SILENT, SILENT_CUT, ABORTED_IN_DOUBT)
UNHARMED = (SAME,) * len(Situation)
MUTE = (LOST, LOST, LOST, LOST, LOST_LINE, LOST, LOST, LOST_STOPPING)
LATE = (SAME, SAME, LAPSED, LAPSED, SAME, SAME, LAPSED, ABORTED_IN_DOUBT)
NO_INDEX = (SAME, SAME, SAME, TIMEOUT, SAME, SAME, SAME, SAME)
NO_INDEX_BEFORE_A_LIMIT = (SAME, SAME, SAME, f"{TIMEOUT} machine.fault", SAME, SAME, SAME, SAME)
TRIPPED = (SAME, *(FAULT_K,) * 6, "stopped, ^A (^K): machine.fault")
AT_A_LIMIT = (SAME, *(FAULT_A,) * 7)
SET_OTHERWISE = (SAME, SAME, SAME, SAME, NOT_AS_IT_WAS, SAME, SAME, SAME)
OUT_OF_PHASE = "stopped, ^K: cut.out_of_phase machine.fault or stopped, ^K: cut.tool_leads machine.fault"
TRIPPED_BLIND = f"{OUT_OF_PHASE} or {FAULT_K}"
"""Half a second of looks tells the phase; a loop that sees nothing may trip before."""

UNASKED, SHIFTED = "stopped, ^A: machine.moves_unasked", "ready, lines: controller.zero_shifted machine.not_homed"
ENERGISED = "stopped, ^K: machine.energised"
OPENED = "stopped, ^K: machine.loop_open"
NOT_ENABLED = "ready, lines: machine.not_enabled"
JOG_ENDED, HOME_ENDED = "stopped, ^A: machine.not_arrived", "stopped, ^A: machine.home_ended"
ASTRAY, UNEXPECTED = "stopped, ^A: machine.jog_astray", "stopped, ^A: machine.unexpected_motion"
ENDED_BY_OTHERS = "stopped, ^A: cut.ended_early cut.stopped_by_another"
HELD_BY_OTHERS = "stopped, ^A: cut.ended_early cut.held_by_another"
OVERRIDE, OUTSIDE = "stopped, ^A: cut.override", "stopped, ^A: cut.outside_plan"
OFF_ARMED, ONE_OFF = "ready, nothing: session.arm_realigned", "ready, nothing: machine.opened_unasked"
"""What is armed is what was read: anything else in a poll disarms it."""

NOT_AS_PLANNED = "stopped, ^A: controller.constant_differs"
CHANGED_IN_CUT = "stopped, ^A: cut.constant_differs"
NOT_THAT_TABLE = "stopped, ^A: controller.table_differs"
"""What was loaded wrong is no refusal: a line that arrives otherwise than it was sent is a fault of its link."""

RESET = "stopped, ^K: controller.was_reset"
RESET_AT_REST = "ready, nothing: controller.was_reset"
RESET_LINE = f"stopped, ^K: {NO_ANSWER} {UNKNOWN} controller.was_reset"
"""The settings of the line are those of the controller again: no acknowledgement comes."""

ABORTED_BY_OTHERS = (ENERGISED, SAME, JOG_ENDED, HOME_ENDED, SAME, SAME, ENDED_BY_OTHERS, SAME)


def _only(**cells: str) -> tuple[str, ...]:
    """Return a row of which only the cells that are named (`DOWNLOADING=...`) are tried."""
    return tuple(cells.get(situation.name, UNTRIED) for situation in Situation)


def _program(cut: str) -> tuple[str, ...]:
    """Return the row of what concerns programs, and axes only if the controller thought otherwise."""
    return _only(IDLE=SAME, JOGGING=SAME, HOMING=SAME, DOWNLOADING=SAME, ARMED=SAME, CUTTING=cut)


def _overridden() -> tuple[str, ...]:
    """Return the row of an override: what is armed is disarmed by it, a cut is stopped."""
    disarmed = "session.arm_override"
    armed = {"DOWNLOADING": f"ready, lines: {disarmed}", "ARMED": f"ready, nothing: {disarmed}"}
    return _only(IDLE=SAME, JOGGING=SAME, HOMING=SAME, **armed, CUTTING=OVERRIDE)


def _loaded(download: str, cut: str) -> tuple[str, ...]:
    """Return the row of what concerns a program that is loaded."""
    return _only(DOWNLOADING=download, ARMED=SAME, CUTTING=cut)


_ROWS: Mapping[str, tuple[str, ...]] = {
    # drives off, idle, jogging the carriage, homing, downloading, armed, cutting, stopping a cut
    "no fault": (
        *("ready, nothing", "ready, nothing", "ready, renewals", "ready, lines"),
        *("armed, lines", "armed, nothing", "ready, lines", ABORTED),
    ),
    # One look is lost: it is asked again. A line of a program is not, because it may have been stored.
    "dropped-ack, once": ONCE,
    "extra-line, once": ONCE,
    "nul, once": ONCE,
    "bare-bel, once": ONCE,
    "dropped-ack, 1 s": LONGER,
    "extra-line, 1 s": LONGER,
    "nul, 1 s": LONGER,
    "bare-bel, 1 s": LONGER,
    # One answer that is late is as one that is lost.
    "late-reply, 500 ms, once": (SAME, SAME, SAME, SAME, SAME, SAME, SAME, ABORTED_IN_DOUBT),
    # Longer than a lease: what moves is ended by the card. Shorter than what a line of a program may take.
    "late-reply, 500 ms, for 2 s": (SILENT, SILENT, SILENT, SILENT, SAME, SILENT, SILENT_CUT, ABORTED_IN_DOUBT),
    # Slow, but sound: nothing is lost by it, and a stop is a stop.
    "late-reply, 150 ms, each": UNHARMED,
    "split-segments": UNHARMED,
    "wrong-checksum": UNHARMED,
    "9600-baud": UNHARMED,
    "cut-cable": (GONE, GONE, GONE, GONE, GONE_LINE, GONE, GONE, GONE_STOPPING),
    "hang, 0.1 s": UNHARMED,
    "hang, 0.4 s": LATE,
    "hang": MUTE,
    # At rest an encoder that does not count is as one that does.
    "encoder-loss, tool": (SAME, SAME, SAME, FAULT_K, SAME, SAME, TRIPPED_BLIND, SAME),
    "encoder-loss, spindle": (SAME, SAME, SAME, FAULT_K, SAME, SAME, FAULT_K, SAME),
    # The rest of this cut is 0.4 mm of Z, and the fatal following error 1 mm: it never arrives, and does not trip.
    "encoder-loss, carriage": (SAME, SAME, FAULT_K, FAULT_K, SAME, SAME, TIMEOUT, SAME),
    "index-lost, tool": NO_INDEX_BEFORE_A_LIMIT,
    "index-lost, spindle": NO_INDEX,
    "index-lost, carriage": NO_INDEX_BEFORE_A_LIMIT,
    # The fault input is not looked at while an amplifier is off.
    "amplifier-fault, tool": TRIPPED,
    "amplifier-fault, spindle": TRIPPED,
    "amplifier-fault, carriage": TRIPPED,
    "limit, tool positive": AT_A_LIMIT,
    "limit, tool negative": AT_A_LIMIT,
    # A rotary axis has no switches: its flags are not used.
    "limit, spindle positive": UNHARMED,
    "limit, spindle negative": UNHARMED,
    "limit, carriage positive": AT_A_LIMIT,
    "limit, carriage negative": AT_A_LIMIT,
    # What stands jammed has no following error. The lobe is less than the fatal one of the tool, its way out more.
    "following-error-trip, tool": (SAME, SAME, SAME, FAULT_K, SAME, SAME, FAULT_K, SAME),
    "following-error-trip, spindle": (
        *(SAME, SAME, SAME, FAULT_K, SAME, SAME, FAULT_K),
        "stopped, ^A (^K): machine.fault",
    ),
    "following-error-trip, carriage": (SAME, SAME, FAULT_K, FAULT_K, SAME, SAME, TIMEOUT, SAME),
    "spindle-ripple": UNHARMED,
    "watchdog": MUTE,
    "slow-background": UNHARMED,
    "slow-background, 2.5 s": MUTE,
    # Settings are compared where something is armed; what was armed before is refused at its start.
    # In a cut they are read in turn: one with other settings is not the planned one.
    "stranger-writes, a gain": (*SET_OTHERWISE[:6], CHANGED_IN_CUT, SAME),
    "stranger-writes, a limit": (*SET_OTHERWISE[:6], CHANGED_IN_CUT, SAME),
    # What moves is no longer guarded: it is stopped; a cut ends at the end of its turn before. The jog is over.
    "stranger-writes, no PLCs": (SAME, SAME, SAME, UNGUARDED, NOT_AS_IT_WAS, SAME, UNGUARDED, SAME),
    # As a lost reply: the settings of the line are made again.
    "stranger-writes, the handshake": ONCE,
    "stranger-writes, an open buffer": UNHARMED,
    "stranger-writes, another owner": (
        *(OUSTED, OUSTED, OUSTED_MOVING, OUSTED_MOVING, "ready, lines: owner.ousted", OUSTED),
        *(OUSTED_MOVING, "stopped, ^A: owner.ousted"),
    ),
    # What it moves is not ours, and is stopped; drives that come on where hands may be are switched off.
    "stranger-writes, a jog": (
        *(
            "stopped, ^K: machine.energised",
            UNASKED,
            "stopped, ^A: machine.not_arrived or stopped, ^A: machine.jog_astray",
        ),
        "stopped, ^A: machine.unexpected_motion",
        *(SHIFTED, UNASKED, SAME, SAME),  # it has come to rest when the download is over
    ),
    # In a cut the controller takes no jog.
    "stranger-writes, a jog without end": (ENERGISED, UNASKED, ASTRAY, UNEXPECTED, UNASKED, UNASKED, SAME, SAME),
    # It has come to rest when the download is over; any motion that is seen is stopped.
    "stranger-writes, a jog of the tool": (
        ENERGISED,
        UNASKED,
        UNEXPECTED,
        HOME_ENDED,
        SHIFTED,
        UNASKED,
        SAME,
        SAME,
    ),
    # Drives that others switch off at rest are off: nothing stays armed. A program keeps its axes.
    "stranger-writes, a kill of the tool": (SAME, ONE_OFF, OPENED, OPENED, NOT_ENABLED, ONE_OFF, SAME, SAME),
    "stranger-writes, ^K": (SAME, SAME, OPENED, OPENED, NOT_ENABLED, OFF_ARMED, OPENED, ABORTED_IN_DOUBT),
    # An abort closes loops, also where hands may be. At rest with the drives on it changes nothing.
    "stranger-writes, ^A": ABORTED_BY_OTHERS,
    "stranger-writes, &1A": ABORTED_BY_OTHERS,
    # The segment in progress may be the last, and end in full motion.
    "stranger-writes, &1Q": _program(f"{ENDED_BY_OTHERS} or {OUTSIDE}"),
    # The override is that of programs, also of one that is armed.
    "stranger-writes, &1H": _overridden(),
    "stranger-writes, &1%0": _overridden(),
    "stranger-writes, &1%50": _overridden(),
    # With the drives off nothing was homed yet.
    "stranger-writes, $$$": (
        *(SAME, RESET_AT_REST, RESET, RESET, RESET_LINE, RESET_AT_REST, RESET),
        "stopped, ^A ^K: controller.was_reset",
    ),
    # What is loaded matters where something is; what is armed is refused at its start.
    "stranger-writes, M26=1": _loaded(SAME, HELD_BY_OTHERS),
    "stranger-writes, fewer turns": _loaded(
        NOT_AS_PLANNED, f"{CHANGED_IN_CUT} or stopped, ^A: cut.ended_early cut.constant_changed"
    ),
    "stranger-writes, a deeper cut": _loaded(NOT_AS_PLANNED, f"{OUTSIDE} or {CHANGED_IN_CUT}"),
    "stranger-writes, a larger lobe": _loaded(NOT_AS_PLANNED, f"{OUTSIDE} or {CHANGED_IN_CUT}"),
    # A buffer that is open, or runs, is not another's to open.
    "stranger-writes, another program": _loaded(SAME, SAME),
    **{f"stranger-writes, {name}": _loaded(NOT_AS_PLANNED, CHANGED_IN_CUT) for name in ALONG},
    # What shapes a cut is read in turn; a program that runs keeps its axes: their definition is refused.
    **{
        f"stranger-writes, {name}, put back": _only(CUTTING=SAME if name == KEPT_OUT else CHANGED_IN_CUT)
        for name in (*HELD, DRIFTS)
    },
    # The axis that is homed instead has lost its zero by that.
    "garbled-line, a home search": _only(HOMING="stopped, ^A: controller.home_lost"),
    # A cut goes to its start by jogs.
    "garbled-line, a jog": _only(JOGGING=ASTRAY, CUTTING=ASTRAY),
    "garbled-line, a depth": _only(DOWNLOADING=NOT_AS_PLANNED),
    "garbled-line, an entry of a table": _only(DOWNLOADING=NOT_THAT_TABLE),
    "garbled-line, an entry of one row": _only(DOWNLOADING=NOT_THAT_TABLE),
}

TABLE: Mapping[str, Mapping[Situation, str]] = {
    name: dict(zip(Situation, cells, strict=True)) for name, cells in _ROWS.items()
}


def tried(row: str, situation: Situation) -> bool:
    """Return whether a cell is tried."""
    return TABLE[row][situation] != UNTRIED


def right(row: str, situation: Situation) -> str:
    """Return what is right in a cell, with what happens without a fault where that is meant."""
    said = TABLE[row][situation]
    return TABLE["no fault"][situation] if said == SAME else said


STOPPING = Situation.STOPPING


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """One thing that is wrong, and where."""

    what: str
    cells: tuple[tuple[str, Situation], ...]


def _cells(rows: tuple[str, ...], *situations: Situation) -> tuple[tuple[str, Situation], ...]:
    return tuple((row, situation) for row in rows for situation in situations)


WRONG: tuple[Wrong, ...] = (
    Wrong(
        what="A loop that trips, or that another host opens, between the last look and control-A is closed again.",
        cells=_cells(
            (
                *(f"amplifier-fault, {axis}" for axis in ("tool", "spindle", "carriage")),
                *("encoder-loss, spindle", "following-error-trip, spindle"),
                *("stranger-writes, ^K", "stranger-writes, $$$"),
            ),
            STOPPING,
        ),
    ),
)

KNOWN: Mapping[tuple[str, Situation], str] = {cell: wrong.what for wrong in WRONG for cell in wrong.cells}
"""By row and situation: what is wrong there."""
