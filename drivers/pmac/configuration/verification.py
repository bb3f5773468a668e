"""Everything that is verified before the first motion, in one go. Nothing is written and nothing moves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from drivers.pmac.client import PmacClient
from drivers.pmac.configuration.card_state import CardState, read_state, state_checks
from drivers.pmac.configuration.check import Check, Group, Outcome
from drivers.pmac.configuration.comparison import stated_settings
from drivers.pmac.configuration.configuration import Configuration
from drivers.pmac.configuration.gains import gain_checks
from drivers.pmac.configuration.judged import Judged
from drivers.pmac.configuration.reading import of_motors, read_configuration
from drivers.pmac.configuration.rules_of_card import card_rules
from drivers.pmac.configuration.rules_of_motors import motor_rules
from drivers.pmac.configuration.safety_checks import safety_checks
from drivers.pmac.configuration.stops import overruns
from drivers.pmac.dialect import Dialect
from drivers.pmac.reserved import HOLD_FLAG, LEASE_TIMER
from profiles.machine import MachineProfile


@dataclass(frozen=True, kw_only=True)
class Verification:
    """What was found, and the checks of it, in the order in which they are told."""

    judged: Judged
    state: CardState
    checks: tuple[Check, ...]


def verify(client: PmacClient, machine: MachineProfile, dialect: Dialect) -> Verification:
    """Read what concerns the machine, and judge it.

    Raises:
        RefusedError: `controller.entering`.
        DriverError: the link broke, or the card answers something that is not asked for.
    """
    configuration = read_of_machine(client, machine, dialect)
    judged = Judged(configuration=configuration, machine=machine)
    state = read_state(client, dialect)
    checks = [*checks_of(judged), *state_checks(state, judged), *safety_checks(client, machine.safety)]
    return Verification(judged=judged, state=state, checks=in_order(checks))


def read_of_machine(client: PmacClient, machine: MachineProfile, dialect: Dialect) -> Configuration:
    """Read what concerns a machine, for its checks.

    Raises:
        RefusedError: `controller.entering`.
        DriverError: the link broke, or the card answers something that is not asked for.
    """
    motors = (machine.tool.motor, machine.spindle.motor, machine.carriage.motor)
    return read_configuration(client, dialect, of_motors(dialect, motors, (HOLD_FLAG, LEASE_TIMER)))


def checks_of(judged: Judged) -> list[Check]:
    """Return every check of a configuration alone: of one that was read, or of a backup."""
    rules = [*card_rules(judged), *motor_rules(judged)]
    return [
        *_once(stated_settings(judged), rules),
        *gain_checks(judged),
        *overruns(judged),
    ]


def _once(stated: list[Check], rules: list[Check]) -> list[Check]:
    """Return all of them, a setting that a rule finds wrong, too, once: in the words of the rule."""
    wrong = {check.variable: check for check in stated if check.outcome is Outcome.FAILS}
    told = [check for check in rules if _speaks_for(check) and check.variable in wrong]
    names = {check.variable for check in told}
    return [
        *(check for check in stated if check.variable not in names),
        *(check for check in rules if check not in told),
        *(replace(check, outcome=Outcome.FAILS, wanted=wrong[check.variable].wanted) for check in told),
    ]


def _speaks_for(check: Check) -> bool:
    """Whether the sentence of a rule says all that is to be said of its setting."""
    return bool(check.wanted) and check.outcome in (Outcome.FAILS, Outcome.WARNED)


def in_order(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return checks by their groups; within a group they stay as they are."""
    groups = list(Group)
    return tuple(sorted(checks, key=lambda check: groups.index(check.group)))
