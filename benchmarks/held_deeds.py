"""What another host changes for a while, in `hostile_host`: all that shapes a cut and that a console compares.

The list is made from what the comparison at arming reads: every setting of the controller, of coordinate system 1
and of the three motors, the words of the conversion table, the axis definitions; and from what a program rests
on: its constants, its M definitions, the registers that add to a position, the override, the PLC that guards it.
Each value becomes half of it, a fifth less, 2 or 25 % more, one more, or twice as much, and is put back later.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import combinations
from random import Random

from drivers.commissioning.checked_configuration import stated_settings_of
from drivers.commissioning.setting_names import GAIN_NUMBERS
from drivers.commissioning.verification import read_of_machine
from drivers.cutting.planning import CutPlan
from drivers.link.memory import MemoryLink
from drivers.pmac.axes import read_definitions
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS, Dialect
from drivers.pmac.program_constants import constants_of
from drivers.pmac.reserved import HEARTBEAT_PLC
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

FACTORS = (0.5, 0.8, 1.02, 1.25, 2.0)
PAIR_FACTORS = (0.5, 0.9, 1.25, 2.0)  # of one value, while the other is divided by it
SCALE_NUMBERS = (8, 9)
ADDING_REGISTERS = ("compensation", "bias")
ADDED_COUNTS = (5, 25, 100)
PARTS_PER_SCALE = 32  # of a count in a position register, for each of Ix08
OVERRIDES_PERCENT = (50.0, 98.0, 101.0, 200.0)
POINTER = "M900"  # an M-variable that no program of the console has
DRIFT_STEPS = 20
WORDS = 4  # of the conversion table that are changed


SHAPING, STATED, OTHER = 20, 3, 1
"""How often a change is drawn: of what makes the path, of what a profile or a program states, of the rest."""


class Length(StrEnum):
    """How long a value is another one."""

    MOMENT = "0.1 to 0.4 s"
    PART = "part of the feed"
    WHOLE = "whole feed"
    DRIFT = "slow drift"
    PAIR = "pair, whole feed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One value as it is `there`, and the `other` that it becomes; where the `form` adds, that is the difference.

    What is no number has its lines as `texts`: changed, and put back. The `weight` is how often it is drawn.
    """

    name: str
    form: str = ""
    there: float = 0.0
    other: float = 0.0
    adds: bool = False
    texts: tuple[str, str] | None = None
    weight: int = STATED

    def line(self, before: float, share: float) -> str:
        """Return what sets a share of the change where the share `before` is in force; 0 puts the value back."""
        if self.texts is not None:
            return self.texts[0 if share else 1]
        value = (share - before) * self.other if self.adds else self.there + share * (self.other - self.there)
        whole = self.there % 1.0 == 0.0 and self.other % 1.0 == 0.0
        return self.form.format(round(value) if whole else f"{value:.9g}")

    @property
    def told(self) -> str:
        """How it is named in a table."""
        if self.texts is not None:
            return self.name
        return (
            f"{self.name} {self.there:.6g} -> {self.other:.6g}"
            if not self.adds
            else f"{self.name} +{self.other:g}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Changes:
    """All changes of one cut, and the pairs that compensate each other."""

    single: tuple[Change, ...]
    pairs: tuple[tuple[Change, ...], ...]

    def deck(self, length: Length, chance: Random) -> list[tuple[Change, ...]]:
        """Return what can be made so long, shuffled, each as often as it weighs."""
        cards = [each for each in self.single for _ in range(each.weight)]
        if length is Length.PAIR:
            made = [each for each in self.pairs for _ in range(each[0].weight)]
            made += [tuple(chance.sample(cards, 2)) for _ in range(len(made) // 2)]
        else:
            made = [(each,) for each in cards if length is not Length.DRIFT or not each.texts]
        return chance.sample(made, len(made))


def changes_of(machine: MachineProfile, plan: CutPlan) -> Changes:
    """Return the changes of a cut on the simulated controller of a machine."""
    dialect = DIALECTS[machine.controller.family]
    settings, words = _settings_and_words(machine, dialect)
    axes = tuple(_definitions(plan))
    constants = tuple(_constants(plan, dialect))
    registers = tuple(_registers(machine, dialect))
    override = (Change(name="&1%", form="&1%{}", there=100.0, other=each) for each in OVERRIDES_PERCENT)
    guard = Change(name="PLC", texts=(f"DISABLE PLC {HEARTBEAT_PLC}", f"ENABLE PLC {HEARTBEAT_PLC}"))
    single = (*settings, *words, *axes, *constants, *registers, *_pointers(plan), *override, guard)
    return Changes(single=single, pairs=tuple(_pairs(machine, dialect, settings, axes, constants, registers)))


def _changed(name: str, form: str, there: float, weight: int = STATED) -> Iterator[Change]:
    """Yield the changes of one number, each value once."""
    whole = there % 1.0 == 0.0
    scaled = [there * each for each in FACTORS if there]
    others = {round(each) if whole else each for each in scaled} | {there + 1.0}
    for other in sorted(others - {there}):
        yield Change(name=name, form=form, there=there, other=float(other), weight=weight)


def _settings_and_words(
    machine: MachineProfile, dialect: Dialect
) -> tuple[tuple[Change, ...], tuple[Change, ...]]:
    sim = SimulatedLathe(machine)
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    found = read_of_machine(client, machine, dialect)
    stated = stated_settings_of(machine, dialect)
    tool = {dialect.motor_index(machine.tool.motor, number) for number in (*SCALE_NUMBERS, *GAIN_NUMBERS)}
    weights = {
        **dict.fromkeys(found.standing, OTHER),
        **dict.fromkeys(stated, STATED),
        **dict.fromkeys(
            (*(tool & stated.keys()), 10, *(dialect.system_index(1, each) for each in (93, 94))), SHAPING
        ),
    }
    settings = [
        each
        for index, value in found.standing.items()
        for each in _changed(f"I{index}", f"I{index}={{}}", value, weights[index])
    ]
    first = dialect.conversion_table.first_address
    words = [
        Change(name=f"Y:${first + line:X} ${other:X}", texts=(f"WY:${first + line:X},${other:X}", back))
        for line, word in enumerate(found.conversion[:WORDS])
        for back in (f"WY:${first + line:X},${word:X}",)
        for other in (word + 4, word + 0x80000, word + 1)
    ]
    return tuple(settings), tuple(words)


def _definitions(plan: CutPlan) -> Iterator[Change]:
    """Yield another scale and another zero of each axis that the program moves."""
    for each in read_definitions(plan.axis_definitions):
        form, (axis, scale) = f"&1#{each.motor}->{{}}", each.terms[0]
        for factor in (*FACTORS, 1.001):
            other = float(f"{scale * factor:.9g}")
            yield Change(name=f"#{each.motor}->", form=f"{form}{axis}", there=scale, other=other)
        for counts in ADDED_COUNTS:
            yield Change(name=f"#{each.motor}->{axis}+", form=f"&1#{each.motor}->{each}+{{}}", other=float(counts))


def _constants(plan: CutPlan, dialect: Dialect) -> Iterator[Change]:
    for each in constants_of(plan.program, dialect):
        if each.value is not None and each.name.startswith("P"):
            yield from _changed(each.name, f"{each.name}={{}}", each.value)


def _pointers(plan: CutPlan) -> Iterator[Change]:
    for command in plan.program.commands:
        name, defines, _ = command.partition("->")
        if defines and name.startswith("M"):
            yield Change(name=f"{name}->*", texts=(f"{name}->*", command))


def _registers(machine: MachineProfile, dialect: Dialect) -> Iterator[Change]:
    """Yield additions to the registers that add to the position of a motor, in whole counts."""
    for motor in machine.motors:
        parts = PARTS_PER_SCALE * machine.controller.variables[f"I{motor}08"]
        for name in ADDING_REGISTERS:
            register = dialect.registers[name]
            address = register.address + register.stride * (motor - 1)
            form = f"{POINTER}->{register.space}:${address:X}\r{POINTER}={POINTER}+({{}})"
            for counts in ADDED_COUNTS:
                yield Change(
                    name=f"#{motor} {name}", form=form, other=counts * parts, adds=True, weight=SHAPING // 2
                )


def _pairs(
    machine: MachineProfile,
    dialect: Dialect,
    settings: tuple[Change, ...],
    axes: tuple[Change, ...],
    constants: tuple[Change, ...],
    registers: tuple[Change, ...],
) -> Iterator[tuple[Change, ...]]:
    """Yield pairs of gains and scale of a motor, of axes, of registers, of constants: one up, the other down."""
    for motor in machine.motors:
        names = {f"I{dialect.motor_index(motor, number)}" for number in (*SCALE_NUMBERS, *GAIN_NUMBERS)}
        gains = {each.name: each for each in settings if each.name in names and each.there}
        yield from _opposed(tuple(gains.values()))
    scales = [each for each in axes if each.there]
    yield from _opposed(tuple({each.name: each for each in scales}.values()))
    yield from _opposed(tuple({each.name: each for each in constants if each.there}.values()))
    for first, second in combinations(registers, 2):
        if abs(first.other) == abs(second.other):
            yield first, replace(second, other=-second.other)


def _opposed(changes: tuple[Change, ...]) -> Iterator[tuple[Change, ...]]:
    for first, second in combinations(changes, 2):
        for factor in PAIR_FACTORS:
            yield (
                replace(first, other=float(f"{first.there * factor:.9g}")),
                replace(second, other=float(f"{second.there / factor:.9g}")),
            )
