"""What a notch filter would gain on a tool that bends: the stiffest loop with and without one, by calculation.

The tool of the profile with a mode of 40 % of its motion and 2 % of damping. Gains, and the zeros and poles of a
filter (1 + n1/z + n2/z^2) / (1 + d1/z + d2/z^2) with a gain of 1 at rest, are searched on a grid for the loop
that yields least to the forces of a lobed cut, by the rule of `profiles.axis.loop_design`, of those with a gain
margin of 2.5, a phase margin of 45 deg and an Ms of at most 1.8; and of 2 with the mode at up to so many per cent
less or more, with its damping or half of that. Each loop that is shown is proven stable by the poles that
python-control finds, on every one of these plants. Nothing of it is written to a controller.

    python -m benchmarks.notch [--hz 200 300 400] [--off 10]
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

from benchmarks.measure import extent, print_table
from profiles.arrays import Complexes, Floats, complexes
from profiles.axis.sampled_loop import FlexibleMode, SampledLoop, loop_of
from profiles.axis.servo_gains import PidGains, error_limit_um
from profiles.store import load_machine

FRACTION, DAMPING, DELAY_S, LOBE_HZ = 0.4, 0.02, 0.0002, 50.0
MARGIN, PHASE_DEG, SENSITIVITY, SENSITIVITY_OFF = 2.5, 45.0, 1.8, 2.0
POINTS = 300
MACHINE = load_machine("lee-2001-lathe").machine
PLACES, ZEROS, POLES = (0.9, 1.0, 1.1), (0.05, 0.1, 0.2, 0.3), (0.3, 0.5, 0.7)
KD, KP_OVER_KD, KI_OVER_KP = np.geomspace(0.2, 5.5, 28), np.geomspace(20.0, 300.0, 10), (2.0, 5.0, 10.0, 20.0)


@dataclass(frozen=True, kw_only=True)
class Notch:
    """Numerator and denominator in falling powers of z; both (1, 0, 0) is none."""

    above: tuple[float, ...] = (1.0, 0.0, 0.0)
    below: tuple[float, ...] = (1.0, 0.0, 0.0)

    def at(self, z: Complexes) -> Complexes:
        """Return the response, of 1 at rest."""
        gain = sum(self.below) / sum(self.above)
        return np.asarray(gain * np.polyval(self.above, z) / np.polyval(self.below, z))


def notches(hz: float, period_s: float) -> Iterator[Notch]:
    """Return none, then those of the grid: zeros and poles at the same place, the poles damped more."""
    yield Notch()

    def pair(ratio: float, at_hz: float) -> tuple[float, ...]:
        turn = 2.0 * math.pi * at_hz * period_s
        fade = math.exp(-ratio * turn)
        return (1.0, -2.0 * fade * math.cos(turn * math.sqrt(1.0 - ratio**2)), fade**2)

    for place, zero, pole in itertools.product(PLACES, ZEROS, POLES):
        if zero < pole:
            yield Notch(above=pair(zero, place * hz), below=pair(pole, place * hz))


def plants(loop: SampledLoop, hz: float, off: float) -> list[SampledLoop]:
    """Return the loop with the mode where it was found, then with it elsewhere."""
    found = [(hz, DAMPING)]
    if off:
        parts = (1.0 - off, 1.0 - 0.5 * off, 1.0 + 0.5 * off, 1.0 + off)
        found += itertools.product((part * hz for part in parts), (DAMPING, 0.5 * DAMPING))
    plain = replace(loop.plant, delay_s=DELAY_S)
    return [
        replace(loop, plant=replace(plain, modes=(FlexibleMode(hz=f, damping_ratio=d, fraction=FRACTION),)))
        for f, d in found
    ]


def stable(loop: SampledLoop, notch: Notch) -> bool:
    """Whether the closed loop is stable by python-control, with the extra delay as an all-pass."""
    z = control.tf([1.0, 0.0], [1.0], loop.period_s)
    above, below = loop.plant_polynomials()
    gains, period_s = loop.gains, loop.period_s
    lead = (1.0 - 1.0 / z) / period_s
    pid = gains.kp_v_per_m + gains.ki_v_per_m_s / lead + gains.kd_v_s_per_m * lead
    filtered = control.tf(notch.above, notch.below, period_s) * (sum(notch.below) / sum(notch.above))
    part = loop.plant.delay_s / period_s  # of a period: the nearest all-pass of first order (Thiran)
    pole = (1.0 - part) / (1.0 + part)
    delay = control.tf([pole, 1.0], [1.0, pole], period_s)
    opened = control.tf(above, below, period_s) * pid * filtered * delay / z
    closed = control.minreal(control.feedback(opened, 1.0), verbose=False)
    return bool((np.abs(control.poles(closed)) < 1.0).all())


def candidates() -> tuple[Floats, Floats, Floats]:
    """Return Kp, Ki and Kd side by side."""
    kd, over_kd, over_kp = np.meshgrid(KD, KP_OVER_KD, np.array(KI_OVER_KP), indexing="ij")
    kp = (kd * over_kd).ravel()
    return kp, kp * over_kp.ravel(), kd.ravel()


def free_um_per_n(loop: SampledLoop, s: Complexes) -> Floats:
    """Return how far a force pushes the tool without its loop."""
    per_n = loop.plant.acceleration_per_v / MACHINE.tool.loop_gain_n_per_v
    return np.asarray(1e6 * np.abs(per_n / (s * (s + loop.plant.damping_per_s))))


def yields(opened: Complexes, free: Floats, hz: Floats) -> Floats:
    """Return how far each yields, um/N: at the lobe and, by their order, its multiples; a quarter of the most."""
    compliance = free / np.abs(1.0 + opened)
    at = [np.argmin(np.abs(hz - n * LOBE_HZ)) for n in (1, 2, 3)]
    lobe = sum(compliance[:, place] / n for n, place in enumerate(at, start=1))
    return np.asarray(lobe + 0.25 * compliance.max(axis=1))


def within(opened: Complexes) -> NDArray[np.bool_]:
    """Whether each loop has the margins on the plant that was found."""
    size, angle = np.abs(opened), np.degrees(np.angle(-opened))
    crosses = (size[:, 1:] < 1.0) != (size[:, :-1] < 1.0)
    phase = np.where(crosses, np.minimum(np.abs(angle[:, 1:]), np.abs(angle[:, :-1])), 180.0).min(axis=1)
    real = (opened.imag[:, 1:] < 0.0) != (opened.imag[:, :-1] < 0.0)
    beyond = np.where(real & (opened.real[:, 1:] < 0.0) & (size[:, 1:] < 1.0), size[:, 1:], 0.0).max(axis=1)
    return np.asarray(
        (phase >= PHASE_DEG) & (beyond <= 1.0 / MARGIN) & (np.abs(1.0 + opened).min(axis=1) >= 1.0 / SENSITIVITY)
    )


def best(loop: SampledLoop, hz: float, off: float, *, filtered: bool) -> tuple[PidGains, Notch, float] | None:
    """Return the stiffest gains and their filter, and how far they yield."""
    grid = np.geomspace(0.5, 0.999 * loop.nyquist_hz, POINTS)
    z, s = np.exp(2j * np.pi * grid * loop.period_s), 2j * np.pi * grid
    lead = (1.0 - 1.0 / z) / loop.period_s
    kp, ki, kd = candidates()
    pid = kp[:, None] + ki[:, None] / lead + kd[:, None] * lead
    tried = plants(loop, hz, off)
    responses = [each.plant_response(grid) for each in tried]
    free = free_um_per_n(loop, complexes(s))
    found: list[tuple[float, PidGains, Notch]] = []
    for notch in itertools.islice(notches(hz, loop.period_s), None if filtered else 1):
        control_law = pid * notch.at(z)
        opened = control_law * responses[0]
        good = within(opened)
        for response in responses[1:]:
            good[good] = np.abs(1.0 + control_law[good] * response).min(axis=1) >= 1.0 / SENSITIVITY_OFF
        cost = np.where(good, yields(opened, free, grid), np.inf)
        for place in np.argsort(cost)[:3]:
            if np.isfinite(cost[place]):
                gains = PidGains(
                    kp_v_per_m=float(kp[place]),
                    ki_v_per_m_s=float(ki[place]),
                    kd_v_s_per_m=float(kd[place]),
                    velocity_feedforward_v_s_per_m=float(kd[place]),
                )
                found.append((float(cost[place]), gains, notch))
    for cost_um, gains, notch in sorted(found, key=lambda each: each[0]):
        if all(stable(replace(each, gains=gains), notch) for each in tried):
            return gains, notch, cost_um
    return None


def compliance_um_per_n(loop: SampledLoop, notch: Notch, hz: Floats) -> Floats:
    """Return how far a force pushes the tool while its loop is closed, through a filter."""
    opened = loop.opened(hz) * notch.at(np.exp(2j * np.pi * hz * loop.period_s))
    return np.asarray(free_um_per_n(loop, complexes(2j * np.pi * hz)) / np.abs(1.0 + opened))


def row(loop: SampledLoop, hz: float, off: float, *, filtered: bool) -> tuple[str, ...]:
    """Return one row: the gains, the filter, the compliance, and the dry friction that trips the tool."""
    name = ("with a notch" if filtered else "gains alone", f"{hz:g}", f"{100.0 * off:g}")
    found = best(loop, hz, off, filtered=filtered)
    if found is None:
        return (*name, *("-",) * 5)
    gains, notch, _ = found
    tuned = replace(plants(loop, hz, 0.0)[0], gains=gains)
    at = compliance_um_per_n(tuned, notch, np.array([LOBE_HZ, 2.0 * LOBE_HZ, 3.0 * LOBE_HZ]))
    most = float(compliance_um_per_n(tuned, notch, np.geomspace(0.1, loop.nyquist_hz, 3000)).max())
    pid = f"{gains.kp_v_per_m:.0f} {gains.ki_v_per_m_s:.0f} {gains.kd_v_s_per_m:.2f}"
    filters = " ".join(f"{each:.3f}" for each in (*notch.above[1:], *notch.below[1:]))
    trips_n = error_limit_um(MACHINE) / (2.0 * most)
    return (*name, pid, filters, " ".join(f"{each:.2f}" for each in at), f"{most:.1f}", f"{trips_n:.1f}")


def main() -> None:
    """Print a row without and one with a filter for each mode."""
    options = argparse.ArgumentParser(prog="python -m benchmarks.notch")
    options.add_argument("--hz", type=float, nargs="+", default=(200.0, 300.0, 400.0)[: extent(3, 1)])
    options.add_argument("--off", type=float, default=10.0, help="how far off the mode may be, percent")
    asked = options.parse_args()
    loop = loop_of(MACHINE)
    rows = [row(loop, hz, asked.off / 100.0, filtered=each) for hz in asked.hz for each in (False, True)]
    head = ("", "mode, Hz", "off, %", "Kp Ki Kd", "n1 n2 d1 d2", "um/N at 50 100 150 Hz", "most, um/N", "trips, N")
    print_table("a tool that bends", head, rows)


if __name__ == "__main__":
    main()
