"""Gains as the whole numbers that the controller takes, with their margins before and after. Numpy alone.

One factor g multiplies every frequency of the controller: Kd by g, Kp by g^2, Ki by g^3, with the velocity
feedforward equal to Kd. `profiles.axis.loop_design` finds gains of another shape.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from profiles.axis.margins import LoopMargins, loop_margins
from profiles.axis.sampled_loop import AxisPlant, SampledLoop
from profiles.axis.servo_gains import (
    PidGains,
    gains_from_variables,
    notch_settings,
    present_settings,
    shown_names,
    variables_from_gains,
    with_variables,
)
from profiles.machine import MachineProfile

MOST_SETTINGS = {30: 32_767, 31: 32_767, 32: 32_767, 33: 8_388_607}
"""The largest value of Ix30 to Ix33 that is written; 2^23 of Ix33 are a gain of 1 in a servo period."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GainProposal:
    """Proposed gains, as rounded to the whole numbers that the controller takes, and margins before and after.

    Both margins are those of the same plant. `factor` is that of Kd, None where the present gains have none, as
    with Ix30 = 0. `settings` are Ix30 to Ix33 and the notch filter Ix36 to Ix39 by name, `present` those of the
    machine.
    """

    factor: float | None
    gains: PidGains
    settings: dict[str, float]
    present: dict[str, float]
    plant: AxisPlant
    before: LoopMargins
    after: LoopMargins

    @property
    def changes(self) -> tuple[tuple[str, float, float], ...]:
        """Names with present and proposed value; without the filter where neither has one."""
        shown = shown_names(self.settings, self.present)
        return tuple((name, self.present[name], self.settings[name]) for name in shown)


def scaled_gains(
    machine: MachineProfile, loop: SampledLoop, factor: float, before: LoopMargins
) -> GainProposal | None:
    """Return the gains of one factor, whatever their margins; None where they do not fit the variables."""
    gains = loop.gains
    kd = factor * gains.kd_v_s_per_m
    asked = PidGains(
        kp_v_per_m=factor**2 * gains.kp_v_per_m,
        ki_v_per_m_s=factor**3 * gains.ki_v_per_m_s,
        kd_v_s_per_m=kd,
        velocity_feedforward_v_s_per_m=kd,
        notch=gains.notch,
    )
    return rounded_proposal(machine, loop, asked, before)


def rounded_proposal(
    machine: MachineProfile, loop: SampledLoop, asked: PidGains, before: LoopMargins
) -> GainProposal | None:
    """Return gains as the whole numbers that the controller takes; None where they do not fit the variables."""
    motor = machine.tool.motor
    settings: dict[str, float] = {**variables_from_gains(machine, asked), **notch_settings(machine, asked.notch)}
    if any(settings[f"I{motor}{number}"] > most for number, most in MOST_SETTINGS.items()):
        return None
    rounded = gains_from_variables(with_variables(machine, settings))
    shown = {name: value for name, value in settings.items() if not name.endswith(("34", "35"))}
    after = loop_margins(replace(loop, gains=rounded))
    kd, present_kd = rounded.at_rest.kd_v_s_per_m, loop.gains.at_rest.kd_v_s_per_m
    return GainProposal(
        factor=kd / present_kd if present_kd else None,
        gains=rounded,
        settings=shown,
        present=present_settings(machine, shown),
        plant=loop.plant,
        before=before,
        after=after,
    )
