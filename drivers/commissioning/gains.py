"""Compare the gains of a profile and a controller, and write the few lines that bring the controller into line.

Gains and axis definitions are all that is ever written: with the drives killed, after a backup, each value read
back, and nothing saved. Limits, kill mode, commutation and addresses are never written.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from drivers.commissioning.card_state import read_state
from drivers.commissioning.check import Check, Group
from drivers.commissioning.checked_configuration import CheckedConfiguration, digits, is_same_number
from drivers.commissioning.reading import number_in
from drivers.commissioning.setting_names import GAIN_NUMBERS
from drivers.controller import Controller
from drivers.errors import DriverError, RefusedError
from drivers.pmac.axes import read_definitions
from drivers.pmac.dialect import Dialect
from drivers.pmac.language.text import format_constant
from profiles.axis.servo_gains import (
    PidGains,
    gains_from_variables,
    meant_gains,
    notch_settings,
    stated_notch,
    stated_settings,
    variables_from_gains,
)
from profiles.axis.stiffness import push_um_per_n
from profiles.findings import Severity
from profiles.machine import MACHINE, MachineProfile
from profiles.problem import Problem, ProfileError

SOFT_UM_PER_N = 3.0
"""Push of the cut from which a commissioned loop is soft: designed gains yield 1.5 to 3 um/N (docs/tuning.md)."""

ROUNDED = 0.01  # relative tolerance between a gain in whole numbers and the one in V/m


@dataclass(frozen=True, slots=True)
class Write:
    """One line to send, the query that reads it back, and its expected answer; `found` is the present value."""

    line: str
    question: str
    wanted: str
    found: str


def gain_checks(judged: CheckedConfiguration) -> list[Check]:
    """Check that the profile's gains of the tool agree with each other, and what the controller's mean."""
    stated = stated_settings(judged.machine)
    meant: dict[str, float] = {**variables_from_gains(judged.machine, meant_gains(judged.machine))}
    differing = [name for name, value in meant.items() if name in stated and not _is_near(stated[name], value)]
    filters = notch_settings(judged.machine, stated_notch(judged.machine))
    differing += [name for name, value in filters.items() if not is_same_number(stated[name], value)]
    meant |= filters
    checks = _soft_loop(judged.machine)
    for name in differing:
        found, wanted = format_constant(stated[name]), format_constant(meant[name])
        checks.append(
            Check(Group.TOOL, "profile_gains", Severity.REFUSAL, "tool", variable=name, found=found, wanted=wanted)
        )
    running = _gains_found(judged)
    return checks if running is None else [*checks, _meaning(running.at_rest)]


def gain_writes(judged: CheckedConfiguration) -> tuple[Write, ...]:
    """Return the lines that set gains and axis definitions as in the profile; none where they agree.

    Raises RefusedError: `controller.profile_gains`, the profile contradicts itself and cannot be trusted.
    """
    contradictions = [
        Problem(code="controller.profile_gains", key=check.variable, value=check.found, limit=check.wanted)
        for check in gain_checks(judged)
        if check.code == "profile_gains"
    ]
    if contradictions:
        raise RefusedError(*contradictions)
    return (*_gain_lines(judged), *_axis_lines(judged))


def _gain_lines(judged: CheckedConfiguration) -> Iterator[Write]:
    """Set what the profile states."""
    for axis in judged.driven_axes:
        for number in GAIN_NUMBERS:
            index = judged.dialect.motor_index(axis.motor, number)
            wanted, found = judged.stated_settings.get(index), judged.value(index)
            if wanted is not None and found is not None and not is_same_number(wanted, found):
                text, question = format_constant(wanted), f"I{index}"
                yield Write(f"{question}={text}", question, text, format_constant(found))


def _axis_lines(judged: CheckedConfiguration) -> Iterator[Write]:
    """Define the axes of the profile. Definitions that the profile does not have are left alone."""
    for definition in read_definitions(judged.machine.controller.axis_definitions):
        entry, wanted = judged.configuration.axes.get(definition.motor), str(definition)
        found = "0" if entry is None else entry.text
        if entry is not None and entry.system != 1:
            continue  # its coordinate system would have to release it first: shown, not written
        if found != wanted:
            question = f"#{definition.motor}->"
            yield Write(f"&1{question}{wanted}", question, wanted, found)


def _gains_found(judged: CheckedConfiguration) -> PidGains | None:
    machine, settings = judged.machine, judged.configuration.settings
    indices = (100 * machine.tool.motor + number for number in (8, 9, *GAIN_NUMBERS))
    variables = {f"I{index}": settings[index] for index in indices if index in settings}
    try:
        return gains_from_variables(replace(machine, controller=replace(machine.controller, variables=variables)))
    except ProfileError:
        return None


def _meaning(gains: PidGains) -> Check:
    facts = {
        "kp": f"{digits(gains.kp_v_per_m)} V/m",
        "ki": f"{digits(gains.ki_v_per_m_s)} V/(m s)",
        "kd": f"{digits(gains.kd_v_s_per_m)} V s/m",
        "velocity": f"{digits(gains.velocity_feedforward_v_s_per_m)} V s/m",
    }
    return Check(Group.TOOL, "gains_mean", Severity.NOTICE, subject="tool", facts=facts)


def _soft_loop(machine: MachineProfile) -> list[Check]:
    """Return a warning where a machine that is signed for cuts with a loop as soft as the published one."""
    yields = push_um_per_n(machine)
    if machine.safety.signed_for != MACHINE or yields <= SOFT_UM_PER_N:
        return []
    found, wanted = f"{yields:.1f} um/N", f"<= {SOFT_UM_PER_N:g} um/N"
    return [Check(Group.TOOL, "soft_loop", Severity.WARNING, "tool", found=found, wanted=wanted)]


def _is_near(first: float, second: float) -> bool:
    return abs(first - second) <= max(1.0, ROUNDED * abs(second))


def refuse_unready(client: Controller, dialect: Dialect) -> None:
    """Make sure that no motor of the controller is enabled and no program runs.

    Raises RefusedError: `controller.drives_on`, `controller.program_running`; LinkError: the link broke.
    """
    state = read_state(client, dialect)
    motors = ", ".join(f"#{number}" for number in state.enabled_motors)
    systems = ", ".join(f"&{number}" for number in state.running)
    if motors or systems:
        code = "controller.drives_on" if motors else "controller.program_running"
        raise RefusedError(Problem(code=code, where=client.link.address, value=motors or systems))


def apply(client: Controller, dialect: Dialect, writes: Sequence[Write]) -> int:
    """Send each line once and read its value back; return how many lines there were. Nothing is saved.

    The caller must have a backup.

    Raises:
        RefusedError: `controller.drives_on`, `controller.program_running`; nothing was sent.
        DriverError: `controller.not_taken`, a value differs from the one that was sent: nothing was sent after it.
        LinkError: the link broke; check what its last line did.
    """
    refuse_unready(client, dialect)
    for write in writes:
        client.request(write.line)
        (found,) = client.query(write.question, again=True)
        if not _is(found, write.wanted, client.link.address):
            value = found.strip()
            raise DriverError(
                Problem(code="controller.not_taken", key=write.line, value=value, limit=write.wanted)
            )
    return len(writes)


def _is(found: str, wanted: str, where: str) -> bool:
    if found.strip() == wanted:
        return True
    try:
        number = float(wanted)
    except ValueError:
        return False
    return is_same_number(number_in(found, where), number)
