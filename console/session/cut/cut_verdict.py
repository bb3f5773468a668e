"""The verdict on a cut that has ended: was the tool where its plan has it, in every turn of the feed?

A controller reports where the tool is and where it is commanded. So two things are told apart:

- disturbed: the command left the plan. Only a change of the program, its tables or a zero does that. Such a part
  is neither measured nor learned from.
- tool error: the command kept to the plan, and the tool did not follow: servo, friction, cutting force. It is
  stated in um; the part is measured and learned from.

Where the polls do not carry either, because they are too few or scatter too much, the cut is not proven.

Fit the error of the tool against its plan, from all polls of the feed: mean, slope, decay, harmonics.

Model of the error e_i, um, infeed positive, at the spindle angle t_i (turns) and the place z_i along the cut:

e_i = mean + slope z_i + sum_k d_k D_k(t_i) + sum_n Re(c_n exp(2 pi j n t_i))

z runs from -1/2 to 1/2 over the stretch, so `slope_um` is the change over the whole of it. D_k decays over some
turns from the first poll on, and has no mean: `mean_um` is the mean of all polls. Nothing is compared with other
turns: an error that is the same from the first turn to the last is in `mean_um` and the harmonics.

Neighbouring polls are not independent. With the correlation r of neighbouring residuals, M polls count as
M (1 - r) / (1 + r), and the standard errors grow by the root of that ratio.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from drivers.cutting.corrected_motion import source_is_late
from drivers.cutting.path_seen import LEAST_TOOL_UM, TIMES_USUAL
from drivers.cutting.planning import CutPlan
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.pmac.settings import PARTS_PER_COUNT
from drivers.pmac.witness import GAP, WitnessReport
from drivers.preview.program_prediction import predict
from profiles.arrays import Floats
from profiles.job import Job
from profiles.least_squares import Fit, fit, harmonic_columns, harmonic_slice, phasors
from profiles.machine import MachineProfile
from profiles.problem import Problem

BUDGET = {"tool": 0.7, "clamping": 0.2, "gauge": 0.1}
"""Fraction of a tolerance of the job that each may use: the gauge by the rule of ten, the tool what is left."""

COMMAND_UM = 0.5
"""Least deviation of a command that is a disturbance; polls of a cut that nobody disturbs scatter by 0.1 um."""

MOST_SKEW_CYCLES = 3.0  # servo cycles between the polled angle of a spindle that others turn, and the tool
LAST_TURN = 0.15  # fraction of the last turn that is left out: after it the tool retracts
LATE = 1.5  # a poll that took this many times the usual was interrupted: its values are not of one instant
EXIT_NOT_PROVEN = 4
ENTRY_TURNS = (3.0, 12.0)  # a tool that meets the part yields over so many turns: guides, then loop
LEAST_POLLS = 16
POLLS_A_TERM = 2.0
MOST_ORDER = 15
SURE = 2.0
"""Coverage factor: standard errors on either side, 95 %."""

WORTH_TELLING = 3.0  # standard errors from which a harmonic is more than scatter
MOST_CONDITION = 50.0  # beyond it two terms are nearly the same at the polled angles


class CutJudgement(StrEnum):
    """What is known of a cut by the polls of its feed."""

    AS_PLANNED = "as_planned"
    TOOL_ERROR = "tool_error"
    DISTURBED = "disturbed"
    NOT_PROVEN = "not_proven"

    @property
    def exit_code(self) -> int:
        """Exit code of a command that made the cut; a tool error alone leaves it to the measured part."""
        return {CutJudgement.DISTURBED: 1, CutJudgement.NOT_PROVEN: EXIT_NOT_PROVEN}.get(self, 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolError:
    """Error of the tool over a cut, um, and the standard error of each figure (`_se_um`).

    `slope_um` is the change from the first poll to the last, the decay apart; `decay_um` what of the error at the
    first poll decays. `orders` are amplitudes with phase, Re(c exp(j n angle)), in the middle; that of the lobe
    changes by `lobe_change_um` from the first poll to the last, 0 where that does not stand out. `polls` were
    fitted, and count as `independent`.
    """

    mean_um: float
    mean_se_um: float
    slope_um: float
    slope_se_um: float
    decay_um: float
    decay_se_um: float
    orders: Mapping[int, complex]
    orders_se_um: Mapping[int, float]
    polls: int
    independent: float
    lobes: int = 0
    lobe_change_um: complex = 0j

    @property
    def significant_orders(self) -> tuple[int, ...]:
        """Orders of 2 and more that stand out from the scatter; of once a turn the part is only eccentric."""
        return tuple(
            n for n, each in self.orders.items() if n >= 2 and abs(each) > WORTH_TELLING * self.orders_se_um[n]
        )

    @property
    def roundness_um(self) -> float:
        """Height, peak to peak, of all counted orders together: what the tool takes of the roundness at an end."""
        angle, counted = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False), self.significant_orders
        height = np.zeros_like(angle)
        for n in counted:
            height = height + np.real(self.orders[n] * np.exp(1j * n * angle))
        change = self.lobe_change_um * np.exp(1j * self.lobes * angle) if self.lobes in counted else 0j * angle
        return max(float(np.ptp(height + end * change.real)) for end in (-0.5, 0.5))

    @property
    def roundness_within_um(self) -> float:
        """Uncertainty of `roundness_um`; without a counted order that of the least certain one."""
        errors = [self.orders_se_um[n] for n in self.significant_orders]
        worst = max((each for n, each in self.orders_se_um.items() if n >= 2), default=math.inf)
        return 2.0 * SURE * (math.hypot(*errors) if errors else worst)

    @property
    def size_um(self) -> float:
        """Largest error of the diameter along the stretch: twice the mean error with half of the slope."""
        return 2.0 * (abs(self.mean_um) + 0.5 * abs(self.slope_um))

    @property
    def size_within_um(self) -> float:
        """Uncertainty of `size_um`."""
        return 2.0 * SURE * math.hypot(self.mean_se_um, 0.5 * self.slope_se_um)


def fit_tool_error(turns: Floats, places: Floats, error_um: Floats, lobes: int) -> ToolError | None:
    """Return the error of a tool from its polls, shape (M,) each; None if they do not support the `lobes`.

    `places` are along the cut, in any unit. As many orders are fitted as there are polls for, from 1 up, and not
    those that so few angles cannot tell from each other.
    """
    if len(turns) < LEAST_POLLS or np.ptp(places) == 0.0:
        return None
    from_first = np.abs(turns - turns[0])
    slope = (places - places.mean()) / np.ptp(places)
    decays = [np.exp(-from_first / over) for over in ENTRY_TURNS if from_first[-1] >= 4.0 * over]
    waves = np.exp(1j * lobes * 2.0 * np.pi * turns)
    of_lobe = [slope * waves.real, slope * waves.imag]
    trends = [*of_lobe, slope, *(each - each.mean() for each in decays)]
    most = min(MOST_ORDER, int((len(turns) / POLLS_A_TERM - 1 - len(trends)) // 2))
    for last in range(most, max(lobes, 2) - 1, -1):
        orders = range(1, last + 1)
        found = fit(harmonic_columns(2.0 * np.pi * turns, orders, *trends), error_um)
        if found.condition < MOST_CONDITION:
            return _estimate_tool_error(found, trends, orders, lobes)
    return None


def _estimate_tool_error(found: Fit, trends: list[Floats], orders: range, lobes: int) -> ToolError:
    left, count = found.residuals, len(found.residuals)
    squares = float(left @ left)
    alike = min(max(float(left[1:] @ left[:-1]) / squares, 0.0), 0.95) if squares > 0.0 else 0.0
    independent = count * (1.0 - alike) / (1.0 + alike)
    wider = math.sqrt(count / independent)

    def se_along(*terms: tuple[int, float]) -> float:
        direction = np.zeros(len(found.coefficients))
        for place, weight in terms:
            direction[place] = weight
        return wider * found.sd_along(direction)

    change, slope = complex(found.coefficients[1], -found.coefficients[2]), 3
    stands_out = abs(change) > WORTH_TELLING * max(se_along((1, 1.0)), se_along((2, 1.0)))
    begins = [(4 + number, float(each[0] - each[-1])) for number, each in enumerate(trends[3:])]
    pairs = {n: harmonic_slice(place, len(trends)) for place, n in enumerate(orders)}
    return ToolError(
        mean_um=float(found.coefficients[0]),
        mean_se_um=se_along((0, 1.0)),
        slope_um=float(found.coefficients[slope]),
        slope_se_um=se_along((slope, 1.0)),
        decay_um=sum(weight * float(found.coefficients[place]) for place, weight in begins),
        decay_se_um=se_along(*begins),
        orders=phasors(found.coefficients, orders, len(trends)),
        orders_se_um={
            n: max(se_along((pair.start, 1.0)), se_along((pair.start + 1, 1.0))) for n, pair in pairs.items()
        },
        polls=count,
        independent=independent,
        lobes=lobes,
        lobe_change_um=change if stands_out else 0j,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CutVerdict:
    """Judgement of a cut, with the figures it rests on.

    `tool` is the error of the actual tool against the path that its program makes, `command` that of its command;
    None if the `polls` do not support them. `round_limit_um` is what the tool may use of the roundness, peak to
    peak, `size_limit_um` of the diameter either way; None if the job has no tolerance of it. `moment` is where
    the command was off its plan in two polls in a row, or far off in one, too short to stand out from the whole.
    A `trimmed` cut was corrected by this console while it ran, so the harmonics of its command are not judged;
    nor are depth and course of a `pushed` one, which the program itself moves against the push of the cut: there
    the tool tells.
    `changes` are what the witness in the controller has seen to change, `unwitnessed` is why it has not seen all.
    """

    tool: ToolError | None = None
    command: ToolError | None = None
    polls: int = 0
    round_limit_um: float = math.inf
    size_limit_um: float | None = None
    trimmed: bool = False
    pushed: bool = False
    moment: Problem | None = None
    changes: tuple[Problem, ...] = ()
    unwitnessed: Problem | None = None

    @property
    def judgement(self) -> CutJudgement:
        """Return the one word for the cut."""
        if self.changes or self.command_problem is not None:
            return CutJudgement.DISTURBED
        if any(True for _ in self.tool_problems):
            return CutJudgement.TOOL_ERROR
        return CutJudgement.AS_PLANNED if self.budget_problem is None else CutJudgement.NOT_PROVEN

    @property
    def proven(self) -> bool:
        """Whether the part can be judged by its measurement."""
        return self.judgement is not CutJudgement.NOT_PROVEN

    @property
    def problems(self) -> tuple[Problem, ...]:
        """The statements about the cut; for a cut as planned only that no witness saw it."""
        found = (*self.changes, *(() if self.command_problem is None else (self.command_problem,)))
        found = (
            found or tuple(self.tool_problems) or (() if self.budget_problem is None else (self.budget_problem,))
        )
        without = self.unwitnessed
        return found if without is None or without in found else (*found, without)

    @property
    def command_problem(self) -> Problem | None:
        """Where the command was furthest off its plan, if that is more than scatter; None while it kept to it."""
        if self.command is None:
            return self.moment
        each = self.command
        off = [(0.0, 0.0, "Ø")]
        if not self.pushed:
            off = [(abs(each.mean_um), each.mean_se_um, "Ø"), (abs(each.slope_um), each.slope_se_um, "Z")]
        if not self.trimmed:
            off += [(abs(um), each.orders_se_um[n], f"{n}/rev") for n, um in each.orders.items()]
        off_um, se_um, where = max(off, key=lambda one: one[0] - 2.0 * WORTH_TELLING * one[1])
        if off_um <= COMMAND_UM + 2.0 * WORTH_TELLING * se_um:
            return self.moment
        limit = f"{COMMAND_UM:g} um"
        return Problem(
            code="cut.command_off_plan", key=AxisName.TOOL, where=where, value=f"{off_um:.2f} um", limit=limit
        )

    @property
    def tool_problems(self) -> Iterator[Problem]:
        """Yield what of the tool's own error is surely beyond its budget."""
        for code, off_um, within_um, limit_um in self._list_limits:
            if off_um - within_um > limit_um:
                value, limit = f"{off_um:.1f} ± {within_um:.1f} um", f"{limit_um:.3g} um"
                yield Problem(code=code, key=AxisName.TOOL, value=value, limit=limit)

    @property
    def budget_problem(self) -> Problem | None:
        """Why the tool is not proven to be within its budget all the time; None if it is.

        A controller without a witness proves as much as its polls do.
        """
        if self.unwitnessed is not None and self.unwitnessed.code == GAP:
            return self.unwitnessed
        if self.tool is None or self.command is None:
            return Problem(code="cut.too_few_polls", value=f"{self.polls}")
        for _, off_um, within_um, limit_um in self._list_limits:
            if off_um + within_um > limit_um:
                value, limit = f"{off_um:.1f} ± {within_um:.1f} um", f"{limit_um:.3g} um"
                return Problem(code="cut.not_proven", key=AxisName.TOOL, value=value, limit=limit)
        return None

    @property
    def _list_limits(self) -> Iterator[tuple[str, float, float, float]]:
        if self.tool is None:
            return
        yield "cut.tool_not_round", self.tool.roundness_um, self.tool.roundness_within_um, self.round_limit_um
        if self.size_limit_um is not None:
            yield "cut.tool_off_size", self.tool.size_um, self.tool.size_within_um, self.size_limit_um

    def event(self) -> dict[str, object]:
        """Return the verdict as JSON and the record have it."""
        return {
            "cut_verdict": self.judgement.value,
            "tool": None if self.tool is None else self._figures(self.tool),
        }

    def _figures(self, tool: ToolError) -> dict[str, object]:
        names = ("mean_um", "mean_se_um", "slope_um", "slope_se_um", "decay_um", "decay_se_um", "polls")
        more = ("roundness_um", "roundness_within_um", "size_um", "size_within_um")
        return {
            **{name: getattr(tool, name) for name in names},
            "independent_polls": tool.independent,
            "orders": [
                {"n": n, "amplitude_um": abs(um), "crest_deg": -math.degrees(cmath.phase(um)) / n, "se_um": se_um}
                for (n, um), se_um in zip(tool.orders.items(), tool.orders_se_um.values(), strict=True)
            ],
            **{name: getattr(tool, name) for name in more},
            "roundness_limit_um": self.round_limit_um,
            "size_limit_um": self.size_limit_um,
        }


NO_VERDICT = CutVerdict()


class ToolPolls:
    """The polls of a cut from a turn after the tool has met the part to the turn in which it retracts."""

    def __init__(self, plan: CutPlan, machine: MachineProfile, job: Job) -> None:
        self._plan, self._machine, self._job = plan, machine, job
        setup = plan.setup
        land = machine.tool.wiper_land_mm * machine.carriage.counts_per_mm
        self._first = setup.carriage_face - 0.5 * land + setup.carriage_per_turn
        self._last = plan.carriage_start + (setup.whole_turns - LAST_TURN) * setup.carriage_per_turn
        self._rows: list[tuple[float, ...]] = []
        self._over, self._trimmed = False, plan.trimmed

    def see(self, snapshot: Snapshot, *, trimmed: bool = False) -> None:
        """Take a poll of the program; `trimmed` by this console, the place of the tool is without that."""
        self._trimmed = self._trimmed or trimmed
        at, tool = snapshot.carriage.commanded_position, snapshot.tool
        self._over = self._over or at > self._last
        if not self._over and at > self._first and snapshot.program_running:
            took_s, middle_s = snapshot.at_s - snapshot.asked_s, 0.5 * (snapshot.at_s + snapshot.asked_s)
            spindle, z = snapshot.spindle, snapshot.carriage.position
            self._rows.append(
                (
                    took_s,
                    middle_s,
                    spindle.position,
                    z,
                    tool.position,
                    tool.commanded_position,
                    spindle.commanded_position,
                )
            )

    @property
    def feed(self) -> tuple[float, float]:
        """Where the carriage is in the polls that count, counts."""
        return self._first, self._last

    def verdict(self, witness: WitnessReport | None = None, *, unheld: bool = True) -> CutVerdict:
        """Return the verdict on the cut as far as it was polled, and the controller's own `witness` has seen it.

        A cut that was not `unheld` has following errors of its feed hold.
        """
        plan, job = self._plan, self._job
        rows = np.array(self._rows).reshape(-1, 7)
        if len(rows):
            rows = rows[rows[:, 0] <= LATE * np.median(rows[:, 0]) + 0.001]
        turns = rows[:, 2] / self._machine.spindle.counts_per_rev
        past_mm = (rows[:, 3] - plan.setup.carriage_middle) / self._machine.carriage.counts_per_mm
        error, command_error, moment = None, None, None
        if len(rows) > 1:
            turns_per_s = (turns[-1] - turns[0]) / (rows[-1, 1] - rows[0, 1])
            infeed_um = (rows[:, 4:6] - plan.setup.surface) * self._machine.tool.count_um
            cycle_deg = 0.36 * turns_per_s * self._machine.controller.servo_period_ms
            if self._machine.spindle.followed and plan.strategy.traits.inverts:
                turns = turns + self._skew_turns(turns, infeed_um[:, 1], cycle_deg)
            ordered = rows[:, 6] / self._machine.spindle.counts_per_rev if self._turns_spindle else turns
            path_um, command_um = self._planned_positions(turns, ordered, past_mm, cycle_deg)
            error = fit_tool_error(turns, past_mm, infeed_um[:, 0] - path_um, job.jaws)
            command_error = fit_tool_error(ordered, past_mm, infeed_um[:, 1] - command_um, job.jaws)
            moment = self._moment(infeed_um[:, 1] - command_um, rows[:, 3], turns, cycle_deg)
        size_um = job.diameter_tolerance_um
        return CutVerdict(
            tool=error,
            command=command_error,
            polls=len(rows),
            round_limit_um=BUDGET["tool"] * job.roundness_tolerance_um,
            size_limit_um=None if size_um is None else BUDGET["tool"] * size_um,
            trimmed=self._trimmed,
            pushed=bool(plan.command.push_um),
            moment=moment,
            changes=() if witness is None else tuple(self._changes(witness, rows, unheld=unheld)),
            unwitnessed=None if witness is None else witness.missing or witness.gap,
        )

    def _moment(self, off_um: Floats, carriage: Floats, turns: Floats, cycle_deg: float) -> Problem | None:
        """Return where a command was furthest off its plan, by the lesser of two neighbouring polls; None nowhere.

        They are neighbours in time, or at the angle of the spindle, as where a column of a table is another one.
        One poll alone may have read the axes in two servo cycles, so it is off by more than the path is then.
        A command that this console itself corrects, or moves against the push of the cut, is on no such plan.
        """
        command = self._plan.command
        if self._trimmed or command.push_um:
            return None
        by_time, alone_um = np.arange(len(turns)), np.abs(off_um)
        pairs = np.hstack([(order[1:], order[:-1]) for order in (by_time, np.argsort(turns % 1.0))])
        cycle_um = command.lobes * command.largest_um * math.radians(abs(cycle_deg))
        usual_um = TIMES_USUAL * float(np.median(np.abs(np.diff(off_um))))
        face, per_mm = self._plan.setup.carriage_face, self._machine.carriage.counts_per_mm
        for each_um, polls, least_um in (
            (alone_um[pairs].min(axis=0), pairs[0], COMMAND_UM),
            (alone_um, by_time, LEAST_TOOL_UM + cycle_um),
        ):
            worst, limit_um = int(each_um.argmax()), max(least_um, usual_um)
            if each_um[worst] > limit_um:
                where = f"{(carriage[polls[worst]] - face) / per_mm:.1f} mm"
                value, limit = f"{each_um[worst]:.2f} um", f"{limit_um:.2g} um"
                return Problem(code="cut.off_path", key=AxisName.TOOL, where=where, value=value, limit=limit)
        return None

    def _changes(self, witness: WitnessReport, rows: Floats, *, unheld: bool) -> Iterator[Problem]:
        """Judge what the witness has seen by the table in use, and by the following errors of the polls."""
        um, following, correction = self._machine.tool.count_um, None, None
        if unheld and len(rows) >= LEAST_POLLS:
            errors_um = um * (rows[:, 5] - rows[:, 4])
            following = float(errors_um.min()), float(errors_um.max())
        if self._plan.program.tables:
            entries = [entry for table in self._plan.program.tables for entry in (0, *table.entries)]
            correction = um * min(entries) / PARTS_PER_COUNT, um * max(entries) / PARTS_PER_COUNT
        yield from witness.changes(correction, following)

    def _late_deg(self, cycle_deg: float) -> float:
        """Return by how much a controller that reads the spindle a servo cycle before is late with the command."""
        plan = self._plan
        late = plan.clock is not None or (plan.table is not None and source_is_late(plan.table, 0))
        return cycle_deg * late

    def _skew_turns(self, turns: Floats, commanded_um: Floats, cycle_deg: float) -> float:
        """Return how many turns too low a spindle that others turn is polled, by the command; 0 beyond any skew.

        Its angle is not of the servo cycle of the other axes. What is more than that is left to be judged.
        """
        path, lobes = self._plan.command.turn_by(self._late_deg(cycle_deg)), self._plan.command.lobes
        found = fit(harmonic_columns(2.0 * np.pi * turns, (lobes,)), commanded_um)
        expected = path.harmonics[0].coefficient
        if not expected:
            return 0.0
        skew_deg = math.degrees(cmath.phase(phasors(found.coefficients, (lobes,))[lobes] / expected)) / lobes
        return skew_deg / 360.0 if abs(skew_deg) <= MOST_SKEW_CYCLES * abs(cycle_deg) else 0.0

    @property
    def _turns_spindle(self) -> bool:
        """Whether the program itself commands the spindle, and does not follow it by a table or its time."""
        plan = self._plan
        return plan.table is None and plan.clock is None and not self._machine.spindle.followed

    def _planned_positions(
        self, turns: Floats, ordered: Floats, past_mm: Floats, cycle_deg: float
    ) -> tuple[Floats, Floats]:
        """Return where the plan has the tool and its command at each poll, um of infeed.

        The part is made by the angle of the spindle, the command by the one `ordered`: a spindle of uneven speed
        leaves the tool off its path, while the command keeps to the plan. A program that does not invert the servo
        makes a path of its own, which is that of the modelled servo.
        """
        plan, machine, angle_deg, command_deg = self._plan, self._machine, 360.0 * turns, 360.0 * ordered
        if not plan.strategy.traits.inverts:
            made = predict(self._job, machine, plan)
            path_um = np.interp(angle_deg, made.angle_deg, made.path_um, period=360.0)
            return path_um, np.interp(command_deg, made.angle_deg, made.command_um, period=360.0)
        command_deg = command_deg - self._late_deg(cycle_deg)
        return plan.target.at_um(angle_deg, past_mm), plan.command.at_um(command_deg, past_mm)
