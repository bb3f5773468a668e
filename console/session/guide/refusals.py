"""Why a key of the pages Align, Run and Inspect does nothing now: a table for each action, in order.

The first condition that applies gives the problems, which may be none: then the key does its work.
"""

from __future__ import annotations

from collections.abc import Callable

from console.session.cut.alignment import AlignStep, force_problems, step_problems, table_problems
from console.session.cut.jaw_by_indicator import READINGS, allowed_spread_deg, spread_problem
from console.session.guide.measured_part import why_not_accepted, why_not_reverted
from console.session.guide.rows import Condition, Row, at_step, is_always_due
from console.session.guide.situation import GuidePhase, Situation, phase_of
from console.session.guide.start_checks import failing
from console.session.guide.waiting import wait_problems, waiting
from console.session.station.adjustment import hold_refusal
from console.session.station.commands import HoldFeed, ResumeFeed
from console.session.station.jogging import no_retract
from console.session.station.state import Activity
from profiles.problem import Problem

Problems = tuple[Problem, ...]
Against = tuple[Condition, Callable[[Situation], Problems]]

LOOKS = frozenset(
    f"inspect.{name}" for name in ("circle", "filter", "larger", "smaller", "whole", "view", "length", "beside")
)
"""Actions that show the measured part in another way; they need one."""

_OF_CHOOSER = ("up", "down", "page_up", "page_down", "first", "last", "path", "state", "direction", "mark")


def find_refusals(action: str, now: Situation, key: str = "") -> Problems:
    """Return why an action cannot be done, empty if it can; `key` is how its key is written."""
    for when, problems in AGAINST.get(action, ()):
        if when(now):
            return wait_problems(now.state, key) if problems is _wait else problems(now)
    return ()


def why_not(row: Row, now: Situation) -> Problems:
    """Return why the key of a step does nothing now, else what a cut cannot start without, until it starts."""
    against = find_refusals(row.key or "", now)
    is_start = row.key is None or row.word.startswith("inspect.") or phase_of(now.state) is GuidePhase.CUTTING
    return against if against or is_start else failing(now.checks)


def _because(code: str, key: str = "", limit: str = "") -> Callable[[Situation], Problems]:
    return lambda _: (Problem(code=code, key=key, limit=limit),)


def _never_refused(_: Situation) -> Problems:
    return ()


def _wait(now: Situation) -> Problems:
    return wait_problems(now.state, "")


def _clamping(s: Situation) -> Problems:
    """Return why no clamping is confirmed now."""
    tables = table_problems(s.alignment)
    if s.drives_on:
        return tables or (Problem(code="screen.drives_not_off"),)
    if s.tables_on or s.job is None:
        return tables
    return (Problem(code="machine.tool_in_part"),) if s.in_part is True else force_problems(s.job)


def _come_out(s: Situation) -> Problems:
    """Return what keeps the chuck shut while the drives are on."""
    if not s.loops_closed:
        return ()
    return table_problems(s.alignment) or (Problem(code="machine.tool_in_part"),)


def _spread(s: Situation) -> Problems:
    return () if s.job is None else _one(spread_problem(s.alignment.flanks, allowed_spread_deg(s.job)))


def _can_take_back(s: Situation) -> bool:
    alignment = s.alignment
    taken = alignment.jaw is not None or alignment.touch_off is not None
    later = s.step in (AlignStep.TOUCH_OFF, None)
    return bool(alignment.flanks) or alignment.skim_counts is not None or (later and taken)


def _is_clamped(s: Situation) -> bool:
    return s.job is not None and not step_problems(s.alignment, AlignStep.CLAMP, s.job)


def _knows_axes(s: Situation) -> bool:
    return s.drives_on and s.alignment.drives_on and s.alignment.homed


def _is_armed(s: Situation) -> bool:
    return s.state.armed is not None and s.now_s <= s.state.armed.until_s


def _one(found: Problem | None) -> Problems:
    return () if found is None else (found,)


def _no_retract(s: Situation) -> Problems:
    """Return why nothing is retracted; a table that was left on is switched off wherever the tool stands."""
    found = no_retract(s.state.snapshot, s.machine, s.alignment)
    if found is None and not s.tables_on and s.in_part is False:
        found = Problem(code="screen.tool_is_out")
    return _one(found)


def _size_doubt(s: Situation) -> Problems:
    return _one(None if s.state.measured is None else s.state.measured.size_doubt)


def _no_sections(s: Situation) -> Problems:
    return _one(None if s.state.form is None else s.state.form.no_sections)


_WAITS: Against = (lambda s: bool(waiting(s.state)), _wait)
_NO_JOB: Against = (lambda s: s.work is None, _because("screen.nothing_to_align"))
_NO_PART: Against = (lambda s: s.state.measured is None, _because("trace.no_part"))
_BESIDE = _because("alignment.beside_part", key="tool")

_ALIGN: dict[str, tuple[Against, ...]] = {
    "align.step": (
        (lambda s: s.step is AlignStep.CLAMP and s.must_come_out, _come_out),
        (lambda s: s.step is AlignStep.CLAMP and (s.drives_on or s.ended_early), _never_refused),
        (lambda s: s.step in (AlignStep.TOUCH_OFF, None) and s.work is None, _because("screen.nothing_to_align")),
        (at_step(None), _because("screen.aligned")),
        (at_step(AlignStep.CLAMP), _because("screen.enter_does_it")),
        (at_step(AlignStep.JAW), _because("screen.jog_does_it")),
    ),
    "align.take": (
        _NO_JOB,
        (at_step(AlignStep.CLAMP), _clamping),
        # Another blank: the chuck may have been opened since the drives were disabled after a cut.
        (lambda s: s.step is AlignStep.DRIVES and not s.drives_on, _clamping),
        (lambda s: s.step is AlignStep.JAW and bool(s.alignment.flanks), _spread),
        (lambda s: s.step is AlignStep.TOUCH_OFF and not s.over_part, _BESIDE),
        (at_step(AlignStep.JAW, AlignStep.TOUCH_OFF), _never_refused),
        (at_step(None), _because("screen.aligned")),
        (is_always_due, _because("screen.f4_does_it")),
    ),
    "align.enable": (),
    "align.back": ((lambda s: not _can_take_back(s), _because("screen.nothing_to_take_back")),),
    "align.goto": (
        (_knows_axes, _never_refused),
        # Without drives or zeros a target would mean nothing.
        (lambda s: not s.alignment.drives_on, _because("alignment.drives_off")),
        (is_always_due, _because("alignment.not_homed")),
    ),
    "align.flank": (
        _NO_JOB,
        (lambda s: s.step is not AlignStep.JAW, _because("screen.no_flank_now")),
        (
            lambda s: len(s.alignment.flanks) >= READINGS,
            _because("alignment.flanks_complete", limit=str(READINGS)),
        ),
    ),
    "align.clamping": (_NO_JOB, (lambda s: not _is_clamped(s), _because("screen.no_readings_now"))),
    "align.skim": (
        _NO_JOB,
        (lambda s: s.step not in (AlignStep.TOUCH_OFF, None), _because("screen.no_skim_now")),
        (lambda s: s.alignment.skim_counts is None and not s.over_part, _BESIDE),
    ),
    "align.force": (_NO_JOB,),
    "align.off": ((lambda s: not s.drives_on, _because("screen.drives_are_off")),),
}

_RUN: dict[str, tuple[Against, ...]] = {
    "run.arm": (
        (lambda s: s.state.armed is not None, _never_refused),
        _WAITS,
        (is_always_due, lambda s: failing(s.checks)),
    ),
    "run.start": (
        (lambda s: s.state.paused, _never_refused),
        (lambda s: not _is_armed(s), _because("screen.not_armed")),
        _WAITS,
    ),
    "run.feed_hold": ((is_always_due, lambda s: _one(hold_refusal(HoldFeed(), s.state))),),
    "run.one_turn": ((is_always_due, lambda s: _one(hold_refusal(ResumeFeed(one_turn=True), s.state))),),
    "run.hold": (
        (
            lambda s: s.state.activity is not Activity.CUTTING or s.state.cut is None,
            _because("screen.nothing_to_hold"),
        ),
        (lambda s: s.state.cut is not None and s.state.cut.holding, _because("screen.holding_already")),
    ),
    "run.retract": (_WAITS, (lambda s: s.clears_tables, _never_refused), (is_always_due, _no_retract)),
}

_INSPECT: dict[str, tuple[Against, ...]] = {
    "inspect.measure": (
        (lambda s: not s.state.simulated, _because("session.no_gauge")),
        (lambda s: s.state.moving, _because("machine.moving")),
        (lambda s: not s.state.cut_done, _because("session.nothing_cut")),
    ),
    "inspect.turned": (
        (lambda s: s.state.moving, _because("machine.moving")),
        (lambda s: s.state.measured is None and not s.state.simulated, _because("gauge.no_first")),
        (lambda s: s.state.measured is None, _because("gauge.no_reading")),
    ),
    "inspect.accept": (
        (lambda s: bool(_no_sections(s)), _no_sections),
        (is_always_due, lambda s: why_not_accepted(s.state.measured, s.work)),
    ),
    "inspect.revert": ((is_always_due, lambda s: why_not_reverted(s.work)),),
    "inspect.offset": (
        (lambda s: s.state.measured is not None and s.state.measured.tool_offset_um is not None, _wait),
        (lambda s: bool(_size_doubt(s)), _size_doubt),
        (lambda s: s.state.measured is None, _because("trace.no_part", limit="# radius_mm: R")),
        (is_always_due, _because("offset.no_size", limit="# radius_mm: R")),
    ),
    "inspect.import": (
        (lambda s: s.work is None, _because("screen.nothing_to_cut")),
        (lambda s: s.state.moving, _because("machine.moving")),
    ),
    "inspect.export": (_NO_PART,),
    **{action: (_NO_PART,) for action in LOOKS},
    **{f"inspect.{name}": ((is_always_due, _because("screen.traces_closed")),) for name in _OF_CHOOSER},
}

AGAINST = {**{action: (_WAITS, *rows) for action, rows in _ALIGN.items()}, **_RUN, **_INSPECT}
