"""The rows of the matrix: every fault of the catalogue, in each form that matters to a console."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName
from drivers.simulator.faults.catalogue import Value
from drivers.simulator.machine import SimulatedLathe
from tests.matrix.rig import HELD_MM, SHORT_MM

AXES = tuple(AxisName)


@dataclass(frozen=True, kw_only=True)
class Row:
    """A fault with what it is told; without `for_s` it lasts until it is mended. `name` is that of the row.

    `moves` are the axes that the fault itself moves or energises. Of `unseen` nobody can know where it is, as its
    encoder does not count. One that is `early` is there before what it meets is ordered. `strategy` is that of
    the cut, `cut_mm` its length. `later` are further lines of another host, so many seconds behind its first one.
    """

    name: str
    fault: str
    for_s: float | None = None
    given: Mapping[str, Value] = field(default_factory=dict)
    moves: frozenset[AxisName] = frozenset()
    early: bool = False
    strategy: Strategy = Strategy.PVT
    cut_mm: float = SHORT_MM
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
    *(_held(name, line, (after_s, back)) for name, (line, back, after_s) in HELD.items()),
    _drift(),
    _garbled("a home search", "#1HM", "#3HM"),
    _garbled("a jog", "#3J=", "#3J=9"),
    _garbled("a depth", "P11=1", "P11=2"),
    _garbled("an entry of a table", " 4618 ", " 4628 ", Strategy.CAM),
)
