"""What a measured part asks for: whether it passes, what is left of its lobe, and what may be kept of it. Pure."""

from __future__ import annotations

from dataclasses import replace

from console.session.learning.calibrating import PartLobe
from console.session.learning.learning_steps import LearningOutcome
from console.session.learning.part_learning import PartLearning
from console.session.station.state import MeasuredPart, StationState
from console.session.work import Work
from drivers.cutting.strategy import Strategy
from profiles.compensations.hypotheses import LatheFault
from profiles.metrology.conformity import ToleranceKind, passes_all
from profiles.metrology.length_causes import LengthCause, LengthCauseKind, causes_of_failure
from profiles.problem import Problem
from profiles.trace_files.header import GAUGE_ERROR

ELSEWHERE = "learned.lobe_elsewhere"
MARK_REACH_MM = 0.35  # to either side of a mark: half a land of 0.4 mm, and some way of the carriage. A choice.


def fails(part: MeasuredPart) -> bool:
    """Whether a part is not round over its length; one with half its compensation is not judged, nor a size."""
    form = (each for each in part.judged if each.kind is not ToleranceKind.DIAMETER)
    return not part.is_half and passes_all(form) is False


def causes_along(part: MeasuredPart) -> tuple[LengthCause, ...]:
    """Return why its sections differ; of a part that fails, what explains that: a stop in that section alone.

    Nothing of a single section.
    """
    if part.whole is None:
        return ()
    failed = ((each.z_mm, each.value_um) for each in part.judged if each.passes is False)
    marks_mm = [part.job.overhang_mm - mark_mm for mark_mm in part.marks_mm]
    for z_mm, value_um in failed:
        if z_mm is not None and any(abs(z_mm - mark_mm) <= MARK_REACH_MM for mark_mm in marks_mm):
            return (LengthCause(kind=LengthCauseKind.MARK, um_pp=abs(value_um or 0.0), first_mm=z_mm),)
    return causes_of_failure(part.whole.causes, part.judged)


def is_elsewhere(taught: LearningOutcome) -> bool:
    """Whether the lobe is not where it is expected: the set-up is to be checked before anything is kept."""
    return any(warning.code == ELSEWHERE for warning in taught.warnings)


def jaw_explains(learning: PartLearning) -> bool:
    """Whether jaw 1 elsewhere is the likeliest: found again, it must not be corrected as well."""
    found = learning.faults.diagnosis
    return found is not None and found.best.fault is LatheFault.ANGLE


def fails_in_mark(part: MeasuredPart) -> bool:
    """Whether a part fails by the mark of a stop alone: its other sections are round, and it teaches nothing."""
    along, limit_um = causes_along(part) if fails(part) else (), part.job.roundness_tolerance_um
    marked = {each.first_mm for each in along if each.kind is LengthCauseKind.MARK}
    others = () if part.whole is None else (each for each in part.whole.sections if each.z_mm not in marked)
    return bool(marked) and all(each.ront_um <= limit_um for each in others)


def is_kept(learning: PartLearning | None, work: Work | None) -> bool:
    """Whether the next cut uses this part's learning step."""
    used = None if work is None else work.compensation
    if learning is None or learning.taught is None or used is None:
        return False
    return used == replace(learning.taught.step.next, version=used.version)


def in_scatter(taught: LearningOutcome) -> bool:
    """Whether the remaining lobe is within the scatter of clamping and gauge."""
    lobe = taught.step.next.path.target.lobes
    wrong = [abs(each.left_um_pp - each.expected_um_pp) for each in taught.harmonics if each.order == lobe]
    return max(wrong, default=0.0) < taught.step.expected_half_width_um_pp


def is_taken(lobe: PartLobe | None, work: Work | None) -> bool:
    """Whether the open job has the lobe of this part."""
    if lobe is None or lobe.found is None or work is None:
        return False
    job, found = work.job, lobe.found
    return (job.lobe_error_source, job.lobe_error_um_pp) == ("fitted", found.fit.error_um_pp)


def follows_lobe(work: Work | None) -> bool:
    """Whether the next cut of the open job is compensated; who has chosen a plain one keeps it."""
    return work is not None and Strategy(work.strategy).traits.follows_lobe


def why_not_accepted(part: MeasuredPart | None, work: Work | None) -> tuple[Problem, ...]:
    """Return why nothing of a part can be kept for this work; `accept` may still find an older version in the way.

    Nothing is read.
    """
    if part is not None and part.lobe is not None:
        return _why_no_lobe(part.lobe, part.job.name, work)
    learning = None if part is None else part.learning
    if part is None or learning is None:
        return (Problem(code="learned.no_part"),)
    if learning.taught is None:
        return learning.problems
    holds_for = learning.taught.step.next.holds_for
    if work is None or (work.loaded.job.name, work.loaded.sha256) != (holds_for.job, holds_for.job_sha256):
        return (Problem(code="learned.other_job", key=part.job.name),)
    return edited_problems(work) or learning.reasons


def _why_no_lobe(lobe: PartLobe, name: str, work: Work | None) -> tuple[Problem, ...]:
    if is_taken(lobe, work):
        return (Problem(code="lobe.taken", key=name),)
    if lobe.reasons:
        return tuple(lobe.reasons)
    filed = lobe.loaded
    if work is None or filed is None or (work.loaded.path, work.loaded.sha256) != (filed.path, filed.sha256):
        return (Problem(code="learned.other_job", key=name),)
    return edited_problems(work)


def why_not_reverted(work: Work | None) -> tuple[Problem, ...]:
    """Return why there is no version to go back to. Nothing is read."""
    if work is None:
        return (Problem(code="screen.nothing_to_cut"),)
    if work.compensation is None or work.compensation.is_model:
        return edited_problems(work) or (Problem(code="learned.no_before", key=work.loaded.job.name),)
    return edited_problems(work)


def edited_problems(work: Work) -> tuple[Problem, ...]:
    """Return why nothing is learned of this work: it was edited, and what is kept is of a file."""
    return (Problem(code="learned.edited_now", key=work.loaded.job.name),) if work.edited else ()


def run_id_of(state: StationState) -> str | None:
    """Return the run of the measured part; None without one."""
    part = state.measured or state.form
    return None if part is None else part.run_id


def turning_decides(part: MeasuredPart) -> bool:
    """Whether a figure is open since the spindle error of its gauge is unknown, which a second placement shows."""
    rows = () if part.budget is None else part.budget.rows
    unknown = any(each.source == "spindle" and each.roundness_um is None for each in rows)
    return unknown and GAUGE_ERROR not in part.trace.meta and any(each.is_open for each in part.judged)
