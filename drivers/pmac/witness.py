"""A second PLC that witnesses a cut: it sees in each background cycle what a host sees at its polls alone.

It keeps the extremes of the tool's following error, correction and bias while the carriage is in the feed, and the
first change of the loop, scale and encoders of the tool, of the servo period, and of the program's constants.
It counts its cycles beside the echo of the heartbeat: as many of each prove that it ran without a gap. It commands
nothing, so a cut without it is as safe; the heartbeat's own PLC stays as short as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

from drivers.controller import Controller
from drivers.errors import ControllerError
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.heartbeat.arming import LIST_TIMEOUT_S, statements_of
from drivers.pmac.heartbeat.watchdog import register_pointer
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import without_end
from drivers.pmac.language.text import format_number
from drivers.pmac.memory import Pointer
from drivers.pmac.reserved import ECHO, WITNESS, WITNESS_PLC, WITNESS_POINTERS
from profiles.machine import MachineProfile
from profiles.problem import Problem

TOOL_NUMBERS = (30, 31, 32, 33, 34, 35, 68, 69, 8, 3, 4)
SERVO_PERIOD = "I10"
_OF_PAPER = (*range(100, 700, 100), 610, 620, 621)
CONSTANTS = (*range(11, 24), 28, 32, *range(65, 69), 72, 73, 76, *range(81, 95), *_OF_PAPER)
"""P-variables that programs are set with and do not write; nobody writes those that a program does not use."""
HALF = len(CONSTANTS) // 2  # of them in a line: all would be longer than one may be

REGISTERS = ("following_error", "compensation", "bias")
PARTS = 32.0  # of a count, and that Ix08 times: the unit of these registers
GAP = "cut.witness_gap"
LEAST_UM = 4.0  # by which a following error has to exceed the polled ones to be told
IDLE, BEGINS, WATCHES, PASSED = 0, 1, 2, 3  # the carriage has `PASSED` the feed: it may go back through it

_COUNT, _STATE, _FIRST, _LAST = (f"P{number}" for number in WITNESS[:4])
_COUNTS = f"{_COUNT}={_COUNT}+1"
_EXTREMES = tuple(f"P{number}" for number in WITNESS[4:10])
_SETTINGS, _CHANGED, _CONSTANTS, _CONSTANT_CHANGED, _SUM, _CONSTANT_SUM, _INSIDE = (
    f"P{number}" for number in WITNESS[10:17]
)
_VALUES = tuple(f"P{number}" for number in WITNESS[17:])
_POINTERS = tuple(f"M{number}" for number in WITNESS_POINTERS)


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessReport:
    """What the PLC has seen: `missing` why there is none, `gap` why it has not seen all of it.

    `before` and `first` are the settings at the beginning and at their first change, by name; alike without one.
    `extremes` are the lowest and highest value of each register in the feed, in um; None where it saw none of it.
    The carriage has `passed` the feed; else, of a cut that was ended, they may be of its way back.
    """

    missing: Problem | None = None
    gap: Problem | None = None
    before: Mapping[str, float]
    first: Mapping[str, float]
    constants_changed: bool = False
    extremes: Mapping[str, tuple[float, float]] | None = None
    passed: bool = True

    def changes(
        self, correction_um: tuple[float, float] | None, following_um: tuple[float, float] | None
    ) -> Iterator[Problem]:
        """Yield what somebody has changed in the cut, though it may have been restored.

        `correction_um` is the range of the table in use, None without one: then the correction has to stay.
        `following_um` is that of the polled following errors, None where a feed hold took the tool off its path.
        """
        for name, value in self.first.items():
            if value != self.before[name]:
                value_then, limit = format_number(value), format_number(self.before[name])
                yield Problem(code="cut.witness_changed", key=name, value=value_then, limit=limit)
        if self.constants_changed:
            yield Problem(code="cut.witness_constant", key=f"P{CONSTANTS[0]} … P{CONSTANTS[-1]}")
        if self.extremes is None:
            return
        low, high = self.extremes["bias"]
        if high - low > 0.0:
            yield _register_problem("cut.witness_bias", high - low, 0.0)
        low, high = self.extremes["compensation"]
        least, most = (low, low) if correction_um is None else correction_um
        if (beyond_um := max(high - most, least - low)) > 1e-3:
            yield _register_problem("cut.witness_compensation", beyond_um, 0.0)
        if following_um is not None and self.passed:
            low, high = self.extremes["following_error"]
            margin_um = max(LEAST_UM, following_um[1] - following_um[0])
            beyond_um = max(high - following_um[1], following_um[0] - low)
            if beyond_um > margin_um:
                yield _register_problem("cut.witness_following_error", beyond_um, margin_um)


def _register_problem(code: str, off_um: float, limit_um: float) -> Problem:
    return Problem(code=code, key="tool", value=f"{off_um:.2f} um", limit=f"{limit_um:.1f} um")


class Witness:
    """The witness in one controller. Every method raises LinkError when the link breaks."""

    def __init__(self, client: Controller, machine: MachineProfile) -> None:
        self._client, self._machine = client, machine
        dialect, tool = DIALECTS[machine.controller.family], machine.tool.motor
        places = (*((tool, name) for name in REGISTERS), (machine.carriage.motor, "commanded"))
        self._pointers: Mapping[str, Pointer] = {
            name: register_pointer(dialect, *place) for name, place in zip(_POINTERS, places, strict=True)
        }
        self._settings = (*(f"I{dialect.motor_index(tool, number)}" for number in TOOL_NUMBERS), SERVO_PERIOD)
        self._scales = tuple(f"I{dialect.motor_index(motor, 8)}" for motor in (tool, machine.carriage.motor))
        self._before: dict[str, float] = {}
        self._begun: tuple[float, float] = (0.0, 0.0)
        self._missing: Problem | None = None

    def prepare(self) -> None:
        """Load the PLC where there is none or an older one of ours; drives are disabled.

        A program of somebody else stays there: the cut is made without the witness, which is told then. So it is
        where the controller refuses it.
        """
        if self._is_held() or self._is_another():
            return
        with suppress(ControllerError):
            definitions = (f"{name}->{pointer}" for name, pointer in self._pointers.items())
            head = ("CLOSE", f"DISABLE PLC{WITNESS_PLC}", *definitions, f"{_STATE}={IDLE}")
            text = (f"OPEN PLC{WITNESS_PLC}", "CLEAR", *self.lines(), "CLOSE", f"ENABLE PLC{WITNESS_PLC}")
            self._client.download((*head, *text))

    def begin(self, carriage_counts: float, first_counts: float, last_counts: float) -> None:
        """Begin anew, at rest with the carriage at `carriage_counts`: its feed is between the other two."""
        self._missing = None
        if not self._is_held():
            self._missing = Problem(code="cut.witness_missing", key=f"PLC {WITNESS_PLC}")
            return
        values = self._client.numbers(*self._settings, again=True)
        self._before = dict(zip(self._settings, values, strict=True))
        at, scale = self._client.numbers(_POINTERS[3], self._scales[1], again=True)
        first, last = (at + (counts - carriage_counts) * PARTS * scale for counts in (first_counts, last_counts))
        window = f"{_FIRST}={format_number(first)} {_LAST}={format_number(last)}"
        self._client.request(f"{window} {_STATE}={BEGINS}")
        self._begun = self._counts()

    def report(self) -> WitnessReport:
        """Read what was seen since the beginning, and whether the PLC is still ours."""
        nothing = dict(self._before)
        if self._missing is not None:
            return WitnessReport(missing=self._missing, before=nothing, first=nothing)
        counted, echoed = (now - then for now, then in zip(self._counts(), self._begun, strict=True))
        flags = (_STATE, _CHANGED, _CONSTANT_CHANGED, _INSIDE, self._scales[0])
        state, changed, constants, inside, scale = self._client.numbers(*flags, again=True)
        gap = None
        if abs(counted - echoed) > 1 or state < WATCHES or not inside or not self._is_held():
            value, limit = format_number(counted), format_number(echoed)
            gap = Problem(code=GAP, key=f"PLC {WITNESS_PLC}", value=value, limit=limit)
        lows_and_highs = self._client.numbers(*_EXTREMES, again=True)
        um = self._machine.tool.count_um / (PARTS * scale) if scale else 0.0
        pairs = zip(lows_and_highs[::2], lows_and_highs[1::2], strict=True)
        ranges = {name: (um * low, um * high) for name, (low, high) in zip(REGISTERS, pairs, strict=True)}
        first = self._client.numbers(*_VALUES, again=True) if changed else tuple(self._before.values())
        return WitnessReport(
            gap=gap,
            before=nothing,
            first=dict(zip(self._settings, first, strict=True)),
            constants_changed=bool(constants),
            extremes=ranges if inside else None,
            passed=state == PASSED,
        )

    def _counts(self) -> tuple[float, float]:
        counted, echoed = self._client.numbers(_COUNT, f"P{ECHO}", again=True)
        return counted, echoed

    def _is_another(self) -> bool:
        """Whether a program that is none of ours has the number."""
        try:
            found = without_end(self._client.question(f"LIST PLC{WITNESS_PLC}", LIST_TIMEOUT_S))
        except ControllerError:  # there is none
            return False
        try:
            return bool(found) and statements_of(found)[:1] != statements_of((_COUNTS,))
        except PmacError:
            return True

    def _is_held(self) -> bool:
        try:
            listing = self._client.question(f"LIST PLC{WITNESS_PLC}", LIST_TIMEOUT_S)
            found = self._client.query(*(f"{name}->" for name in _POINTERS), again=True)
            pointers = [text.rpartition("->")[2].strip() for text in found]
            return statements_of(without_end(listing)) == statements_of(self.lines()) and pointers == [
                str(each) for each in self._pointers.values()
            ]
        except (ControllerError, PmacError):
            return False

    def lines(self) -> tuple[str, ...]:
        """Return the lines of the PLC, as they are sent."""
        constants = [f"P{number}" for number in CONSTANTS]
        here = dict(zip(_EXTREMES, (name for name in _POINTERS[:3] for _ in range(2)), strict=True))
        widen = (
            line
            for place, (kept, now) in enumerate(here.items())
            for line in (f"IF({now}{'>' if place % 2 else '<'}{kept})", f"{kept}={now}", "ENDIF")
        )
        return (
            _COUNTS,
            f"{_SUM}={_weighted_sum(self._settings)}",
            f"{_CONSTANT_SUM}={_weighted_sum(constants[:HALF])}",
            f"{_CONSTANT_SUM}={_CONSTANT_SUM}+{_weighted_sum(constants[HALF:], 2 + HALF)}",
            f"IF({_STATE}={BEGINS})",
            *(f"{name}=0" for name in (_CHANGED, _CONSTANT_CHANGED, _INSIDE)),
            *(f"{_SETTINGS}={_SUM}", f"{_CONSTANTS}={_CONSTANT_SUM}", f"{_STATE}={WATCHES}", "ENDIF"),
            f"IF({_STATE}>{BEGINS} AND {_CHANGED}=0 AND {_SUM}!={_SETTINGS})",
            *(f"{kept}={name}" for kept, name in zip(_VALUES, self._settings, strict=True)),
            *(f"{_CHANGED}=1", "ENDIF"),
            f"IF({_STATE}>{BEGINS} AND {_CONSTANT_SUM}!={_CONSTANTS})",
            *(f"{_CONSTANT_CHANGED}=1", "ENDIF"),
            f"IF({_STATE}={WATCHES} AND {_POINTERS[3]}!<{_FIRST} AND {_POINTERS[3]}!>{_LAST})",
            f"IF({_INSIDE}=0)",
            *(f"{kept}={now}" for kept, now in here.items()),
            *("ENDIF", f"{_INSIDE}={_INSIDE}+1", *widen, "ENDIF"),
            f"IF({_STATE}={WATCHES} AND {_POINTERS[3]}>{_LAST})",
            *(f"{_STATE}={PASSED}", "ENDIF"),
        )


def _weighted_sum(names: tuple[str, ...] | list[str], first: int = 2) -> str:
    """Return a sum in which each has a weight of its own: two equal and opposite changes do not cancel."""
    return "+".join(f"{weight}*{name}" for weight, name in enumerate(names, start=first))
