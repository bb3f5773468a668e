"""The decision tables of the guide: in each situation the first row that applies is the next step.

A word is PAGE.NAME, and its sentence `PAGE_page.next.NAME` of the catalogues. A key is an action of the keymap,
None if there is nothing to do but to wait. The last row of a table always applies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from console.session.cut.alignment import AlignStep, force_problems
from console.session.cut.jaw_by_indicator import READINGS
from console.session.guide.measured_part import (
    fails,
    fails_in_mark,
    follows_lobe,
    is_elsewhere,
    is_kept,
    is_taken,
    jaw_explains,
    turning_decides,
)
from console.session.guide.situation import GuidePhase, Situation, phase_of
from console.session.guide.start_checks import is_over
from console.session.guide.waiting import waiting
from console.session.stages import Stage
from console.session.station import commands as do
from console.session.station.progress import CutStage
from console.session.station.state import Activity, MeasuredPart
from drivers.cutting.feed_hold import HoldState
from profiles.metrology.conformity import passes_all

Condition = Callable[[Situation], bool]


@dataclass(frozen=True, slots=True)
class Row:
    """One step: its word, when it is the next one, its key, and the command of the key where it has one."""

    word: str
    when: Condition
    key: str | None = None
    command: type[do.Command] | None = None

    @property
    def sentence(self) -> str:
        """The key of its sentence in the catalogues."""
        page, _, name = self.word.partition(".")
        return f"{page}_page.next.{name}"


def row_of(table: tuple[Row, ...], now: Situation) -> Row:
    """Return the first row of a table that applies."""
    return next(row for row in table if row.when(now))


def _rows_under_condition(condition: Condition, *rows: Row) -> tuple[Row, ...]:
    """Return rows that apply only under a condition that they have in common."""

    def both(row: Row) -> Condition:
        return lambda s: condition(s) and row.when(s)

    return tuple(replace(row, when=both(row)) for row in rows)


def is_always_due(_: Situation) -> bool:
    """Whether there is nothing to ask for."""
    return True


def at_step(*steps: AlignStep | None) -> Condition:
    """Return the condition that the present step of the alignment is one of these, None: all are done."""
    return lambda s: s.step in steps


def _part(also: Callable[[MeasuredPart, Situation], bool]) -> Condition:
    return lambda s: s.state.measured is not None and also(s.state.measured, s)


def _made_worse(part: MeasuredPart) -> bool:
    return part.learning is not None and bool(part.learning.faults.worse)


def _waits(word: str) -> Condition:
    return lambda s: waiting(s.state) == word


def _in_stage(*stages: CutStage) -> Condition:
    return lambda s: s.state.cut is not None and s.state.cut.stage in stages


def _fails(name: str) -> Condition:
    return lambda s: s.first_failed == name


def _is_scratched(s: Situation) -> bool:
    return s.state.seen is not None and s.state.seen.in_scratch


def _in_air(s: Situation) -> bool:
    return s.state.cut is not None and s.state.cut.in_air


def _form_fails(s: Situation) -> bool:
    return s.state.form is not None and s.state.form.passes is False


_HALF = _part(lambda part, _: part.is_half)
_TAKEN = _part(lambda part, s: is_taken(part.lobe, s.work))
_HAS_LOBE = _part(lambda part, _: part.lobe is not None and not part.lobe.reasons)
_KEPT = _part(lambda part, s: is_kept(part.learning, s.work))
_OFF_SIZE = _part(lambda part, _: part.diameter_passes is False)
_WRONG = _part(lambda part, s: s.state.force is not None and s.state.force.contradicts(part.job) is not None)

ALIGN_STEPS = (
    Row("align.no_job", lambda s: s.job is None and s.step is None, "page.jobs"),
    *_rows_under_condition(
        lambda s: s.step is AlignStep.CLAMP and s.must_come_out,
        Row("align.table_clear", lambda s: s.clears_tables, "run.retract", do.ClearTables),
        Row("align.table_kill", lambda s: s.kills_tables, "align.off", do.DisableDrives),
        Row("align.table_off", lambda s: s.tables_on and s.loops_closed, "run.retract", do.Retract),
        Row("align.jog_out", lambda s: s.loops_closed, "align.enable"),
        Row("align.switch_on_to_table_off", lambda s: s.tables_on, "align.step", do.EnableDrives),
        Row("align.switch_on_to_jog_out", is_always_due, "align.step", do.EnableDrives),
    ),
    *_rows_under_condition(
        lambda s: s.step is AlignStep.CLAMP and s.drives_on,
        Row("align.clamp_drives_on", lambda s: not s.ended_early or s.at_home, "align.step", do.DisableDrives),
        Row("align.clamp_left_on_unhomed", lambda s: s.homes_first, "align.step", do.Home),
        Row("align.clamp_left_on", is_always_due, "run.retract", do.Retract),
    ),
    *_rows_under_condition(
        at_step(AlignStep.CLAMP),
        Row("align.clamp_left", lambda s: s.ended_early and s.alignment.homed, "align.step", do.EnableDrives),
        Row("align.clamp_left_unhomed", lambda s: s.ended_early, "align.step", do.EnableDrives),
        Row("align.clamp_refused", lambda s: s.job is not None and bool(force_problems(s.job)), "page.setup"),
    ),
    *_rows_under_condition(
        at_step(AlignStep.JAW),
        Row("align.jaw_flanks_all", lambda s: len(s.alignment.flanks) >= READINGS, "align.take", do.TakeJaw),
        Row("align.jaw_flanks", lambda s: bool(s.alignment.flanks), "align.flank", do.TakeFlank),
        Row("align.jaw_enable", lambda s: not s.state.jog_enabled, "align.enable"),
    ),
    *_rows_under_condition(
        at_step(AlignStep.TOUCH_OFF, None),
        Row("align.skimmed", lambda s: s.alignment.skim_counts is not None, "align.skim", do.TakeTouchOff),
    ),
    *_rows_under_condition(
        lambda s: s.step is AlignStep.TOUCH_OFF and s.over_part,
        Row("align.touch_off_scratched", _is_scratched, "align.out", do.Jog),
        Row("align.touch_off_touching", lambda s: s.touches, "align.take", do.TakeTouchOff),
        Row("align.touch_off_over_enable", lambda s: not s.state.jog_enabled, "align.enable"),
        Row("align.touch_off_over", is_always_due, "align.in", do.Jog),
    ),
    Row("align.jaw_off", lambda s: s.step is None and s.jaw_off, "align.back", do.Forget),
    Row("align.verify", at_step(AlignStep.VERIFY), "align.step", do.Verify),
    Row("align.clamp", at_step(AlignStep.CLAMP), "align.take", do.ConfirmClamping),
    Row("align.drives", at_step(AlignStep.DRIVES), "align.step", do.EnableDrives),
    Row("align.home", at_step(AlignStep.HOME), "align.step", do.Home),
    Row("align.jaw", at_step(AlignStep.JAW), "align.take", do.TakeJaw),
    Row("align.touch_off", at_step(AlignStep.TOUCH_OFF), "align.step", do.Approach),
    Row("align.valid", is_always_due, "page.run"),
)

ALIGN = (
    Row("align.stopped", _waits("stopped"), "recover", do.Recover),
    Row("align.observing", _waits("observing"), "take_over", do.TakeControl),
    *(Row(f"align.{word}", _waits(word)) for word in ("lost", "stopping", "connecting", "moving", "busy")),
    *ALIGN_STEPS,
)

RUN = (
    *_rows_under_condition(
        lambda s: phase_of(s.state) is GuidePhase.STOPPED,
        Row("run.stopped", lambda s: waiting(s.state) == "stopped", "recover", do.Recover),
        Row("run.stopping", is_always_due),
    ),
    *_rows_under_condition(
        lambda s: phase_of(s.state) is GuidePhase.CUTTING,
        Row("run.positioning", _in_stage(CutStage.POSITION)),
        Row("run.retracting", _in_stage(CutStage.RETRACT)),
        Row("run.holding", lambda s: s.state.cut is not None and s.state.cut.holding),
        Row("run.paused", _in_stage(CutStage.PAUSED), "run.start", do.ResumeFeed),
        Row("run.run_up", _in_stage(CutStage.RUN_UP)),
        Row("run.returning", lambda s: s.feed_hold is HoldState.COMES_IN),
        Row("run.hold_asked", lambda s: s.feed_hold is not None),
        Row("run.cutting", is_always_due),
    ),
    Row("run.armed", lambda s: s.state.armed is not None, "run.start", do.Start),
    Row("run.loading", lambda s: s.state.loading_until_s is not None),
    Row("run.taken_out", lambda s: s.state.activity is Activity.RETRACTING),
    Row("run.moves", lambda s: s.state.activity is not Activity.READY and s.state.moving),
    Row("run.wait", lambda s: s.state.activity is not Activity.READY),
    *_rows_under_condition(
        lambda s: phase_of(s.state) is GuidePhase.ENDED and is_over(s.state),
        Row("run.measured", lambda s: not s.state.cut_done, "page.inspect"),
        Row("run.measure", lambda s: s.state.simulated, "page.inspect"),
        Row("run.take_out", is_always_due, "align.off", do.DisableDrives),
    ),
    *_rows_under_condition(
        lambda s: s.tables_on,
        Row("run.table_clear", lambda s: s.clears_tables, "run.retract", do.ClearTables),
        Row("run.table_kill", lambda s: s.kills_tables, "align.off", do.DisableDrives),
        Row("run.table_off", lambda s: s.loops_closed, "run.retract", do.Retract),
        Row("run.switch_on", is_always_due, "align.step", do.EnableDrives),
    ),
    *_rows_under_condition(
        lambda s: s.left_in_part,
        Row("run.home_out", lambda s: not s.alignment.homed and s.loops_closed, "align.step", do.Home),
        Row("run.home_out_off", lambda s: not s.alignment.homed, "align.step", do.EnableDrives),
        Row(
            "run.switch_on", lambda s: s.in_part is not False and not s.loops_closed, "align.step", do.EnableDrives
        ),
        Row("run.retract", lambda s: s.in_part is True, "run.retract", do.Retract),
        Row("run.retract_unknown", lambda s: s.in_part is None, "run.retract", do.Retract),
    ),
    Row("run.no_job", lambda s: s.work is None, "page.jobs"),
    Row("run.set_up", _fails("job"), "page.setup"),
    Row("run.choose", _fails("learned"), "page.preview"),
    Row("run.commission", _fails("commissioned"), "messages"),
    Row("run.align", lambda s: bool(s.first_failed), "page.align"),
    Row("run.arm_again", lambda s: s.state.touched is not None, "run.arm", do.Arm),
    *_rows_under_condition(
        lambda s: _in_air(s) and _in_stage(CutStage.DONE)(s) and s.work is not None and s.work.stage == Stage.AIR,
        Row("run.arm_air", lambda s: s.has_half, "preview.stage"),
        Row("run.arm_air_no_half", is_always_due, "preview.stage"),
    ),
    Row("run.arm", is_always_due, "run.arm", do.Arm),
)

INSPECT = (
    Row("inspect.wait", lambda s: s.state.activity is Activity.MEASURING),
    Row("inspect.cutting", lambda s: s.state.activity in (Activity.POSITIONING, Activity.CUTTING)),
    *_rows_under_condition(
        lambda s: s.state.measured is None,
        Row("inspect.air", lambda s: _in_air(s) and not s.state.cut_done and s.has_half, "preview.stage"),
        Row("inspect.air_no_half", lambda s: _in_air(s) and not s.state.cut_done, "preview.stage"),
        Row("inspect.measure", lambda s: s.state.cut_done and s.state.simulated, "inspect.measure", do.Measure),
        Row("inspect.measure_outside", lambda s: s.state.cut_done, "inspect.import", do.TakeTrace),
        Row(
            "inspect.form_failed",
            lambda s: s.state.form is not None and s.state.form.passes is False,
            "inspect.next",
        ),
        Row("inspect.form", lambda s: s.state.form is not None, "inspect.import"),
        Row("inspect.cut", lambda s: s.state.simulated, "page.run"),
        Row("inspect.cut_outside", is_always_due, "page.run"),
    ),
    *_rows_under_condition(
        _part(lambda part, _: not part.strategy.traits.follows_lobe),
        Row("inspect.lobe_taken", lambda s: _TAKEN(s) and follows_lobe(s.work), "inspect.next"),
        Row("inspect.lobe_plain", _TAKEN, "preview.strategy"),
        Row("inspect.lobe", _HAS_LOBE, "inspect.accept"),
        Row("inspect.no_lobe", is_always_due, "inspect.next"),
    ),
    Row("inspect.made_worse", lambda s: "learned.worse" in s.not_taught, "page.align"),
    Row("inspect.failed_mark", _part(lambda part, _: fails_in_mark(part)), "inspect.next"),
    Row("inspect.plain_better", _part(lambda part, _: _made_worse(part)), "preview.strategy"),
    Row("inspect.worse", lambda s: "learned.diverges" in s.not_taught, "inspect.revert"),
    Row("inspect.force", lambda s: _HALF(s) and _WRONG(s), "page.align"),
    Row("inspect.half", lambda s: _HALF(s) and _KEPT(s), "preview.stage"),
    Row("inspect.kept", _KEPT, "inspect.next"),
    Row(
        "inspect.check_jaw",
        lambda s: s.learning_result is not None and is_elsewhere(s.learning_result),
        "page.align",
    ),
    Row("inspect.half_learn", lambda s: _HALF(s) and s.stands_out, "inspect.accept"),
    Row("inspect.half", _HALF, "preview.stage"),
    *_rows_under_condition(
        _part(lambda part, _: not fails(part)),
        Row("inspect.part_learn", lambda s: s.stands_out, "inspect.accept"),
        Row("inspect.diameter", _part(lambda part, s: _OFF_SIZE(s) and part.offset_taken), "inspect.next"),
        Row("inspect.offset", _OFF_SIZE, "inspect.offset", do.CorrectTouchOff),
        Row("inspect.turn", _part(lambda part, _: turning_decides(part)), "inspect.turned", do.MeasureTurned),
        Row(
            "inspect.unproven", _part(lambda part, _: any(each.is_open for each in part.judged)), "inspect.import"
        ),
        Row("inspect.no_length", _part(lambda part, _: passes_all(part.judged) is None), "inspect.import"),
        Row("inspect.part", is_always_due, "inspect.next"),
    ),
    Row("inspect.failed", lambda s: s.learning_result is None, "inspect.next"),
    Row("inspect.failed_scatter", lambda s: not s.stands_out, "inspect.accept"),
    Row(
        "inspect.failed_jaw",
        _part(lambda part, _: part.learning is not None and jaw_explains(part.learning)),
        "page.align",
    ),
    Row("inspect.failed_learn", is_always_due, "inspect.accept"),
)


def next_step(now: Situation) -> Row:
    """Return the next step of the job, whatever page is shown: from nothing open to the measured part."""
    return row_of(_table_of(now), now)


def _table_of(now: Situation) -> tuple[Row, ...]:
    """Return the table of the present phase of the job."""
    state = now.state
    if waiting(state) in ("lost", "observing", "connecting"):
        return ALIGN
    under_way = phase_of(now.state) in (GuidePhase.STOPPED, GuidePhase.CUTTING) or state.activity in (
        Activity.ARMING,
        Activity.RETRACTING,
    )
    if under_way or state.armed is not None or now.tables_on or now.left_in_part:
        return RUN
    if waiting(state) and state.activity is not Activity.MEASURING:
        return ALIGN
    measured = state.measured is not None or state.form is not None
    if state.cut_done or (measured and now.alignment.clamping is None):
        return INSPECT
    if now.work is None or row_of(ALIGN_STEPS, now).word == "align.valid":
        return RUN
    return ALIGN
