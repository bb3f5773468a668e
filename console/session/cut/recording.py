"""Recording of a cut: telemetry from its status polls, and its measured part."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from console.session.cut.cut_verdict import CutVerdict
from console.session.cut.telemetry import PHASE_SAMPLES, Floats, phase_of
from console.session.data.measured_part import (
    CYLINDRICITY_LIMIT,
    SECTION_Z,
    UNCERTAINTY,
    RecordedPart,
    result_data,
)
from console.session.data.run_log import Poll, RunLog
from console.session.stages import Stage
from drivers.cutting.planning import CutPlan
from drivers.cutting.sampling import Batch
from drivers.lathe.snapshot import Snapshot
from profiles.job import Job
from profiles.lobe.cut_error import middle_mm
from profiles.machine import MachineProfile
from profiles.metrology.cylindricity import CylinderResult, PartSection, cylinder_event
from profiles.metrology.turns import mean_diameter_mm
from profiles.metrology.uncertainty import UncertaintyBudget
from profiles.metrology.unrolled import unroll
from profiles.roundness import RoundnessResult
from profiles.trace_files.header import header_of
from profiles.traces import Trace, trace_content

PERIOD_S = 0.1
"""Longest time between two rows of telemetry where polls come that often; each poll that is late makes a row."""

PHASE_POLLS = 3 * PHASE_SAMPLES
SPEED_S = 1.0  # averaging time of the speed: the time of a single poll is known to some ms only


TRIAL_BAND = "trial_band"  # key of a part's record, and of a row's part in JSON


class CutRecorder:
    """Receives the events of the cuts of one machine and keeps nothing: for cuts outside a recorded run."""

    def part(self, name: str, *, product: bool) -> None:
        """Name the cuts that follow; one for comparison is no `product`."""

    def begin(self, plan: CutPlan, job: Job, machine: MachineProfile) -> None:
        """Begin a cut, whose program is about to start."""

    def see(self, snapshot: Snapshot) -> None:
        """Take a status poll of the program."""

    def end(self) -> None:
        """End the cut, however it ended."""

    def record_verdict(self, verdict: CutVerdict) -> None:
        """Take the verdict on the cut that has ended."""

    def record_window(self, batch: Batch) -> None:
        """Take a window that the controller has sampled."""

    def record_band(self, event: Mapping[str, object]) -> None:
        """Take what a trial band has shown, which goes with the part that it is on."""

    def record_measured_part(
        self,
        job: Job,
        trace: Trace,
        whole: CylinderResult | None,
        sections: Sequence[PartSection],
        budget: UncertaintyBudget | None,
    ) -> None:
        """Take the part of the last cut, its middle and the whole. It may wait; SessionError `record.lost`."""


class LogRecorder(CutRecorder):
    """Pass the polls of each cut to the log of its run, and its part to `keep`, named as for `part_record`."""

    def __init__(self, log: RunLog, keep: Callable[..., None] = lambda *_, **__: None) -> None:
        self._log, self._keep = log, keep
        self._name, self._product, self._proven = "", True, True
        self._band: dict[str, object] = {}

    def part(self, name: str, *, product: bool) -> None:
        """Name the cuts that follow."""
        self._name, self._product, self._proven = name, product, True

    def begin(self, plan: CutPlan, job: Job, machine: MachineProfile) -> None:
        """Begin the telemetry of a cut."""
        self._log.begin_cut(self._name, TelemetryRows(plan, job, machine))

    def see(self, snapshot: Snapshot) -> None:
        """Add a poll as numbers; the log's thread computes the rest."""
        tool, spindle = snapshot.tool, snapshot.spindle
        polled = (snapshot.at_s, tool.position, spindle.position, snapshot.carriage.position, tool.following_error)
        self._log.poll(polled)

    def end(self) -> None:
        """End the telemetry of the cut."""
        self._log.end_cut()

    def record_verdict(self, verdict: CutVerdict) -> None:
        """Note whether the part of this cut can be judged."""
        self._proven = verdict.proven

    def record_window(self, batch: Batch) -> None:
        """Add a gathered window."""
        past_mm = np.full_like(batch.infeed_um, batch.past_middle_mm)
        self._log.add_window(self._name, np.column_stack([batch.angle_deg / 360.0, past_mm, batch.infeed_um]))

    def record_band(self, event: Mapping[str, object]) -> None:
        """Keep it for the part."""
        self._band = {TRIAL_BAND: dict(event)}

    def record_measured_part(
        self,
        job: Job,
        trace: Trace,
        whole: CylinderResult | None,
        sections: Sequence[PartSection],
        budget: UncertaintyBudget | None,
    ) -> None:
        """Keep the part of the last cut."""
        band, self._band = self._band, {}
        more = {**band, SECTION_Z: middle_mm(job), **form_event(whole, sections), **budget_event(budget)}
        self._keep(job, trace, part=self._name, product=self._product, proven=self._proven, more=more)


def form_event(whole: CylinderResult | None, sections: Sequence[PartSection]) -> dict[str, object]:
    """Return the form of a part over its length for the record, and its sections as they are drawn."""
    drawn = {} if whole is None else unroll(sections, whole.filter_upr).event()
    return {**cylinder_event(whole), **drawn}


def budget_event(budget: UncertaintyBudget | None) -> dict[str, object]:
    """Return the uncertainty of a part for records and results in JSON; nothing without a gauge."""
    return {} if budget is None else {UNCERTAINTY: budget.event()}


class TelemetryRows:
    """Turn the polls of one cut into rows of `TELEMETRY_COLUMNS`, ten or more a second of machine time."""

    def __init__(self, plan: CutPlan, job: Job, machine: MachineProfile) -> None:
        self._plan, self._machine = plan, machine
        end = plan.carriage_start + plan.setup.carriage_counts
        self._face = end - job.cut_length_mm * machine.carriage.counts_per_mm
        self._begun: Poll | None = None
        self._last_s = -np.inf
        self._polls: deque[Poll] = deque(maxlen=4 * PHASE_POLLS)
        self._follows = plan.strategy.traits.follows_lobe

    def __call__(self, polls: Sequence[Poll]) -> Floats:
        """Return the rows of some polls, in order; shape (M, 7), M may be 0."""
        rows = []
        for poll in polls:
            self._begun = self._begun or poll
            self._polls.append(poll)
            # A poll late: polls come in steps of their own, and no row may be further apart than the period.
            step_s = poll[0] - self._polls[-2][0] if len(self._polls) > 1 else 0.0
            if poll[0] - self._last_s >= PERIOD_S - step_s:
                self._last_s = poll[0]
                rows.append(self._row(poll, self._begun))
        return np.array(rows, dtype=np.float64).reshape(-1, 7)

    def _row(self, poll: Poll, begun: Poll) -> tuple[float, ...]:
        machine, plan = self._machine, self._plan
        at_s, tool, spindle, carriage, following = poll
        per_turn = machine.spindle.counts_per_rev
        infeed_um = (tool - plan.setup.surface) * machine.tool.count_um
        past_mm = (carriage - plan.setup.carriage_middle) / machine.carriage.counts_per_mm
        error_um = infeed_um - float(plan.target.at_um(360.0 * spindle / per_turn, past_mm))
        return (
            at_s - begun[0],
            (spindle - begun[2]) / per_turn,
            (carriage - self._face) / machine.carriage.counts_per_mm,
            self._speed_rpm(),
            error_um,
            self._phase_deg() if infeed_um > 0.0 else np.nan,
            following * machine.tool.count_um,
        )

    def _speed_rpm(self) -> float:
        """Return the mean speed of the last second."""
        now = self._polls[-1]
        before = next(poll for poll in self._polls if poll[0] >= now[0] - SPEED_S)
        turns = (now[2] - before[2]) / self._machine.spindle.counts_per_rev
        return 60.0 * turns / (now[0] - before[0]) if now[0] > before[0] else np.nan

    def _phase_deg(self) -> float:
        """Return the phase lag of the tool in spindle degrees, NaN with too few polls in the part."""
        if not self._follows:
            return np.nan
        polls = np.array(self._polls, dtype=np.float64)[-PHASE_POLLS:]
        infeed_um = (polls[:, 1] - self._plan.setup.surface) * self._machine.tool.count_um
        if infeed_um[0] <= 0.0:
            return np.nan
        angle_deg = 360.0 * polls[:, 2] / self._machine.spindle.counts_per_rev
        found = phase_of(np.column_stack([angle_deg, infeed_um]), self._plan.target)
        return np.nan if found is None else found.error_deg


def part_record(
    job: Job,
    result: RoundnessResult,
    trace: Trace,
    stage: Stage,
    *,
    part: str = "",
    product: bool = True,
    proven: bool = True,
    made: Mapping[str, str] | None = None,
    file: tuple[str, bytes] | None = None,
    more: Mapping[str, object] | None = None,
) -> RecordedPart:
    """Return a measured part for the record; if its cut is not `proven`, it is not judged.

    `file` is the name and the bytes of an imported trace; without one the trace is kept as `console run --part`
    would write it, with `made`, how the part was cut, in its header. `more` is added to the figures.
    """
    diameter_mm = mean_diameter_of(trace, result)
    judged = product and proven and stage is Stage.FULL
    with_made = replace(trace, meta={**trace.meta, **(made or {})})
    kept = RecordedPart(
        part=part,
        product=product,
        ront_um=result.ront_um,
        tolerance_um=job.roundness_tolerance_um,
        diameter_mm=diameter_mm,
        nominal_diameter_mm=job.finished_diameter_mm,
        diameter_tolerance_um=job.diameter_tolerance_um,
        lobe_um_pp=2.0 * result.amplitude_um(job.jaws),
        data={**result_data(result), CYLINDRICITY_LIMIT: job.cylindricity_tolerance_um, **(more or {})},
        trace=trace_content(with_made) if file is None else file[1],
        trace_name=None if file is None else file[0],
    )
    return replace(kept, passed=kept.is_good if judged else None)


def mean_diameter_of(trace: Trace, result: RoundnessResult) -> float | None:
    """Return the mean diameter; None if the trace does not state the radius of zero deviation."""
    header, _ = header_of(trace.meta)
    if header.radius_mm is None or header.size == "relative":
        return None
    return mean_diameter_mm(header.radius_mm, result.mean_deviation_um)
