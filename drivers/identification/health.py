"""Health test of the tool axis: a step, a parabola and a sine at its zero, gathered by the controller.

It has the preconditions, the watch and the end of an identification: the spindle at rest, the tool clear of
everything, the watchdog alive; on any error or stop the machine is brought to rest, drives disabled.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from drivers.commissioning.reading import read_gathering
from drivers.cutting.strategy import Strategy
from drivers.errors import DriverError, RefusedError
from drivers.identification.excitation import ExcitedAxis, PvtPath, Sweep, axis_word, program_text
from drivers.identification.identify import restore_after
from drivers.identification.measuring import SPARE_SAMPLES, SettingsComparison, measure, run_gathered
from drivers.identification.request import (
    AMPLITUDE_UM,
    IdentificationRequest,
    clearance_problems,
    request_problems,
)
from drivers.identification.result import IdentifiedPoint, ResponseOrigin
from drivers.identification.rig import Rig, put_back, refuse_unready, standing_problems
from drivers.identification.standstill import Standstill, link_problems
from drivers.lathe.snapshot import AxisName
from drivers.pmac.gathering.gather import GatherError
from drivers.pmac.gathering.gather_client import DataGathering, GatheredData
from drivers.pmac.program_text import read_program
from profiles.arrays import Floats, floats
from profiles.axis.sampled_loop import SampledLoop, loop_of
from profiles.axis.servo_gains import error_limit_um
from profiles.axis.step_figures import ErrorFigures, StepFigures, error_figures, model_step, step_figures
from profiles.machine import MachineProfile
from profiles.problem import Problem
from profiles.strict_values import positive, read_own

SINE_HZ, SINE_PERIODS = 40.0, 20
SETTLED_COUNTS = 2.0  # what the encoder shows at rest
WATCHED_HZ = 10.0  # at which the watch for a frozen encoder asks again
KEPT_BEFORE_MS, KEPT_AFTER_MS = 10.0, 100.0  # samples about the step that are kept
_BEFORE_S = 0.02
EDGE_MS = 5  # duration of the step: short against the rise of the loop, long enough for the drive
HALF_MS = 40  # duration of each of the four parts of the parabola
SEGMENT_MS = 50
LEAD_S, SETTLE_S = 1.0, 0.2  # rest before the first move; when in it gathering begins
HOLD_S = 0.3  # rest after each move
PARABOLA_TIMES = 8.0  # distance of the parabola in steps: at four times 40 ms it needs a third of the acceleration

_HOLD = """\
P25=0
PVT{segment}
WHILE(P25<{most} AND {go_on})
P25=P25+1
{letter}{place}:0
ENDWHILE
"""

_TEXT = """\
; health test: a step of {step_um} um in {edge} ms, a parabola of {far_um} um
P11={step} ; the step
P12={far} ; the parabola
P13={speed} ; its greatest speed, a second
P20={centre} ; where it begins
CLOSE
OPEN PROG {program}
CLEAR
ABS
{flag}=0 ; the host sets it to end the test
{before}IF({go_on})
PVT{edge}
{letter}(P20+P11):0
{out}PVT{edge}
{letter}(P20):0
ENDIF
{between}IF({go_on})
PVT{half}
{letter}(P20+P12/2):(P13)
{letter}(P20+P12):0
{far_hold}PVT{half}
{letter}(P20+P12/2):(-P13)
{letter}(P20):0
ENDIF
{after}CLOSE
"""
SCHEMA = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthRequest:
    """One test: the step, which is the amplitude of the sine as well, and sizes and times that follow from it.

    Lengths in um; times from the beginning of the step, s.
    """

    step_um: float = AMPLITUDE_UM
    sine_hz: float = SINE_HZ

    @property
    def sine(self) -> IdentificationRequest:
        """The sine as an identification of one frequency."""
        frequencies = (self.sine_hz,)
        return IdentificationRequest(
            path=Strategy.PVT, frequencies_hz=frequencies, amplitude_um=self.step_um, periods=SINE_PERIODS
        )

    @property
    def parabola_um(self) -> float:
        """The distance of the parabola."""
        return PARABOLA_TIMES * self.step_um

    @property
    def back_s(self) -> float:
        """When the step goes back."""
        return EDGE_MS / 1000.0 + HOLD_S

    @property
    def parabola_s(self) -> float:
        """When the parabola begins."""
        return 2.0 * self.back_s

    @property
    def end_s(self) -> float:
        """When the last rest ends."""
        return self.parabola_s + 4.0 * HALF_MS / 1000.0 + 2.0 * HOLD_S

    @property
    def longest_s(self) -> float:
        """How long the program runs at most."""
        return LEAD_S + self.end_s + 1.0

    def peak_speed_mm_per_s(self) -> float:
        """Return the greatest commanded speed, of step or parabola."""
        return max(1.5 * self.step_um / EDGE_MS, self.parabola_um / HALF_MS)

    def peak_acceleration_m_per_s2(self) -> float:
        """Return the greatest commanded acceleration."""
        step = 6.0 * self.step_um / EDGE_MS**2
        return max(step, self.parabola_um / HALF_MS**2)


def health_text(machine: MachineProfile, word: ExcitedAxis, request: HealthRequest, centre_counts: float) -> str:
    """Return the program: cubic segments, a single short one for the step, four for the parabola, rests between.

    It waits before the first move until the host has begun to gather, and ends by itself; whoever ends it or stops
    keeping the watchdog alive ends it within a segment and a pair of moves.
    """
    count_um, half_s = machine.tool.count_um, HALF_MS / 1000.0

    def hold(place: str, seconds: float) -> str:
        most = str(math.ceil(seconds * 1000.0 / SEGMENT_MS))
        return _HOLD.replace("{most}", most).replace("{place}", place)

    text = _TEXT
    for name, place, seconds in (
        ("before", "(P20)", LEAD_S),
        ("out", "(P20+P11)", HOLD_S),
        ("between", "(P20)", HOLD_S),
        ("far_hold", "(P20+P12)", HOLD_S),
        ("after", "(P20)", HOLD_S + 1.0),
    ):
        text = text.replace(f"{{{name}}}", hold(place, seconds))
    return program_text(
        text,
        machine,
        word,
        step_um=request.step_um,
        far_um=request.parabola_um,
        step=word.length(request.step_um / count_um),
        far=word.length(request.parabola_um / count_um),
        speed=word.length(request.parabola_um / count_um) / half_s,
        centre=word.position(centre_counts),
        edge=EDGE_MS,
        half=HALF_MS,
        segment=SEGMENT_MS,
    )


def health_problems(request: HealthRequest, machine: MachineProfile) -> tuple[Problem, ...]:
    """Return everything that forbids this test on this machine; nothing is sent for it."""
    return request_problems(request.sine, machine) or tuple(_find_travel_problems(request, machine))


def _find_travel_problems(request: HealthRequest, machine: MachineProfile) -> Iterator[Problem]:
    tool, motor = machine.tool, machine.tool.motor
    variables, per_mm = machine.controller.variables, machine.tool.counts_per_mm
    speed, acceleration = request.peak_speed_mm_per_s(), request.peak_acceleration_m_per_s2()
    force_n = tool.moving_mass_kg * acceleration + tool.damping_n_s_per_m * speed / 1000.0
    for key, value, limit, unit in (
        (f"I{motor}16", speed * per_mm / 1000.0, variables[f"I{motor}16"], "counts/ms"),
        (f"I{motor}17", acceleration * per_mm / 1000.0, variables[f"I{motor}17"], "counts/ms2"),
        (f"I{motor}11", request.step_um, error_limit_um(machine), "um"),
        ("tool.continuous_force_n", force_n, tool.continuous_force_n, "N"),
    ):
        if value >= limit:
            yield Problem(
                code="health.beyond_drive", key=key, value=f"{value:.4g} {unit}", limit=f"< {limit:.4g} {unit}"
            )
    yield from clearance_problems(machine, request.parabola_um)


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthModel:
    """What the loop of the profile would have made of the same reference, with the gains that were read."""

    step: StepFigures
    parabola: ErrorFigures
    gain: float
    phase_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class HealthResult:
    """One test. `date` is UTC; the samples are those about the step: ms from its beginning, and um."""

    origin: ResponseOrigin
    date: str
    step_um: float
    step: StepFigures
    parabola: ErrorFigures
    sine: IdentifiedPoint
    model: HealthModel
    times_ms: tuple[float, ...]
    reference_um: tuple[float, ...]
    position_um: tuple[float, ...]


FIGURES = tuple(
    "rise_ms overshoot_percent settling_ms end_um peak_um rms_um sine_gain sine_phase_deg coherence".split()
)
"""Names of what is compared from test to test."""


def figures_of(result: HealthResult) -> dict[str, float]:
    """Return the `FIGURES` of a test by name, except those that the tool did not reach."""
    return _figures_by_name(result.step, result.parabola) | {
        "sine_gain": result.sine.gain,
        "sine_phase_deg": result.sine.phase_deg,
        "coherence": result.sine.coherence,
    }


def model_figures_of(result: HealthResult) -> dict[str, float]:
    """Return the same of the model; it has no coherence."""
    model = result.model
    return _figures_by_name(model.step, model.parabola) | {
        "sine_gain": model.gain,
        "sine_phase_deg": model.phase_deg,
    }


def _figures_by_name(step: StepFigures, parabola: ErrorFigures) -> dict[str, float]:
    """Return figures by name; what the tool did not reach is left out."""
    found = {
        "rise_ms": step.rise_ms,
        "overshoot_percent": step.overshoot_percent,
        "settling_ms": step.settling_ms,
        "end_um": step.end_um,
        "peak_um": parabola.peak_um,
        "rms_um": parabola.rms_um,
    }
    return {key: value for key, value in found.items() if value is not None}


def as_table(result: HealthResult) -> dict[str, Any]:
    """Return the result as plain values for a file."""
    return {"schema": SCHEMA, **asdict(result)}


def from_table(table: Any, where: str = "") -> HealthResult:
    """Read the output of `as_table`. Raises ProfileError: `schema.unsupported`; `health.file`, anything else."""
    return read_own(HealthResult, table, schema=SCHEMA, code="health.file", where=where, judge=_judge)


def _judge(result: HealthResult) -> None:
    positive(result.step_um)
    if not len(result.times_ms) == len(result.reference_um) == len(result.position_um):
        raise ValueError(f"{len(result.times_ms)} times, {len(result.position_um)} positions")


def check_health(rig: Rig, request: HealthRequest, origin: ResponseOrigin, date: str) -> HealthResult:
    """Test the tool, with the drives enabled, homed, and everything at rest; the tool ends at its zero.

    Raises as `identify`, and ProfileError: `health.no_step`.
    """
    settings = SettingsComparison(rig, origin)
    refuse_unready(rig, health_problems(request, rig.machine))
    if problems := (*standing_problems(rig), *link_problems(rig, request.step_um)):
        raise RefusedError(*problems)
    gathering = read_gathering(rig.client, rig.dialect)
    try:
        rig.lathe.jog_to(AxisName.TOOL, 0.0)
        data = _run_moves(rig, request)
        sine = measure(rig, PvtPath(rig.machine, request.step_um), request.sine_hz, request.sine)
        put_back(rig, gathering, table=False)
        settings.refuse_changed()
    except BaseException as error:
        restore_after(rig, gathering, error, table=False)
        raise
    return _result(rig.machine, request, data, origin, date, sine)


def _run_moves(rig: Rig, request: HealthRequest) -> GatheredData:
    """Run step and parabola, and return the gathered data."""
    machine = rig.machine
    word = axis_word(machine, machine.tool.motor)
    rig.lathe.program.load(read_program(health_text(machine, word, request, 0.0)))
    gathering = DataGathering(client=rig.client, dialect=rig.dialect)
    period_s = machine.controller.servo_period_ms / 1000.0
    samples = math.ceil((LEAD_S - SETTLE_S + request.end_s) / period_s) + SPARE_SAMPLES
    sweep = Sweep(text="", steady_s=SETTLE_S, longest_s=request.longest_s)
    try:
        plan = gathering.prepare(gathering.motor_channels(*_channels(machine)), samples)
        run_gathered(rig, sweep, plan, Standstill(rig, WATCHED_HZ, request.step_um))
        return gathering.fetch(plan)
    except GatherError as error:
        raise DriverError(Problem(code="identify.gather", where=rig.where, value=str(error))) from error


def _channels(machine: MachineProfile) -> tuple[str, str]:
    return f"#{machine.tool.motor} commanded", f"#{machine.tool.motor} actual"


def _result(
    machine: MachineProfile,
    request: HealthRequest,
    data: GatheredData,
    origin: ResponseOrigin,
    date: str,
    sine: IdentifiedPoint,
) -> HealthResult:
    count_um = machine.tool.count_um
    time_s = floats(data.times_ms / 1000.0)
    reference, position = (floats(data.values[name] * count_um) for name in _channels(machine))
    begin_s = _begin_s(time_s, reference, request.step_um)
    loop = loop_of(machine)
    predicted = model_step(loop, reference)
    step = _window(time_s, begin_s - _BEFORE_S, begin_s + request.back_s)
    far = _window(time_s, begin_s + request.parabola_s, begin_s + request.end_s)
    kept = _window(time_s, begin_s - KEPT_BEFORE_MS / 1000.0, begin_s + KEPT_AFTER_MS / 1000.0)
    least_um = SETTLED_COUNTS * count_um
    model = HealthModel(
        step=step_figures(time_s[step], reference[step], predicted[step], least_um=least_um),
        parabola=error_figures(reference[far], predicted[far]),
        **_sine_of(loop, request.sine_hz),
    )
    return HealthResult(
        origin=origin,
        date=date,
        step_um=request.step_um,
        step=step_figures(time_s[step], reference[step], position[step], least_um=least_um),
        parabola=error_figures(reference[far], position[far]),
        sine=sine,
        model=model,
        times_ms=tuple(np.round(1000.0 * (time_s[kept] - begin_s), 4).tolist()),
        reference_um=tuple(np.round(reference[kept] - reference[0], 3).tolist()),
        position_um=tuple(np.round(position[kept] - reference[0], 3).tolist()),
    )


def _sine_of(loop: SampledLoop, frequency_hz: float) -> dict[str, float]:
    response = complex(loop.closed_loop(np.array([frequency_hz]))[0])
    return {"gain": abs(response), "phase_deg": math.degrees(cmath.phase(response))}


def _begin_s(time_s: Floats, reference: Floats, step_um: float) -> float:
    """Return when the step begins in the reference. Raises DriverError: `identify.ended_early`, there is none."""
    moved = np.abs(reference - reference[0]) > 0.001 * step_um
    if moved[0] or not moved.any():
        raise DriverError(Problem(code="identify.ended_early", key="step"))
    return float(time_s[max(int(np.argmax(moved)) - 1, 0)])


def _window(time_s: Floats, from_s: float, to_s: float) -> slice:
    return slice(int(np.searchsorted(time_s, from_s)), int(np.searchsorted(time_s, to_s)))
