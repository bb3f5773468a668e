"""Sentences about the axis that proposed gains rest on, for the page Tune and `console tune`."""

from __future__ import annotations

from console.session.tuning.proposal import GainFacts
from console.text.catalogue import Catalogue
from profiles.machine import MachineProfile


def axis_lines(machine: MachineProfile, facts: GainFacts, text: Catalogue) -> list[str]:
    """Return what the proposal rests on: the axis behind the responses, or that of the profile."""
    known, fit, friction = facts.known, facts.known.fit, facts.friction_n
    if fit is None or friction is None:
        return [text("tune.axis_profile")]
    plant = known.loop.plant
    mass = f"{machine.tool.loop_gain_n_per_v / plant.acceleration_per_v:.2f}"
    dry, delay = f"{friction[0]:.1f} ± {friction[1]:.1f}", f"{1000.0 * plant.delay_s:.2f}"
    lines = [text("tune.axis", count=fit.hz.size, mass=mass, friction=dry, delay=delay)]
    for mode in plant.modes:
        hz, ratio = f"{mode.hz:.0f}", f"{100.0 * mode.damping_ratio:.1f}"
        lines.append(text("tune.mode", hz=hz, ratio=ratio, fraction=f"{mode.fraction:.2f}"))
    return lines
