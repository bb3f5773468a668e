"""Section 4.2, Figs 11 and 12 and Table 5: the closed loop of Eq 9, and the real one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from profiles.axis.envelope import first_beyond
from profiles.axis.servo import eq9_response, eq9_summary, sampled_response
from profiles.machine import MachineProfile
from profiles.paper import table_5
from profiles.paper.eq9_in_time import step_error
from profiles.paper.record import Basis, Curve, Figure, Record, Relation, Section

PAPER_BANDWIDTH_HZ, PAPER_TOLERANCE_HZ = 80.0, 5.0
COIL_KG = 2.95
"""Table 2: the coil alone, without the slide and the tool that Table 4 has with it."""

_TOP_HZ = 150.0
_LOBE_HZ = 50.0
_SETTLED_S = 0.1


def section(machine: MachineProfile) -> Section:
    """Return the comparison of section 4.2, Fig 11 and Table 5, with Fig 12."""
    return Section(
        name="servo",
        records=(*_fig_11(machine), *_table_5(machine), *_fits(machine)),
        figures=(*_figures_11(machine), *(_figure_12(machine, hz) for hz in table_5.FREQUENCIES_HZ)),
    )


def sampled_bandwidth_hz(machine: MachineProfile) -> float | None:
    """Return the half-power frequency of the sampled loop; None if there is none."""
    nyquist_hz = 0.999 * 500 / machine.controller.servo_period_ms
    return first_beyond(lambda f: 1 / np.abs(sampled_response(machine, f)), math.sqrt(2), nyquist_hz)


def _fig_11(machine: MachineProfile) -> tuple[Record, ...]:
    whole = eq9_summary(machine)
    coil = eq9_summary(replace(machine, tool=replace(machine.tool, moving_mass_kg=COIL_KG)))

    facts = {
        "mass_kg": machine.tool.moving_mass_kg,
        "bandwidth_hz": whole.bandwidth_hz,
        "paper_hz": PAPER_BANDWIDTH_HZ,
    }

    def bandwidth(at: str, hz: float, why: str = "") -> Record:
        return Record(
            name="fig11.bandwidth",
            at=at,
            ours=hz,
            unit="Hz",
            expected=PAPER_BANDWIDTH_HZ,
            tolerance=PAPER_TOLERANCE_HZ,
            why=why,
            facts=facts if why else {},
        )

    return (
        bandwidth("eq9", whole.bandwidth_hz, "bandwidth"),
        bandwidth("coil", coil.bandwidth_hz),
        bandwidth("sampled", sampled_bandwidth_hz(machine) or math.inf),
        Record(
            name="eq9.overshoot", ours=whole.overshoot_percent, unit="%", expected=5.0, relation=Relation.AT_MOST
        ),
        Record(
            name="eq9.steady", ours=_step_error_percent(machine), unit="%", expected=1.0, relation=Relation.AT_MOST
        ),
    )


def _step_error_percent(machine: MachineProfile) -> float:
    """Return the error of a step after 0.1 s."""
    return 100 * abs(step_error(machine, _SETTLED_S))


def _table_5(machine: MachineProfile) -> tuple[Record, ...]:
    """Compare Eq 9 as printed with the rows of the table, in its own units."""
    met = eq9_response(machine, table_5.FREQUENCIES_HZ)
    fit = table_5.fitted_feedforward(machine)
    fitted = table_5.feedforward_response(machine, table_5.FREQUENCIES_HZ, fit.acceleration_share, fit.delay_s)
    lobe = table_5.FREQUENCIES_HZ.index(_LOBE_HZ)
    facts = {
        "lobe_hz": _LOBE_HZ,
        "times": -float(np.angle(met[lobe])) / table_5.PHASE_ERROR_RAD[lobe],
        "gain": table_5.fitted_gain(machine),
        "share_percent": 100 * fit.acceleration_share,
        "delay_ms": 1000 * fit.delay_s,
    }
    return (
        *_rows("eq9", met, why="feedforward", facts=facts),
        *_rows("fitted", fitted, basis=Basis.FITTED),
        _chi_square(fit.chi2),
    )


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
    limit = float(chdtri(freedom, 0.05))
    return Record(
        name="table5.chi2", ours=chi2, expected=limit, relation=Relation.AT_MOST, why="chi_square", facts=facts
    )


def _rows(
    model: str,
    met: np.ndarray,
    why: str = "",
    facts: Mapping[str, float] | None = None,
    basis: Basis = Basis.COMPUTED,
) -> tuple[Record, ...]:
    """Return amplitude and phase errors of a response; tolerances are two standard deviations of a reading."""

    def of(kind: str, at: str, ours: float, unit: str, expected: float, tolerance: float) -> Record:
        return Record(
            name=f"table5.{model}.{kind}",
            at=at,
            ours=ours,
            unit=unit,
            expected=expected,
            tolerance=tolerance,
            why=why,
            facts=facts or {},
            basis=basis,
        )

    phase_tolerance_rad = 2 * table_5.WEIGHT
    amplitude_tolerance_um = phase_tolerance_rad * table_5.COMMAND_UM_PP

    rows = []
    for i, hz in enumerate(table_5.FREQUENCIES_HZ):
        at, loss_um = f"{hz:g} Hz", table_5.COMMAND_UM_PP * (1 - abs(met[i]))
        rows.append(of("amplitude", at, loss_um, "um", table_5.AMPLITUDE_ERROR_UM[i], amplitude_tolerance_um))
        late_rad = -float(np.angle(met[i]))
        rows.append(of("phase", at, late_rad, "rad", table_5.PHASE_ERROR_RAD[i], phase_tolerance_rad))
    return tuple(rows)


def _fits(machine: MachineProfile) -> tuple[Record, ...]:
    fit, (delay_s, _) = table_5.fitted_feedforward(machine), table_5.pure_delay_s()
    cycle_ms = machine.controller.servo_period_ms
    facts = {"cycles": 1000 * delay_s / cycle_ms, "cycle_ms": cycle_ms}
    return (
        Record(name="table5.delay", ours=1000 * delay_s, unit="ms", why="delay", facts=facts),
        Record(name="table5.acceleration", ours=100 * fit.acceleration_share, unit="%"),
        Record(name="table5.fitted_delay", ours=1000 * fit.delay_s, unit="ms"),
        Record(name="table5.misfit", ours=table_5.misfit_of_eq9(machine), unit="rad"),
    )


def _figures_11(machine: MachineProfile) -> tuple[Figure, Figure]:
    hz = np.linspace(0.5, _TOP_HZ, 300)
    loops = {"eq9": eq9_response(machine, hz), "sampled": sampled_response(machine, hz)}
    points = np.array(table_5.FREQUENCIES_HZ)
    gains = [Curve.of(name, hz, np.abs(each)) for name, each in loops.items()]
    phases = [Curve.of(name, hz, np.degrees(np.unwrap(np.angle(each)))) for name, each in loops.items()]
    gains.append(Curve.of("table5", points, table_5.measured_gains()))
    phases.append(Curve.of("table5", points, -np.degrees(table_5.PHASE_ERROR_RAD)))
    return (
        Figure(name="fig11.gain", x_unit="Hz", y_unit="", curves=tuple(gains)),
        Figure(name="fig11.phase", x_unit="Hz", y_unit="deg", curves=tuple(phases)),
    )


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
    curves = (Curve.of(name, 1000 * time_s, counts * np.imag(each * turning)) for name, each in followed.items())
    return Figure(name="fig12", at=f"{frequency_hz:g} Hz", x_unit="ms", y_unit="cts", curves=tuple(curves))
