"""The dry friction of the tool, as the kept responses of this machine show it."""

from __future__ import annotations

from pathlib import Path

from console.session.tuning.known_loop import known_loop
from profiles.machine import MachineProfile
from profiles.problem import ProfileError


def identified_friction(machine: MachineProfile, data: Path, *, simulated: bool) -> str:
    """Return friction and half-width for 95 % as text, "" where no response tells it from nothing."""
    try:
        fit = known_loop(machine, data, simulated=simulated).fit
    except ProfileError:  # what matters is the trip; the page Tune names the file that cannot be read
        return ""
    thrust = machine.tool.loop_gain_n_per_v
    if fit is None or fit.friction_v <= 1.96 * fit.friction_sd_v:
        return ""
    return f"{thrust * fit.friction_v:.1f} ± {1.96 * thrust * fit.friction_sd_v:.1f} N"
