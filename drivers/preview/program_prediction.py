"""Predict what one planned program makes of the part: its motion, the servo that follows it, and the residual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.cutting.planning import CutPlan
from drivers.identification.nominal import loop_response
from drivers.pmac.trajectory.cubics import CubicMotion
from drivers.preview.outlook import Demand, Response, demands_of, response_of
from profiles.axis.response import ResponseSource, ServoResponse
from profiles.axis.servo import drive_need, sampled_response
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.machine import MachineProfile

FloatArray = NDArray[np.float64]

TURN_POINTS = 720  # points per turn at which a path is computed: 120 in each move of the paper's program


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfacePrediction:
    """What one program leaves of the part over angle x Z; the arrays are read only.

    `z_mm` (Z,) rises from the jaws' side to the free end, `angle_deg` (angle,) are spindle angles. `residual_um`
    (Z, angle) is the deviation of the released part, positive where it is high, with the mean 0 in each section;
    `mean_um` (Z,) is how much larger a section is on the radius than that in the middle. `lobe_factor` (Z,) is the
    lobe of the part over that in the middle. `stroke_um` is the largest programmed tool travel of a turn, peak to
    peak, anywhere along the cut.
    """

    z_mm: FloatArray
    angle_deg: FloatArray
    residual_um: FloatArray
    mean_um: FloatArray
    lobe_factor: FloatArray
    stroke_um: float

    @property
    def ront_um(self) -> FloatArray:
        """Roundness that is left in each section, peak to peak, shape (Z,)."""
        return np.asarray(np.ptp(self.residual_um, axis=1), dtype=np.float64)

    @property
    def worst(self) -> int:
        """The index of the section that is least round."""
        return int(np.argmax(np.round(self.ront_um, 3)))  # of sections that are alike, the one next to the jaws


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramPrediction:
    """What one program makes of the part, over one turn of the steady cut; every array has shape (TURN_POINTS,).

    `angle_deg` are spindle angles, rising in [0, 360). `command_um` is the programmed tool path, `path_um` the
    servo's actual path, both um of infeed from the surface of the blank. `residual_um` is the deviation of the
    released part, positive where it is high, mean 0; the clamped blank is taken as round. The arrays are read
    only. `response` is that of the loop at `lobe_frequency_hz`, `demands` are the needs of a sine with the
    stroke of the program, both at the actual speed of the program. `surface` is what is left along the whole cut,
    where that was predicted; the stroke of `demands` is then the largest along it.
    """

    angle_deg: FloatArray
    command_um: FloatArray
    path_um: FloatArray
    residual_um: FloatArray
    lobe_frequency_hz: float
    response: Response
    demands: dict[str, Demand]
    surface: SurfacePrediction | None = None

    @property
    def ront_um(self) -> float:
        """Roundness that is left, peak to peak."""
        return float(np.ptp(self.residual_um))

    @property
    def stroke_um(self) -> float:
        """Programmed tool travel mid-cut, peak to peak."""
        return float(np.ptp(self.command_um))

    @property
    def largest_stroke_um(self) -> float:
        """Programmed tool travel where along the cut it is largest, peak to peak."""
        return self.stroke_um if self.surface is None else self.surface.stroke_um

    @property
    def mean_um(self) -> float:
        """Mean depth of the cut on the radius."""
        return float(np.mean(self.path_um))


def predict(
    job: Job,
    machine: MachineProfile,
    plan: CutPlan,
    response: ServoResponse | None = None,
    turns: PlannedTurns | None = None,
) -> ProgramPrediction:
    """Predict what a planned cut makes of the part; `turns` are its own, if they are at hand.

    The motion is that of the program, move by move; the spindle follows exactly, the tool as the nominal servo
    does, and at the lobe frequency as identified, if `response` was identified on the path of this plan.
    Cutting force and unmeasured properties of the machine are not included.
    """
    turns = turns or PlannedTurns(machine, plan)
    begins = plan.setup.carriage_middle - 0.5 * plan.setup.carriage_per_turn
    angle_deg, command_um = (each[0] for each in turns.from_carriage([begins], 1, TURN_POINTS))
    known = known_loop(job, machine, plan, response)
    path_um = predict_following(machine, command_um, plan.spindle_speed_rpm, known)
    frequency_hz = job.jaws * plan.spindle_speed_rpm / 60.0
    order = np.argsort(angle_deg, kind="stable")
    need = drive_need(machine, 0.5 * float(np.ptp(command_um)), frequency_hz)
    return ProgramPrediction(
        angle_deg=_freeze_array(angle_deg[order]),
        command_um=_freeze_array(command_um[order]),
        path_um=_freeze_array(path_um[order]),
        residual_um=_freeze_array(left_by(job, angle_deg, path_um)[order]),
        lobe_frequency_hz=frequency_hz,
        response=response_of(job, known.get(job.jaws, complex(sampled_response(machine, frequency_hz)))),
        demands=demands_of(machine, need),
    )


def known_loop(
    job: Job, machine: MachineProfile, plan: CutPlan, response: ServoResponse | None
) -> dict[int, complex]:
    """Return the response of the loop by its order (UPR), where it was identified."""
    if response is None or response.source is not ResponseSource.IDENTIFIED:
        return {}
    return {job.jaws: loop_response(plan.strategy, machine, response, job.lobe_frequency_hz)}


def left_by(job: Job, angle_deg: FloatArray, path_um: FloatArray) -> FloatArray:
    """Return the deviation of the released part after a cut of these depths at these angles, mean 0, um.

    Where the tool is clear of the part (a depth below 0) it removes nothing.
    """
    left_um = free_state_lobe(job).at_um(angle_deg) - np.maximum(path_um, 0.0)
    return np.asarray(left_um - left_um.mean(), dtype=np.float64)


def predict_following(
    machine: MachineProfile,
    command: FloatArray,
    speed_rpm: float,
    known: Mapping[int, complex] | None = None,
    turns: int = 1,
) -> FloatArray:
    """Return how the tool servo follows whole turns of a periodic motion.

    `command` are points at equal times along the last axis, in any unit; the result is in the same. Each frequency
    passes through the response of the sampled loop, times what `known` differs from it at the nearest order (UPR);
    frequencies above half the loop's are left out.
    """
    spectrum = np.fft.rfft(command)
    frequency_hz = np.arange(spectrum.shape[-1]) * speed_rpm / 60.0 / turns
    below = frequency_hz < 500.0 / machine.controller.servo_period_ms
    loop = np.zeros(frequency_hz.size, dtype=np.complex128)
    loop[below] = sampled_response(machine, frequency_hz[below])
    order = np.rint(np.arange(loop.size) / turns)
    for each, response in (known or {}).items():
        loop[order == each] *= response / loop[each * turns]
    return np.fft.irfft(loop * spectrum, command.shape[-1])


class PlannedTurns:
    """The motion of a planned cut by the turn, sampled at equal time steps."""

    def __init__(self, machine: MachineProfile, plan: CutPlan) -> None:
        checked = plan.checked
        self.turn_ms = 60_000.0 / plan.spindle_speed_rpm
        self._machine, self._plan = machine, plan
        self._pieces = [piece for move in checked.moves for piece in move.pieces]
        self._ends_ms = np.cumsum([piece.duration_ms for piece in self._pieces])
        carriage = checked.motors.index(machine.carriage.motor)
        self._carriage = np.array([piece.cubics[carriage][0] for piece in self._pieces])

    def from_carriage(self, begins: Sequence[float], turns: int, points: int) -> tuple[FloatArray, FloatArray]:
        """Return spindle angles, deg in [0, 360), of the first turn, (begins, points), and infeed, um, of all.

        Each row begins with the first piece of the program in which the carriage is that far, counts.
        """
        first = [int(np.argmax(self._carriage >= each)) for each in begins]
        begins_ms = np.array([self._ends_ms[each - 1] if each else 0.0 for each in first])
        instants_ms = begins_ms[:, None] + self.turn_ms * np.arange(turns * points) / points
        last = len(self._pieces) - 1
        running = np.minimum(np.searchsorted(self._ends_ms, instants_ms, side="right"), last)
        used = np.flatnonzero(np.bincount(running.ravel(), minlength=last + 1))
        pieces, place = [self._pieces[each] for each in used.tolist()], np.searchsorted(used, running)
        begun_ms = self._ends_ms[used] - np.array([each.duration_ms for each in pieces])
        since_ms = instants_ms - begun_ms[place]

        def positions(motor: int, samples: int) -> FloatArray:
            index, of_piece, at_ms = (
                self._plan.checked.motors.index(motor),
                place[:, :samples],
                since_ms[:, :samples],
            )
            cubics = np.array([piece.cubics[index] for piece in pieces]).T[:, of_piece]
            return CubicMotion(cubics=cubics, duration_ms=at_ms).positions_at(at_ms)

        spindle = positions(self._machine.spindle.motor, points)
        tool = positions(self._machine.tool.motor, turns * points)
        angle_deg = np.mod(360.0 * spindle / self._machine.spindle.counts_per_rev, 360.0)
        return angle_deg, (tool - self._plan.setup.surface) * self._machine.tool.count_um


def _freeze_array(values: FloatArray) -> FloatArray:
    values.setflags(write=False)
    return values
