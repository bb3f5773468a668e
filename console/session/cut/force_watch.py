"""Check of sign and angle by the force of a half-stage cut: gathered beside it, judged after it. Nothing moves.

A cut of which nothing can be gathered is cut as any: the check then says why it says nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from console.session.stages import Stage
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import Batch
from drivers.errors import DriverError, LinkTimeoutError
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from profiles.chucking.held_part import held_part
from profiles.compensations.force_null import (
    FULL_CHIP_TURNS,
    ExpectedForce,
    ForceNull,
    ForceNullReason,
    ForceRecord,
    force_null,
    unknown,
)
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import ProfileError

AIR_TURNS, CUT_TURNS = 5.0, 6.0  # gathered before the face, and with a full chip; a choice
START_S = 0.15  # between two polls, and until the controller has begun
MOST_SAMPLES = 6000  # three long words each; beyond them not every servo cycle is sampled
WORDS_AT_REST = 128  # long words between two polls after the cut: half a second at 38 400 baud
MOST_FETCH_S = 40.0  # after the cut, at most; a slower line tells nothing
LOST = "gather.failed"  # the one problem that only ends the check


class ForceWatch:
    """Gather tool, spindle and thrust from before the face of the part on, and judge them after the cut."""

    def __init__(self, lathe: Lathe, job: Job) -> None:
        self._lathe, self._job = lathe, job
        self._gather = lathe.program.batches()
        self._plan: CutPlan | None = None
        self._batch: Batch | None = None
        self._failed = False

    def begin(self, plan: CutPlan) -> None:
        """Set up gathering on the controller, at rest."""
        self._plan, setup = plan, plan.setup
        machine = self._lathe.machine
        turn_s = 60.0 / plan.spindle_speed_rpm
        cycle_s = machine.controller.servo_period_ms / 1000.0
        land_turns = 0.5 * machine.tool.wiper_land_mm * machine.carriage.counts_per_mm / setup.carriage_per_turn
        clear_turns = setup.turns_clear - land_turns
        air_turns = min(clear_turns, AIR_TURNS + START_S / turn_s)
        seconds = (air_turns + FULL_CHIP_TURNS + CUT_TURNS) * turn_s
        period = max(1, math.ceil(seconds / cycle_s / MOST_SAMPLES))
        first = setup.carriage_start + (clear_turns - air_turns) * setup.carriage_per_turn
        self._try_step(
            lambda: self._gather.prepare(
                plan, math.floor(turn_s / (period * cycle_s)), seconds, self._take, thrust=True, from_counts=first
            )
        )

    def see(self, snapshot: Snapshot) -> None:
        """Begin and end the gathering, between two polls.

        Nothing is fetched in the cut: fewer polls would judge it, and a short one would be refused for that.
        """
        if self._plan is not None and not self._failed and not self._gather.fetching:
            self._try_step(lambda: self._gather.see(snapshot))

    def result(self) -> ForceNull:
        """Fetch the rest, with a poll before each piece, and judge it; the machine rests.

        Raises DriverError: the link broke; StoppedError: somebody stopped the machine.
        """
        now_s = self._lathe.snapshot().at_s
        until_s = now_s + MOST_FETCH_S
        while self._batch is None and not self._failed and self._gather.fetching and now_s < until_s:
            now_s = self._lathe.snapshot().at_s
            self._lathe.stop.check()
            self._try_step(lambda: self._gather.fetch_at_rest(WORDS_AT_REST))
        if self._plan is None:
            return unknown(self._job.jaws, ForceNullReason.NOT_GATHERED)
        self._gather.give_back()
        if self._batch is None:
            return unknown(self._plan.target.lobes, ForceNullReason.NOT_GATHERED)
        return judge_force_window(self._batch, self._plan, self._job, self._lathe.machine)

    def _take(self, batch: Batch) -> None:
        self._batch = batch

    def _try_step(self, work: Callable[[], None]) -> None:
        """Do a step of the gathering; a controller that does not gather ends the check, and not the cut."""
        try:
            work()
        except LinkTimeoutError:  # whether the link is lost, the next poll tells
            self._failed = True
        except DriverError as error:
            if error.problems[0].code != LOST:
                raise
            self._failed = True


def judge_force_window(batch: Batch, plan: CutPlan, job: Job, machine: MachineProfile) -> ForceNull:
    """Return what a gathered half-stage cut says of sign and angle."""
    lobe = plan.target.harmonics[0]
    past_mm = (plan.setup.carriage_face - plan.setup.carriage_middle) / machine.carriage.counts_per_mm
    grown = float(plan.target.along.factor(lobe.lobes, past_mm))
    record = ForceRecord(
        angle_deg=batch.angle_deg, infeed_um=batch.infeed_um, thrust_n=batch.thrust_n, face_deg=batch.face_deg
    )
    return force_null(
        record,
        ExpectedForce(
            lobes=lobe.lobes,
            whole_um=grown * lobe.coefficient / Stage.PARTIAL.fraction,
            passive_n=_passive_n(job, machine),
            mass_kg=machine.tool.moving_mass_kg,
            damping_n_s_per_m=machine.tool.damping_n_s_per_m,
            cycle_s=machine.controller.servo_period_ms / 1000.0,
            turns_hz=plan.spindle_speed_rpm / 60.0,
        ),
    )


def _passive_n(job: Job, machine: MachineProfile) -> float:
    """Return the predicted force on the tool; 0 where nothing is known of the material."""
    try:
        return held_part(job, machine).force.passive_n
    except ProfileError:
        return 0.0
