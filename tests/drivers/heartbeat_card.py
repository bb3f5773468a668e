"""A card with the heartbeat on it, a host that may fall silent, and a small cut that looks at the lease."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.pmac.dialect import Dialect
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.heartbeat.watch import Keeper
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from profiles.machine import MachineProfile
from tests.drivers.plc_card import plc_card, run_for, values
from tests.drivers.wire_card import Wire

TOOL, SPINDLE, CARRIAGE = 1, 2, 3
SURFACE, DEEP = 0, 10_000
"""Where the small cut has the tool out and in, counts."""

RPM_1000 = 10_000 / 60.0
"""Counts/ms of the spindle."""

TURN_MS = 60
BEAT_CYCLES = 10
"""Background cycles between two renewals: 48.7 ms."""


@dataclass
class Host:
    """One host of the card, with its lease; `silent_since_s` is when it last sent one."""

    card: Wire
    keeper: Keeper
    silent_since_s: float = 0.0

    def beat(self, line: str | None = None) -> None:
        """Send a lease, or a line that begins with one, and note when."""
        self.card.tell(self.keeper.line if line is None else line)
        self.silent_since_s = self.card.sim.now_s()

    def keep(self, seconds: float) -> None:
        """Let time pass with renewals on time."""
        end = self.card.sim.now_s() + seconds
        while self.card.sim.now_s() < end:
            run_for(self.card, BEAT_CYCLES)
            self.beat()

    @property
    def silence_s(self) -> float:
        return self.card.sim.now_s() - self.silent_since_s

    def until(self, seen: Callable[[], bool], limit_s: float = 10.0) -> float:
        """Let background cycles pass until something is so; return how long the host was silent then."""
        while not seen():
            assert self.silence_s < limit_s
            run_for(self.card)
        return self.silence_s

    def value(self, name: str) -> float:
        return values(self.card, name)[0]

    def still(self, *motors: int) -> bool:
        """Whether motors (all, if none is named) are commanded to rest and will stay there."""
        system = self.card.card.systems[1]
        chosen = motors or (TOOL, SPINDLE, CARRIAGE)
        found = [self.card.card.motors[number] for number in chosen]
        at_rest = not any(motor.velocity or motor.jogging for motor in found)
        return at_rest and (bool(motors) or not (system.running or system.moving))

    def place(self, motor: int) -> float:
        return self.card.card.motors[motor].position


def host_of(machine: MachineProfile, dialect: Dialect, policy: Policy = Policy.RETRACT, i5: int = 2) -> Host:
    """A card with the heartbeat, drives on, every axis at home and the lease of nobody."""
    card = plc_card(machine, dialect, i5=i5)
    card.tell(*set_up_lines(machine, dialect, policy))
    card.tell("#1J/#2J/#3J/", "#1HMZ#2HMZ#3HMZ")
    return Host(card, Keeper(dialect=dialect, i10=machine.controller.variables["I10"]))


def cut_program(loop: str, *, with_spindle: bool = True) -> tuple[str, ...]:
    """1000 rpm, the tool in by 2 mm, 20 um to and fro three times a turn while `loop` holds, and out again."""
    step = f"Y{RPM_1000 * 10:.6f}" if with_spindle else ""
    run_up = f"Y{RPM_1000 * 500:.6f}" if with_spindle else "X0"
    away = f"Y{RPM_1000 * 200:.6f}" if with_spindle else ""
    return (
        "OPEN PROG5",
        "CLEAR",
        "M26=0",
        "LINEAR INC TA500 TS0 TM500",
        run_up,
        "TA10 TM200",
        f"X{DEEP} {away}",
        "TM10",
        f"WHILE({loop})",
        *(f"X{way} {step} Z1" for way in (100, -100) * 3),
        "ENDWHILE",
        f"TM200 X-{DEEP} {away}",
        "TA500",
        "CLOSE",
    )


def leased_loop(dialect: Dialect) -> str:
    return f"M26=0 AND {watchdog_condition(dialect)}"


def begin_cut(host: Host, program: Iterable[str], grace_ms: float | None = None) -> None:
    """Start the small cut as a host would, and keep it for a second: the tool is in, the spindle at speed."""
    host.card.tell(*program)
    cut = host.keeper.cut_line(SURFACE) if grace_ms is None else host.keeper.cut_line(SURFACE, grace_ms)
    host.card.tell("&1B5")
    host.beat(cut)
    host.card.tell("R")
    host.keep(1.5)
    assert host.place(TOOL) > DEEP - 500
    assert not host.still()
