"""Section 4.2, Figs 11 and 12 and Table 5: the closed loop of Eq 9, and the real one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from profiles.arrays import Complexes
from profiles.axis.envelope import first_beyond, nyquist_hz
from profiles.axis.servo import eq9_response, eq9_summary, sampled_response, step_error
from profiles.compensations.path import residual_um_pp
from profiles.machine import MachineProfile
from profiles.paper import table_5
from profiles.paper.record import Basis, Curve, Figure, Record, Relation, Section

PAPER_BANDWIDTH_HZ, PAPER_TOLERANCE_HZ = 80.0, 5.0
COIL_KG = 2.95  # Table 2: the coil alone, without the slide and the tool that Table 4 has with it
_TOP_HZ = 150.0
_LOBE_HZ = 50.0
_SETTLED_S = 0.1
_ERROR_UM_PP = 55.0  # experiment 1, Fig 14


def section(machine: MachineProfile) -> Section:
    """Return the comparison of section 4.2, Fig 11 and Table 5, with Fig 12."""
    return Section(
        "servo",
        (*_fig_11(machine), *_table_5(machine), *_fits(machine)),
        (*_figures_11(machine), *(_figure_12(machine, hz) for hz in table_5.FREQUENCIES_HZ)),
    )


def _fig_11(machine: MachineProfile) -> tuple[Record, ...]:
    whole = eq9_summary(machine)
    coil = eq9_summary(replace(machine, tool=replace(machine.tool, moving_mass_kg=COIL_KG)))
    half_power_hz = first_beyond(
        lambda f: 1 / np.abs(sampled_response(machine, f)), math.sqrt(2), nyquist_hz(machine)
    )
    facts = {
        "mass_kg": machine.tool.moving_mass_kg,
        "bandwidth_hz": whole.bandwidth_hz,
        "paper_hz": PAPER_BANDWIDTH_HZ,
    }
    bandwidth = partial(
        Record, "fig11.bandwidth", unit="Hz", expected=PAPER_BANDWIDTH_HZ, tolerance=PAPER_TOLERANCE_HZ
    )
    most = partial(Record, unit="%", relation=Relation.AT_MOST)
    always = partial(most, basis=Basis.CONSTRUCTION, why="integrates")
    return (
        bandwidth(whole.bandwidth_hz, at="eq9", why="bandwidth", facts=facts),
        bandwidth(coil.bandwidth_hz, at="coil", basis=Basis.RIVAL),
        bandwidth(half_power_hz or math.inf, at="sampled", basis=Basis.RIVAL),
        most("eq9.overshoot", whole.overshoot_percent, expected=5.0),
        always("eq9.steady", 100 * abs(step_error(machine, _SETTLED_S)), expected=1.0),
    )


def _table_5(machine: MachineProfile) -> tuple[Record, ...]:
    actual = eq9_response(machine, table_5.FREQUENCIES_HZ)
    fit = table_5.fitted_feedforward(machine)
    fitted = table_5.feedforward_response(machine, table_5.FREQUENCIES_HZ, fit.acceleration_fraction, fit.delay_s)
    lobe = table_5.FREQUENCIES_HZ.index(_LOBE_HZ)
    facts = {
        "lobe_hz": _LOBE_HZ,
        "times": -float(np.angle(actual[lobe])) / table_5.PHASE_ERROR_RAD[lobe],
        "gain": table_5.fitted_gain(machine),
        "share_percent": 100 * fit.acceleration_fraction,
        "delay_ms": 1000 * fit.delay_s,
    }
    return (
        *_rows("eq9", actual, why="feedforward", facts=facts),
        *_rows("fitted", fitted, why="circular", facts={"chi2": fit.chi2}, basis=Basis.FITTED),
        _chi_square(fit.chi2),
        *_readings(machine),
    )


def _readings(machine: MachineProfile) -> tuple[Record, ...]:
    """Return what a sine leaves of the 55 um of experiment 1 by two readings, and how well each can be fitted."""
    facts = {each.name.lower(): table_5.fitted_feedforward(machine, each).chi2 for each in table_5.ErrorBasis}
    of = partial(Record, "table5.left", unit="um", why="read", facts=facts, basis=Basis.READING)
    losses = table_5.ErrorBasis.LOSS_PEAK_TO_PEAK, table_5.ErrorBasis.LOSS_OF_AMPLITUDE
    gains = {each.name.lower(): complex(table_5.measured_response(_LOBE_HZ, each)) for each in losses}
    return tuple(of(residual_um_pp(_ERROR_UM_PP, gain), at=name) for name, gain in gains.items())


def _chi_square(chi2: float) -> Record:
    """Return whether the fit itself is acceptable: chance alone exceeds the limit in one of twenty."""
    from scipy.special import chdtrc, chdtri

    freedom = 2 * len(table_5.FREQUENCIES_HZ) - table_5.UNKNOWNS
    facts = {
        "weight_percent": 100 * table_5.WEIGHT,
        "weight_rad": table_5.WEIGHT,
        "freedom": freedom,
        "chance_percent": 100 * float(chdtrc(freedom, chi2)),
    }
    most = partial(Record, expected=float(chdtri(freedom, 0.05)), relation=Relation.AT_MOST)
    return most("table5.chi2", chi2, why="chi_square", facts=facts)


def _rows(
    model: str,
    actual: Complexes,
    why: str = "",
    facts: Mapping[str, float] | None = None,
    basis: Basis = Basis.COMPUTED,
) -> tuple[Record, ...]:
    """Return amplitude and phase errors of a response; tolerances are two standard deviations of a reading."""
    of = partial(Record, why=why, facts=facts or {}, basis=basis)
    phase_rad = 2 * table_5.WEIGHT
    read = Basis.READING if basis is Basis.COMPUTED else basis  # p-p or amplitude is not stated
    near_um = phase_rad * table_5.COMMAND_UM_PP
    amplitude = partial(of, f"table5.{model}.amplitude", unit="um", tolerance=near_um, basis=read)
    phase = partial(of, f"table5.{model}.phase", unit="rad", tolerance=phase_rad)
    rows = []
    for i, hz in enumerate(table_5.FREQUENCIES_HZ):
        loss_um, late_rad = table_5.COMMAND_UM_PP * (1 - abs(actual[i])), -float(np.angle(actual[i]))
        rows.append(amplitude(loss_um, at=f"{hz:g} Hz", expected=table_5.AMPLITUDE_ERROR_UM[i]))
        rows.append(phase(late_rad, at=f"{hz:g} Hz", expected=table_5.PHASE_ERROR_RAD[i]))
    return tuple(rows)


def _fits(machine: MachineProfile) -> tuple[Record, ...]:
    fit, (delay_s, _) = table_5.fitted_feedforward(machine), table_5.pure_delay_s()
    cycle_ms = machine.controller.servo_period_ms
    facts = {"cycles": 1000 * delay_s / cycle_ms, "cycle_ms": cycle_ms}
    return (
        Record("table5.delay", 1000 * delay_s, "ms", why="delay", facts=facts),
        Record("table5.acceleration", 100 * fit.acceleration_fraction, "%"),
        Record("table5.fitted_delay", 1000 * fit.delay_s, "ms"),
        Record("table5.misfit", table_5.misfit_of_eq9(machine), "rad"),
    )


def _figures_11(machine: MachineProfile) -> tuple[Figure, Figure]:
    hz = np.linspace(0.5, _TOP_HZ, 300)
    loops = {"eq9": eq9_response(machine, hz), "sampled": sampled_response(machine, hz)}
    points = np.array(table_5.FREQUENCIES_HZ)
    gains = [Curve(name, hz, np.abs(each)) for name, each in loops.items()]
    phases = [Curve(name, hz, np.degrees(np.unwrap(np.angle(each)))) for name, each in loops.items()]
    gains.append(Curve("table5", points, table_5.measured_gains()))
    phases.append(Curve("table5", points, -np.degrees(table_5.PHASE_ERROR_RAD)))
    return Figure("fig11.gain", "Hz", "", tuple(gains)), Figure("fig11.phase", "Hz", "deg", tuple(phases))


def _figure_12(machine: MachineProfile, frequency_hz: float) -> Figure:
    """Return two lobes of the commanded 50 um and of the response, in counts as in the paper."""
    time_s = np.linspace(0.0, 2 / frequency_hz, 400)
    turning = np.exp(2j * np.pi * frequency_hz * time_s)
    counts = table_5.COMMAND_UM_PP / 2 / machine.tool.count_um
    followed = {
        "command": 1.0,
        "eq9": complex(eq9_response(machine, frequency_hz)),
        "table5": complex(table_5.measured_response(frequency_hz)),
    }
    curves = (Curve(name, 1000 * time_s, counts * np.imag(each * turning)) for name, each in followed.items())
    return Figure("fig12", "ms", "cts", tuple(curves), at=f"{frequency_hz:g} Hz")
