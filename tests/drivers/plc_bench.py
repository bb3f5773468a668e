"""PLCs by themselves, in a card that is let run for whole background cycles, and with the PLC of the heartbeat."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.heartbeat.plc import Policy, set_up_lines
from drivers.pmac.heartbeat.watch import Keeper
from drivers.pmac.heartbeat.watchdog import watchdog_condition
from drivers.pmac.language.plc_statements import PlcCode, link_plc, parse_plc_line, stored_lines
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.plcs.plc import PlcFault, PlcRun
from drivers.pmac.requests import ADDRESS_OF_PROGRAMS, DefaultAddress
from drivers.pmac.settings import settings_with
from drivers.pmac.variables import VariableStore
from profiles.machine import MachineProfile
from tests.drivers.wire_card import Wire, wire


def code_of(text: str) -> PlcCode:
    return link_plc(tuple(line for typed in text.split("\n") for line in stored_lines(parse_plc_line(typed))))


class PlcListener:
    """A host that writes down what it is told."""

    def __init__(self) -> None:
        self.heard: list[tuple[object, ...]] = []

    def command(self, text: str, port: str, addressed: DefaultAddress = ADDRESS_OF_PROGRAMS) -> None:
        self.heard.append(("command", text, port, addressed.motor, addressed.system))

    def send(self, text: str, port: str) -> None:
        self.heard.append(("send", text, port))

    def display(self, text: str) -> None:
        self.heard.append(("display", text))

    def switch_plc(self, enable: bool, numbers: tuple[int, ...], keeping: bool = False) -> None:
        self.heard.append(("enable" if enable else "disable", *numbers))


class PlcBench:
    """One PLC with the variables of a card."""

    def __init__(self, text: str, dialect: Dialect = PMAC, **variables: float) -> None:
        self.store = VariableStore(settings_with({}, dialect), dialect)
        self.host = PlcListener()
        for name, value in variables.items():
            self.set(name, value)
        self.run = PlcRun(code_of(text), self.store, self.host)

    def set(self, name: str, value: float, system: int = 1) -> None:
        self.store.set(VariableKind(name[0]), int(name[1:]), value, system)

    def value(self, name: str, system: int = 1) -> float:
        return self.store.get(VariableKind(name[0]), int(name[1:]), system)

    def scan(self) -> PlcFault | None:
        return self.run.scan()

    def said(self) -> list[tuple[object, ...]]:
        """What the host has heard since the last look."""
        heard, self.host.heard = self.host.heard, []
        return heard


# A card on the wire with PLCs in it, let run for whole background cycles.

BLOCK = 11
"""Servo cycles of a background cycle of the bundled machine."""

SMALL = 1e-6
"""Of a servo cycle, so that a background cycle is never missed by a rounding."""


def plc_card(machine: MachineProfile, dialect: Dialect, i5: int = 2) -> Wire:
    card = wire(machine, dialect)
    card.tell(f"I5={i5}")
    return card


def run_for(card: Wire, background_cycles: int = 1) -> None:
    """Let background cycles pass; what a host has sent before is executed at the end of the first."""
    before = card.card.cycles
    for _ in range(background_cycles):
        card.sim.wait((BLOCK + SMALL) * card.card.servo_period_ms / 1000.0)
    assert card.card.cycles - before == BLOCK * background_cycles


def store(card: Wire, number: int, text: str, *, on: bool = True) -> None:
    """Type a PLC, and switch it on."""
    lines = [line.strip() for line in text.strip().splitlines()]
    card.tell(f"OPEN PLC {number} CLEAR", *lines, "CLOSE")
    if on:
        card.tell(f"ENABLE PLC {number}")


def values(card: Wire, names: str) -> list[float]:
    return [float(said) for said in card.ask(names)]


def reset(card: Wire, word: str = "$$$") -> None:
    """Reset the card, whose handshake is then another one, and set it to ours."""
    card.raw(f"{word}\r")
    card.raw("\x18I3=2 I4=0 I6=1\r")


# A card with the heartbeat on it, a host that may fall silent, and a small cut that looks at the lease.

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
