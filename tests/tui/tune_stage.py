"""The loop of the tool as it was read, and responses that are kept of it, for the page Tune."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from console.session.data.identified import store
from drivers.cutting.strategy import Strategy
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, Origin
from drivers.identification.tool_loop import MODELLED, UNMODELLED, ToolLoop
from tests.tui.stage import MACHINE, lathe


def tool_loop() -> ToolLoop:
    """The loop of the paper's tool, with another integrator than its profile has."""
    stated = {**lathe().machine.controller.variables, "I133": 900.0}
    values = tuple((number, stated.get(f"I1{number:02d}", 0.0)) for number in (*MODELLED, *UNMODELLED))
    period_ms = lathe().machine.controller.servo_period_ms
    return ToolLoop(motor=1, values=values, servo_period_ms=period_ms, at="08:52")


def identified() -> IdentifiedResponse:
    """A response of that tool, by another integrator, as `console identify` keeps it."""
    gains = {name: value for name, value in tool_loop().gains.items() if name >= "I130"}
    period_ms = lathe().machine.controller.servo_period_ms
    origin = Origin(
        machine=MACHINE, simulated=True, version="1.17", kind="PMAC", gains=gains, servo_period_ms=period_ms
    )
    at = (
        (10.0, 1.013, -4.2),
        (20.0, 0.998, -13.9),
        (40.0, 0.921, -36.2),
        (50.0, 0.872, -46.0),
        (80.0, 0.71, -72.0),
    )
    points = [
        IdentifiedPoint(
            frequency_hz=hz,
            gain=gain,
            phase_deg=phase_deg,
            gain_ci=0.002,
            phase_ci_deg=0.2,
            coherence=0.999,
            amplitude_um=25.0,
        )
        for hz, gain, phase_deg in at
    ]
    return IdentifiedResponse(
        origin=origin,
        path=Strategy.PVT,
        how="measured",
        delay_cycles=0,
        date="2026-01-01T10:05:00.000Z",
        points=tuple(points),
    )


def fill(data: Path) -> None:
    """Keep two responses: one of this loop, and an older one of another gain."""
    store(data, identified())
    older = replace(identified(), date="2025-12-01T09:00:00.000Z")
    store(data, replace(older, origin=replace(older.origin, gains={**older.origin.gains, "I130": 600.0})))
