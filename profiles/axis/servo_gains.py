"""The meaning of the tool motor's settings: its gains in V/m and as whole numbers; its limits.

No other module of `profiles` reads a controller's numbers; all motors are in `drivers.pmac.motor_settings`.

The controller's output in DAC bits, with following error FE, actual velocity AV, commanded velocity CV and
acceleration CA in counts per servo cycle, and the sum IE of the following error (PMAC PID filter):

DAC = 2^-19 Ix30 { Ix08 [ FE + (Ix32 CV + Ix35 CA)/128 + Ix33 IE/2^23 ] - Ix31 Ix09 AV/128 }

32768 bits are the full scale of the output. The notch filter (Ix36 to Ix39, `profiles.axis.notch`) follows it: it
changes the gain at rest, so that the gains of a profile in V/m, which are those at rest, are Ix30 times that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from profiles.axis.notch import NO_NOTCH, Notch
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

NOTCH_NUMBERS = (36, 37, 38, 39)
"""Ix36 to Ix39, the coefficients of the notch filter; what a profile does not state is 0."""

_FILTER = tuple(str(number) for number in NOTCH_NUMBERS)
_NEEDED_SUFFIXES = ("08", "09", "30", "31", "32", "33")


@dataclass(frozen=True, slots=True, kw_only=True)
class PidGains:
    """Gains of the position loop. The derivative acts on the actual velocity.

    A velocity feedforward equal to `kd_v_s_per_m` puts the derivative on the error, as in Eq 9. The `notch`
    filters the sum of all; the gains are those before it.
    """

    kp_v_per_m: float
    ki_v_per_m_s: float
    kd_v_s_per_m: float
    velocity_feedforward_v_s_per_m: float
    acceleration_feedforward_v_s2_per_m: float = 0.0
    notch: Notch = NO_NOTCH

    def scale_gains(self, factor: float) -> PidGains:
        """Return every gain times a factor, with the same filter."""
        return replace(
            self,
            kp_v_per_m=factor * self.kp_v_per_m,
            ki_v_per_m_s=factor * self.ki_v_per_m_s,
            kd_v_s_per_m=factor * self.kd_v_s_per_m,
            velocity_feedforward_v_s_per_m=factor * self.velocity_feedforward_v_s_per_m,
            acceleration_feedforward_v_s2_per_m=factor * self.acceleration_feedforward_v_s2_per_m,
        )

    @property
    def at_rest(self) -> PidGains:
        """The gains behind the filter, as a slow motion meets them and as a profile states them."""
        return self.scale_gains(self.notch.at_rest) if self.notch else self


def eq9_gains(machine: MachineProfile) -> PidGains:
    """Return the gains of section 4.2, with the derivative on the error; those at rest, without a filter."""
    tool = machine.tool
    return PidGains(
        kp_v_per_m=tool.gain_kp_v_per_m,
        ki_v_per_m_s=tool.gain_ki_v_per_m_s,
        kd_v_s_per_m=tool.gain_kd_v_s_per_m,
        velocity_feedforward_v_s_per_m=tool.gain_kd_v_s_per_m,
    )


def stated_notch(machine: MachineProfile) -> Notch:
    """Return the notch filter that the keys of the tool state."""
    tool = machine.tool
    return Notch(n1=tool.notch_n1, n2=tool.notch_n2, d1=tool.notch_d1, d2=tool.notch_d2)


def meant_gains(machine: MachineProfile) -> PidGains:
    """Return the gains before the filter, and the filter, that the keys of the tool state."""
    gains, notch = eq9_gains(machine), stated_notch(machine)
    return replace(gains.scale_gains(1.0 / notch.at_rest), notch=notch) if notch.steady and notch else gains


def is_filter(name: str) -> bool:
    """Whether a name such as I136 is that of a coefficient of the notch filter."""
    return name.endswith(_FILTER)


def shown_names(*settings: Mapping[str, float]) -> list[str]:
    """Return the names of gains as they are shown: without those of a notch filter where none of these has one."""
    filtered = any(value for each in settings for name, value in each.items() if is_filter(name))
    return [name for name in settings[0] if filtered or not is_filter(name)]


def notch_from_variables(machine: MachineProfile) -> Notch:
    """Return the notch filter by the controller's variables."""
    motor, variables = machine.tool.motor, machine.controller.variables
    n1, n2, d1, d2 = (variables.get(f"I{motor}{number}", 0.0) for number in NOTCH_NUMBERS)
    return Notch(n1=n1, n2=n2, d1=d1, d2=d2)


def notch_settings(machine: MachineProfile, notch: Notch) -> dict[str, float]:
    """Return Ix36 to Ix39 of the tool motor for a filter."""
    names = (f"I{machine.tool.motor}{number}" for number in NOTCH_NUMBERS)
    return dict(zip(names, notch.coefficients, strict=True))


def gains_from_variables(machine: MachineProfile) -> PidGains:
    """Return the gains that the controller's variables produce.

    With Ix34 = 1 the integrator stands still in every move, so its gain is 0 here. Raises `ProfileError`
    (`key.missing`) where the profile lacks a gain of the tool motor.
    """
    motor, variables = machine.tool.motor, machine.controller.variables
    missing = [f"I{motor}{suffix}" for suffix in _NEEDED_SUFFIXES if f"I{motor}{suffix}" not in variables]
    if missing:
        raise ProfileError(*(Problem(code="key.missing", key=f"controller.variables.{n}") for n in missing))
    ix08, ix09, ix30, ix31, ix32, ix33 = (variables[f"I{motor}{suffix}"] for suffix in _NEEDED_SUFFIXES)
    period_s = machine.controller.servo_period_ms / 1000
    unit = ix30 * _volts_per_metre(machine) / 2**19
    integrates = variables.get(f"I{motor}34", 0) == 0
    return PidGains(
        kp_v_per_m=unit * ix08,
        ki_v_per_m_s=unit * ix08 * ix33 / 2**23 / period_s if integrates else 0.0,
        kd_v_s_per_m=unit * ix09 * ix31 / 128 * period_s,
        velocity_feedforward_v_s_per_m=unit * ix08 * ix32 / 128 * period_s,
        acceleration_feedforward_v_s2_per_m=unit * ix08 * variables.get(f"I{motor}35", 0) / 128 * period_s**2,
        notch=notch_from_variables(machine),
    )


def variables_from_gains(machine: MachineProfile, gains: PidGains) -> dict[str, int]:
    """Return Ix30 to Ix35 of the tool motor for these gains, rounded to the whole numbers it takes.

    Ix08 and Ix09 stay those of the profile. The other gains are relative to Ix30, so they are computed with
    the rounded one.
    """
    motor, variables = machine.tool.motor, machine.controller.variables
    ix08, ix09 = variables[f"I{motor}08"], variables[f"I{motor}09"]
    period_s = machine.controller.servo_period_ms / 1000
    volts_per_metre = _volts_per_metre(machine)
    ix30 = max(1, round(gains.kp_v_per_m * 2**19 / (ix08 * volts_per_metre)))
    unit = ix30 * volts_per_metre / 2**19
    acceleration = gains.acceleration_feedforward_v_s2_per_m
    return {
        f"I{motor}30": ix30,
        f"I{motor}31": round(gains.kd_v_s_per_m * 128 / (unit * ix09 * period_s)),
        f"I{motor}32": round(gains.velocity_feedforward_v_s_per_m * 128 / (unit * ix08 * period_s)),
        f"I{motor}33": round(gains.ki_v_per_m_s * 2**23 * period_s / (unit * ix08)),
        f"I{motor}34": 0,
        f"I{motor}35": round(acceleration * 128 / (unit * ix08 * period_s**2)),
    }


def complete_settings(machine: MachineProfile, settings: Mapping[str, float]) -> dict[str, float]:
    """Return settings with a notch filter of the tool: one that they do not name is none.

    So what was kept of a loop before there was a filter is not taken for one with the present filter.
    """
    return {**notch_settings(machine, NO_NOTCH), **settings}


def stated_settings(machine: MachineProfile) -> dict[str, float]:
    """Return the variables of a machine, with a notch filter of the tool."""
    return complete_settings(machine, machine.controller.variables)


def with_variables(machine: MachineProfile, settings: Mapping[str, float]) -> MachineProfile:
    """Return a machine with these variables in the place of its own."""
    variables = {**machine.controller.variables, **settings}
    return replace(machine, controller=replace(machine.controller, variables=variables))


def present_settings(machine: MachineProfile, names: Iterable[str]) -> dict[str, float]:
    """Return variables of a machine by these names."""
    stated = stated_settings(machine)
    return {name: stated[name] for name in names}


def program_speed_mm_per_s(machine: MachineProfile) -> float:
    """Return the highest speed of the tool in a program, Ix16 in counts/ms."""
    return machine.controller.variables[f"I{machine.tool.motor}16"] / machine.tool.counts_per_mm * 1000


def error_limit_um(machine: MachineProfile) -> float:
    """Return the following error at which the controller disables the tool, Ix11 in sixteenths of a count."""
    return machine.controller.variables[f"I{machine.tool.motor}11"] / 16 * machine.tool.count_um


def _volts_per_metre(machine: MachineProfile) -> float:
    """Return the output voltage of one DAC bit per count, per metre of error."""
    return machine.tool.v_per_bit * machine.tool.counts_per_mm * 1000
