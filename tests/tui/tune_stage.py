"""The loop of the tool as it was read, and responses that are kept of it, for the page Tune."""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from console.session.data.health import store as store_test
from console.session.data.identified_responses import store
from drivers.cutting.strategy import Strategy
from drivers.identification.health import HealthModel, HealthResult
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, ResponseOrigin
from drivers.identification.tool_gains import MODELLED, UNMODELLED, ToolLoop
from profiles.axis.sampled_loop import FlexibleMode, SampledLoop, loop_of, profile_plant
from profiles.axis.servo_gains import with_variables
from profiles.axis.step_figures import ErrorFigures, StepFigures, model_step
from tests.tui.stage import MACHINE, lathe


def tool_loop() -> ToolLoop:
    """The loop of the paper's tool, with another integrator than its profile has."""
    stated = {**lathe().machine.controller.variables, "I133": 900.0}
    values = tuple((number, stated.get(f"I1{number:02d}", 0.0)) for number in (*MODELLED, *UNMODELLED))
    period_ms = lathe().machine.controller.servo_period_ms
    return ToolLoop(motor=1, values=values, servo_period_ms=period_ms, at="08:52")


SLOW = (25.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 95.0)
FAST = (105.0, 120.0, 135.0, 150.0, 165.0, 180.0, 195.0, 210.0, 225.0)
"""Two sweeps that a design can rest on, of 50 and of 35 um."""


def point(hz: float, response: complex, amplitude_um: float, gain_ci: float = 0.002) -> IdentifiedPoint:
    """One point of a response."""
    return IdentifiedPoint(
        frequency_hz=hz,
        gain=abs(response),
        phase_deg=math.degrees(cmath.phase(response)),
        gain_ci=gain_ci,
        phase_ci_deg=100.0 * gain_ci,
        coherence=0.999,
        amplitude_um=amplitude_um,
    )


def swept(loop: SampledLoop, gain_ci: float = 0.002) -> tuple[IdentifiedPoint, ...]:
    """The points of a loop in both sweeps."""
    return tuple(
        point(hz, response, amplitude_um, gain_ci)
        for amplitude_um, at in ((50.0, SLOW), (35.0, FAST))
        for hz, response in zip(at, loop.closed_loop(at).tolist(), strict=True)
    )


AS_MEASURED = tuple(
    point(hz, cmath.rect(gain, math.radians(phase_deg)), 25.0)
    for hz, gain, phase_deg in (
        (10.0, 1.013, -4.2),
        (20.0, 0.998, -13.9),
        (40.0, 0.921, -36.2),
        (50.0, 0.872, -46.0),
        (80.0, 0.71, -72.0),
    )
)


def identified(
    points: tuple[IdentifiedPoint, ...] = AS_MEASURED,
    gains: Mapping[str, float] | None = None,
    *,
    simulated: bool = True,
) -> IdentifiedResponse:
    """A response of that tool, by another integrator, as `console identify` keeps it."""
    present = {name: value for name, value in tool_loop().gains.items() if name >= "I130"}
    origin = ResponseOrigin(
        machine=MACHINE,
        simulated=simulated,
        version="1.17",
        kind="PMAC",
        gains=present if gains is None else gains,
        servo_period_ms=lathe().machine.controller.servo_period_ms,
    )
    return IdentifiedResponse(
        origin=origin,
        path=Strategy.PVT,
        how="measured",
        delay_cycles=0,
        date="2026-01-01T10:05:00.000Z",
        points=points,
    )


def health(*, rise_ms: float | None = 4.9, date: str = "2026-01-01T10:00:00.000Z") -> HealthResult:
    """A health test with a step of the first order."""
    times_ms = [0.5 * place - 10.0 for place in range(220)]
    moved = [25.0 * (1.0 - math.exp(-max(t, 0.0) / 4.0)) for t in times_ms]
    step = StepFigures(size_um=25.0, rise_ms=rise_ms, overshoot_percent=2.4, settling_ms=8.41, end_um=0.14)
    parabola = ErrorFigures(peak_um=12.45, rms_um=3.24)
    model = HealthModel(step=replace(step, rise_ms=4.91), parabola=parabola, gain=0.9366, phase_deg=-42.08)
    (sine, *_) = identified().points
    return HealthResult(
        origin=identified().origin,
        date=date,
        step_um=25.0,
        step=step,
        parabola=parabola,
        sine=replace(sine, frequency_hz=40.0, gain=0.931, phase_deg=-43.2),
        model=model,
        times_ms=tuple(times_ms),
        reference_um=tuple(25.0 if t > 0 else 0.0 for t in times_ms),
        position_um=tuple(moved),
    )


BENDS = FlexibleMode(hz=300.0, damping_ratio=0.02, fraction=0.4)
FIRST = {"I130": 610.0, "I131": 1657.0, "I132": 1657.0, "I133": 743.0}
FIRST |= {"I136": -1.09375, "I137": 0.908203125, "I138": -0.169921875, "I139": 0.134765625}
"""A first filter with its gains, as it is designed for a tool with this mode."""


def bending(settings: Mapping[str, float] | None = None) -> SampledLoop:
    """The loop of the paper's tool where it bends, by the profile or with these settings."""
    machine = with_variables(lathe().machine, settings or {})
    return loop_of(machine, replace(profile_plant(machine), modes=(BENDS,)))


def filter_test(
    gains: Mapping[str, float] = FIRST, tuned: Mapping[str, float] = FIRST, *, simulated: bool = True
) -> HealthResult:
    """The step of a health test with a filter, on a tool that bends; `gains` are those that it names."""
    loop, made = bending(tuned), health()
    at_ms = 1000.0 * loop.period_s * np.arange(-20, 200)
    reference = np.clip(5.0 * at_ms, 0.0, 25.0)
    return replace(
        made,
        origin=replace(made.origin, gains=gains, simulated=simulated),
        times_ms=tuple(at_ms.tolist()),
        reference_um=tuple(reference.tolist()),
        position_um=tuple(model_step(loop, reference).tolist()),
    )


def fill_tests(data: Path) -> None:
    """Keep two health tests; in the older one the tool did not reach its place."""
    store_test(data, health(rise_ms=None, date="2025-12-20T09:00:00.000Z"))
    store_test(data, health())


def fill_measured(data: Path) -> None:
    """Keep a response of the profile's axis that a design can rest on: two amplitudes, up to 225 Hz."""
    loop = loop_of(tool_loop().apply_to(lathe().machine))
    store(data, replace(identified(swept(loop)), date="2026-01-01T10:06:00.000Z"))


def fill(data: Path) -> None:
    """Keep two responses: one of this loop, and an older one of another gain."""
    store(data, identified())
    older = replace(identified(), date="2025-12-01T09:00:00.000Z")
    store(data, replace(older, origin=replace(older.origin, gains={**older.origin.gains, "I130": 600.0})))
