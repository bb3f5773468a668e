"""What a notch filter gains on a tool that bends: the designed loop without one, with a first, with the next one.

The tool of the profile with a mode of 40 % of its motion and 2 % of damping. Its responses with the published
gains are those of the model, at the frequencies and with the amplitudes of docs/tuning.md; the axis is fitted to
them, and gains that no hidden mode meets are designed for it as `console tune` does: alone, with a filter that is
safe however the controller reads its signs, and with one for a controller whose reading a test has shown. Nothing
is written.

    python -m benchmarks.notch [--hz 200 300 400]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from benchmarks.measure import extent, print_table
from profiles.axis.loop_design import GainProposal, designed_gains, unseen_hz
from profiles.axis.notch_design import design_with_notch
from profiles.axis.plant_fit import LoopPoint, PlantFit, fitted_plant
from profiles.axis.sampled_loop import FlexibleMode, SampledLoop, loop_of
from profiles.axis.servo_gains import PidGains, error_limit_um
from profiles.axis.stiffness import lobe_stiffness, tripping_friction_n
from profiles.store import load_machine

FRACTION, DAMPING, LOBE_HZ = 0.4, 0.02, 50.0
SLOW = (25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 95.0)
FAST = (60.0, 75.0, 90.0, 105.0, 120.0, 135.0, 150.0, 165.0, 180.0, 195.0, 210.0, 225.0)
GAIN_CI = 0.0005
MACHINE = load_machine("lee-2001-lathe").machine
NAMES = ("gains alone", "with a first notch", "reading known")


def fit(loop: SampledLoop, hz: float) -> PlantFit:
    """Return the axis behind the responses of a tool that bends at a frequency."""
    bends = FlexibleMode(hz=hz, damping_ratio=DAMPING, fraction=FRACTION)
    true = replace(loop, plant=replace(loop.plant, modes=(bends,)))
    points = [
        LoopPoint(gains=loop.gains, hz=at, response=response, gain_ci=GAIN_CI, amplitude_um=amplitude_um)
        for amplitude_um, sweep in ((50.0, SLOW), (35.0, FAST))
        for at, response in zip(sweep, true.closed_loop(np.array(sweep)).tolist(), strict=True)
    ]
    found = fitted_plant(loop, points)
    assert found is not None and found.plant.modes, "the mode shows"
    return found


def row(name: str, hz: float, loop: SampledLoop, found: GainProposal | None, seconds: float) -> tuple[str, ...]:
    """Return one row: the gains, the filter, the compliance, and the dry friction that trips the tool."""
    if found is None:
        return (name, f"{hz:g}", *("-",) * 5, f"{seconds:.1f}")
    gains = found.gains.at_rest
    stiff = lobe_stiffness(replace(loop, gains=found.gains), MACHINE.tool.loop_gain_n_per_v, LOBE_HZ)
    trips_n = tripping_friction_n(stiff, error_limit_um(MACHINE))
    return (
        name,
        f"{hz:g}",
        f"{gains.kp_v_per_m:.0f} {gains.ki_v_per_m_s:.0f} {gains.kd_v_s_per_m:.2f}",
        " ".join(f"{each:.3f}" for each in gains.notch.coefficients) if gains.notch else "-",
        " ".join(f"{each:.2f}" for each in stiff.um_per_n),
        f"{stiff.most_um_per_n:.1f}",
        f"{trips_n:.1f}",
        f"{seconds:.1f}",
    )


def rows(hz: float) -> list[tuple[str, ...]]:
    """Return the three designs for one mode, with the processor time of each."""
    present = loop_of(MACHINE)
    axis = fit(present, hz)
    loop = replace(present, plant=axis.plant)

    def allowed(gains: PidGains) -> bool:
        return unseen_hz(loop, gains, axis) is None

    begin = time.process_time()
    alone = designed_gains(MACHINE, loop, axis, LOBE_HZ, allowed)
    found = [row(NAMES[0], hz, loop, alone, time.process_time() - begin)]
    for name, proven in ((NAMES[1], False), (NAMES[2], True)):
        begin = time.process_time()
        each = design_with_notch(MACHINE, loop, axis, LOBE_HZ, alone, proven=proven, allowed=allowed)
        found.append(row(name, hz, loop, each, time.process_time() - begin))
    return found


def main() -> None:
    """Print three rows for each mode."""
    options = argparse.ArgumentParser(prog="python -m benchmarks.notch")
    options.add_argument("--hz", type=float, nargs="+", default=(200.0, 300.0, 400.0)[: extent(3, 1)])
    asked = options.parse_args()
    head = ("", "mode, Hz", "Kp Ki Kd", "n1 n2 d1 d2", "um/N at 50 100 150 Hz", "most, um/N", "trips, N", "CPU, s")
    print_table("a tool that bends", head, [each for hz in asked.hz for each in rows(hz)])


if __name__ == "__main__":
    main()
