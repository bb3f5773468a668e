"""The present state of a controller: its own faults, running programs, enabled motors. Nothing is written."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from drivers.commissioning.check import Check, Group, severity
from drivers.commissioning.checked_configuration import CheckedConfiguration
from drivers.controller import Controller, query_in_lines
from drivers.errors import out_of_step
from drivers.pmac.dialect import Dialect, SettingScope
from drivers.pmac.heartbeat.arming import activity_name
from drivers.pmac.reserved import HEARTBEAT_PLC, LOST
from drivers.pmac.status import BitTable, decode
from profiles.findings import Severity

STATUS_A_LINE = 8

CARD_FAULTS = tuple(
    "interrupt_overrun servo_error watchdog checksum_error dpram_error flash_error interrupt_warning "
    "configuration_error phase_clock_missing fixed_buffer_full abort_input".split()
)
MOTOR_FAULTS = tuple(
    "amplifier_fault fatal_following_error integrated_fatal_error i2t_fault phasing_error negative_limit "
    "positive_limit".split()
)

Flags = frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class CardState:
    """The status bits that are set, by name; of systems and motors by number; and what the heartbeat has ended."""

    card: Flags
    systems: dict[int, Flags]
    motors: dict[int, Flags]
    lost: float = 0.0

    @property
    def running(self) -> tuple[int, ...]:
        """The coordinate systems that run a program."""
        return tuple(number for number, flags in self.systems.items() if "running_program" in flags)

    @property
    def enabled_motors(self) -> tuple[int, ...]:
        """The motors whose amplifiers are enabled."""
        return tuple(number for number, flags in self.motors.items() if "amplifier_enabled" in flags)


def read_state(client: Controller, dialect: Dialect) -> CardState:
    """Query the status of the controller, of every system and of every motor; raises LinkError."""
    (card,) = _flags(client, ["???"], dialect.global_bits)
    systems, motors = list(dialect.numbers(SettingScope.SYSTEM)), list(dialect.numbers(SettingScope.MOTOR))
    of_systems = _flags(client, [f"&{number}??" for number in systems], dialect.system_bits)
    of_motors = _flags(client, [f"#{number}?" for number in motors], dialect.motor_bits)
    (lost,) = client.numbers(f"P{LOST}", again=True)
    return CardState(
        card=card,
        lost=lost,
        systems=dict(zip(systems, of_systems, strict=True)),
        motors=dict(zip(motors, of_motors, strict=True)),
    )


def state_checks(state: CardState, judged: CheckedConfiguration) -> list[Check]:
    """Return the checks of this state before anything moves."""
    checks = [
        _check(Group.CARD, "card_faults", (name for name in CARD_FAULTS if name in state.card)),
        _check(Group.PROGRAMS, "running", (f"&{number}" for number in state.running)),
    ]
    if state.lost and HEARTBEAT_PLC in judged.configuration.plcs:
        name, found = f"P{LOST}", activity_name(state.lost)
        checks.append(Check(Group.PROGRAMS, "heartbeat_lost", Severity.REFUSAL, variable=name, found=found))
    for axis in judged.axes:
        flags = state.motors.get(axis.motor, frozenset())
        faults = (name for name in MOTOR_FAULTS if name in flags)
        checks.append(_check(axis.group, "motor_faults", faults, axis.name))
    enabled = [f"#{number}" for number in state.enabled_motors]
    code = "drives_on" if enabled else "drives_off"
    checks.append(Check(Group.STOPS, code, Severity.NOTICE, found=", ".join(enabled)))
    if "gathering" in state.card:
        checks.append(Check(Group.PROGRAMS, "gathering", Severity.WARNING))
    return checks


def _check(group: Group, code: str, names: Iterable[str], subject: str = "") -> Check:
    """Return a check that passes when nothing was found."""
    found = ", ".join(names)
    return Check(group, code, severity(not found), subject, found=found or "-", wanted="-")


def _flags(client: Controller, questions: Sequence[str], table: BitTable) -> list[Flags]:
    found = []
    for digits in query_in_lines(client, questions, STATUS_A_LINE):
        try:
            found.append(decode(digits.strip(), table))
        except ValueError as error:
            raise out_of_step(client.link.address, "?", str(error)) from error
    return found
