"""The PLC that ends jogs and cuts on a watchdog timeout, as text for a machine, a family and a policy.

It is written as one sequence from top to bottom with waits in it: a reset clears its place, so that a controller
that is powered up never resumes what it was about to end. Each loss is handled once; a scan gives one command
(CMD) at most, because the controller queues commands until after the scan.

None of its commands may close a loop: J/, J= and A would, so only loops that are closed in that very scan get
them.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from drivers.pmac import reserved
from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat import watchdog as r
from drivers.pmac.language.plc_statements import parse_plc_line, stored_lines
from drivers.pmac.language.text import format_plc_line
from drivers.pmac.settings import settings_with
from profiles.machine import MachineProfile

GRACE_MS = 1100.0  # Time for a cut to retract its tool: a turn at 100 rpm, and a distance of 2 mm at 10 mm/s

RUN_DOWN_MS = 350.0
"""Additional time to come to its end: with both, whatever the cut does, it is at rest within 2 s."""

REST_LIMIT_MS = 500.0  # How long to wait for an aborted tool before it is retracted, which stops it first
SETTLE_MS = 20.0  # Delay after a command, or an end, until the status of a motor is reliable

OUT_LIMIT_MS = 2000.0
OUT_BAND_MM = 0.1
"""How long to wait for the tool to retract, and the tolerance of its target."""


class Policy(StrEnum):
    """Fate of a cut without a host."""

    RETRACT = "retract"  # It ends at the end of its turn, with its own retraction; one that does not is aborted

    FINISH = "finish"  # It continues to its end
    STOP = "stop"  # It is aborted at once, and the tool is retracted


def plc_text(machine: MachineProfile, dialect: Dialect, policy: Policy) -> str:
    """Return the text with its comments; a line of it is a line of the PLC."""
    return "".join(f"{line}\n" for line in _PlcWriter(machine, dialect, policy).lines())


def plc_lines(machine: MachineProfile, dialect: Dialect, policy: Policy) -> tuple[str, ...]:
    """Return the lines as they are sent and stored, without comments."""
    text = plc_text(machine, dialect, policy)
    stored = (kept for line in text.splitlines() for kept in stored_lines(parse_plc_line(line)))
    return tuple(format_plc_line(line) for line in stored)


def set_up_lines(machine: MachineProfile, dialect: Dialect, policy: Policy) -> tuple[str, ...]:
    """Return the lines that load the heartbeat into a controller at rest; none of them causes motion.

    The permission for PLCs, I5, is not among them: it lets every other PLC of the controller run, too. Nor is an
    unacknowledged loss cleared.
    """
    number = reserved.HEARTBEAT_PLC
    return (
        "CLOSE",
        f"DISABLE PLC{number}",
        *r.definition_lines(machine, dialect),
        f"P{reserved.ACTIVITY}={r.GuardedActivity.NOTHING:d}",
        f"OPEN PLC{number}",
        "CLEAR",
        *plc_lines(machine, dialect, policy),
        "CLOSE",
        f"ENABLE PLC{number}",
    )


class _PlcWriter:
    """The parts of the text, each a few lines."""

    def __init__(self, machine: MachineProfile, dialect: Dialect, policy: Policy) -> None:
        self._machine = machine
        self._policy = policy
        self._motors = r.motors(machine)
        self._watchdog, self._timer = r.watchdog_timer(dialect).name, r.wait_timer(dialect).name
        self._i10 = settings_with(machine.controller.variables, dialect)[r.SERVO_PERIOD]
        self._echo = f"P{reserved.ECHO}=P{reserved.ECHO}+1"
        # A program that has calculated its last move no longer runs, but is still being played.
        self._busy = f"M{r.RUNNING}=1 OR M{r.TOOL_IN_MOVE}=1"
        self._tool_counts = f"(M{r.TOOL_ACTUAL}+M{r.TOOL_BIAS})/(I{machine.tool.motor}08*32)"
        band = round(OUT_BAND_MM * machine.tool.counts_per_mm)
        self._nearly_out = f"P{reserved.RETRACTED}+{band}"
        self._still_in = f"{self._tool_counts}>{self._nearly_out}"
        self._all_closed = sum(self._motors)

    def lines(self) -> Iterator[str]:
        watchdog, activity, lost = self._watchdog, f"P{reserved.ACTIVITY}", f"P{reserved.LOST}"
        yield f"; policy {self._policy}: {watchdog} is the heartbeat timer; {activity}: 1 guards a jog, 2 a cut"
        yield f"{self._echo} ; the host sees that this runs"
        yield f"P{r.ENDING}=0 ; nothing is being ended"
        yield f"IF({watchdog}<0)"
        yield f"{watchdog}=0 ; else it would count further down and roll over"
        yield "ENDIF"
        yield f"IF({activity}>0 AND {watchdog}<{self._cycles(r.MARGIN_MS) + 1}) ; the host is silent"
        yield f"{lost}={activity}"
        yield f"{activity}=0 ; so this comes once"
        yield f"P{r.ENDING}=1"
        yield from self._look_at_loops()
        yield f"IF({lost}={r.GuardedActivity.JOG:d})"
        yield from self._end_jog()
        if self._policy is not Policy.FINISH:
            yield "ELSE"
            yield from self._end_cut()
        yield "ENDIF"
        yield "ENDIF"

    def _cycles(self, time_ms: float) -> int:
        return r.cycles_of(time_ms, self._i10)

    def _look_at_loops(self) -> Iterator[str]:
        terms = (
            f"{'' if bit == 1 else f'{bit}*'}(1-M{r.OPEN_LOOP[bit]})*M{r.AMPLIFIER[bit]}" for bit in self._motors
        )
        names = {r.TOOL: "tool", r.SPINDLE: "spindle", r.CARRIAGE: "carriage"}
        listed = ", ".join(f"{bit} {names[bit]}" for bit in self._motors)
        yield f"P{r.CLOSED}={'+'.join(terms)} ; closed loops: {listed}"

    def _end_jog(self) -> Iterator[str]:
        """Stop every closed motor with one command; which motors those are is one of a few cases."""
        for closed in range(self._all_closed, 0, -1):
            if not closed & ~self._all_closed:
                stops = "".join(f"#{motor}J/" for bit, motor in self._motors.items() if bit & closed)
                yield f"IF(P{r.CLOSED}={closed})"
                yield f'CMD"{stops}"'
                yield "ENDIF"

    def _end_cut(self) -> Iterator[str]:
        if self._policy is Policy.RETRACT:
            yield f"M{reserved.END_FLAG}=1 ; end at the end of this turn"
            yield f"{self._timer}=P{r.GRACE}+P{r.RUN_DOWN}"
            left = f"{self._timer}>P{r.RUN_DOWN} OR {self._timer}>0 AND {self._tool_counts}!>{self._nearly_out}"
            yield from self._wait(self._busy, left)
            yield from self._look_at_loops()
        yield f"P{r.TAKE_OUT}=0"
        yield f"IF({self._busy})"
        yield from self._abort()
        yield "ENDIF"
        yield f"IF(P{r.CLOSED}!={self._all_closed}) ; a loop has tripped, or was opened: the program is over"
        yield f"P{r.TAKE_OUT}=1"
        yield "ENDIF"
        yield from self._take_out()
        yield from self._stop_spindle()

    def _abort(self) -> Iterator[str]:
        yield f"P{r.TAKE_OUT}=1"
        yield f"IF(P{r.CLOSED}={self._all_closed})"
        yield f'CMD"&{r.SYSTEM}A"'
        yield "ELSE"
        yield f'CMD"&{r.SYSTEM}Q" ; A would close what is open'
        yield "ENDIF"
        yield f"{self._timer}={self._cycles(REST_LIMIT_MS)} ; the tool comes to rest"
        seen = self._cycles(REST_LIMIT_MS) - self._cycles(SETTLE_MS)
        unseen = f"M{r.TOOL_STILL}=0 AND M{r.OPEN_LOOP[r.TOOL]}=0 OR {self._timer}>{seen}"
        yield from self._wait(unseen, f"{self._timer}>0")

    def _take_out(self) -> Iterator[str]:
        tool = self._machine.tool.motor
        yield f"IF(P{r.TAKE_OUT}=1 AND M{r.OPEN_LOOP[r.TOOL]}=0 AND M{r.AMPLIFIER[r.TOOL]}=1)"
        yield f"AND(M{r.TOOL_HOMED}=1 AND {self._still_in}) ; never towards the work"
        yield f"M{r.TOOL_TARGET}=P{reserved.RETRACTED}"
        yield f'CMD"#{tool}J=*"'
        yield f"{self._timer}={self._cycles(OUT_LIMIT_MS)}"
        yield from self._wait(f"{self._still_in} AND M{r.OPEN_LOOP[r.TOOL]}=0", f"{self._timer}>0")
        yield "ENDIF"

    def _stop_spindle(self) -> Iterator[str]:
        if r.SPINDLE not in self._motors:
            return
        yield f"{self._timer}={self._cycles(SETTLE_MS)} ; what has just come to rest is seen at rest"
        yield from self._wait(f"{self._timer}>0")
        closed = f"M{r.OPEN_LOOP[r.SPINDLE]}=0 AND M{r.AMPLIFIER[r.SPINDLE]}=1"
        yield f"IF({closed} AND M{r.SPINDLE_STILL}=0 AND M{r.SPINDLE_ABORTING}=0)"
        yield f'CMD"#{self._motors[r.SPINDLE]}J/" ; a spindle that is not the program\'s'
        yield "ENDIF"

    def _wait(self, *conditions: str) -> Iterator[str]:
        """Require all of the conditions; each is a line of its own, and so a unit."""
        for word, condition in zip(("WHILE", *("AND",) * len(conditions)), conditions, strict=False):
            yield f"{word}({condition})"
        yield self._echo
        yield "ENDWHILE"
