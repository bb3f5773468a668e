"""Text of the page Run before, after and instead of a cut; safety devices are only shown."""

from __future__ import annotations

import math

from rich.cells import cell_len

from console.session.cut.alignment import (
    Alignment,
    AlignStep,
    aligned_job,
    stamp_problems,
)
from console.session.cut.interlocks import Interlock
from console.session.guide.start_checks import checks, is_over
from console.session.stages import without_half
from console.session.station.jogging import tool_radius_mm
from console.session.station.progress import CutProgress, CutStage
from console.session.station.state import ArmedCut, StationState
from console.session.work import Work
from console.text.along_length import stretch_words
from console.text.catalogue import Catalogue
from console.text.job_words import short_span_words
from console.text.part_sentences import force_words, tool_words
from console.text.recorded_words import plain_cut_words
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    Piece,
    dim,
    fact,
    first_fitting,
    hanging,
    line,
    name_in,
    wrap_line,
)
from console.tui.pages.fields import name_field
from console.tui.pages.learn_lines import chosen_words, made_words
from console.tui.pages.stop_lines import cut_words, mark_lines
from console.tui.run.adjust_lines import changed_lines
from console.tui.theme import Token
from drivers.cutting.strategy import Strategy
from drivers.lathe.snapshot import Snapshot
from profiles.chucking.advice import ForcePosition, force_span
from profiles.files import printable
from profiles.job import Job
from profiles.machine import MachineProfile

LABEL_WIDTH = 13


def check_lines(
    text: Catalogue, found: tuple[Interlock, ...], width: int, height: int | None = None
) -> list[Line]:
    """Return a row for each condition, with its first reason (without a height all) where it is not met."""
    rows: list[Line] = []
    wrong: list[Line] = []
    for check in found:
        name = text(f"run_page.check.{check.name}")
        if check.waits:
            known_by = "by_drives" if check.name == "no_fault" else "by_arming"
            rows.append(line("○ ", dim(f"{name}: {text(f'run_page.{known_by}')}")))
        elif not check.problems and not check.warnings:
            rows.append(line(("✓ ", Token.OK), dim(name)))
        else:
            shown = check.problems if height is None else check.problems[:1]
            hidden = len(check.problems) - len(shown)
            more = f" (+{hidden} {text('frame.all')})" if hidden else ""
            mark = "✗ " if check.problems else "! "
            reasons = [line((mark + name + more, Token.WARNING))]
            for problem in (*shown, *check.warnings):
                reasons += hanging(dim("  "), text.problem(name_field(problem, text)), width)
            rows += reasons
            wrong += reasons
    wrong_first = [*wrong, *(row for row in rows if row not in wrong)]
    return first_fitting(height, text("panel.more"), rows, wrong_first)


def summary_lines(text: Catalogue, state: StationState, work: Work, now_s: float, width: int) -> list[Line]:
    """Return what will be cut and its basis; when armed what was armed, and until when."""
    armed = state.armed
    job = work.job if armed is None else armed.job
    strategy = Strategy(work.strategy) if armed is None else armed.strategy
    stamps = state.alignment if armed is None else armed.alignment
    clamping, jaw, tip = stamps.clamping, stamps.jaw, stamps.touch_off
    clamped = "" if clamping is None else clamping.at
    found = "" if jaw is None else f"{jaw.angle_deg:.2f} °  {jaw.at}"
    touched = "" if tip is None else f"R {text.units.show(tip.zero_radius_mm, 'mm', 3)}  {tip.at}"
    made = chosen_words(text, work)
    if armed is not None:
        how = armed.made
        made = made_words(text, how.version, how.stage, how.inverted)
    made = plain_cut_words(strategy, work.stage if armed is None else armed.made.stage, text, "made") or made
    pairs = [
        ("job", name_in(printable(job.name), max(width - LABEL_WIDTH, 0))),
        ("revision", _revision(text, work, armed)),
        ("force", f"{job.chucking_force_n:.0f} N"),
        ("window", window_words(job, work.machine.machine, text)),
        ("confirmed", _stamp(text, stamps, AlignStep.CLAMP, job, clamped)),
        *([] if state.cut_to is None else [("touched", cut_words(text, state.cut_to))]),
        ("depth", text.units.show(job.depth_of_cut_mm, "mm", 3)),
        ("feed", text.units.show(job.feed_mm_per_rev, "mm/rev", 3)),
        ("speed", f"{job.spindle_speed_rpm if armed is None else armed.plan.spindle_speed_rpm:.0f} rpm"),
        ("strategy", text(f"strategy.{strategy}.named")),
        ("made", made),
        ("jaw", _stamp(text, stamps, AlignStep.JAW, job, found)),
        ("touch_off", _stamp(text, stamps, AlignStep.TOUCH_OFF, job, touched)),
    ]
    facts = [fact(text(f"run_page.sum.{key}"), value, width, label_width=LABEL_WIDTH) for key, value in pairs]
    if armed is None:
        return facts
    left_s = max(math.ceil(armed.until_s - now_s), 0)
    return [*wrap_line(text("run_page.armed", left=left_s), width, Token.ACTION), *facts]


def window_words(job: Job, machine: MachineProfile, text: Catalogue) -> str:
    """Return the allowed forces of a job, and whether its own is one of them; or that there is none."""
    span = force_span(job, machine)
    mark = "✓" if span.stands(job.chucking_force_n) is ForcePosition.INSIDE else "✗"
    return f"{mark} {short_span_words(span, text)}"


def _revision(text: Catalogue, work: Work, armed: ArmedCut | None) -> str:
    """Return which file is meant. The armed job need not be the open one, whose file alone is known."""
    if armed is not None and armed.job != aligned_job(work.job, armed.alignment):
        return NOTHING
    return f"{work.loaded.sha256[:6]}{text('run_page.edited') if work.edited else ''}"


def _stamp(text: Catalogue, stamps: Alignment, step: AlignStep, job: Job, value: str) -> str:
    """Return what was taken in a step, "" for nothing yet, if it applies to this job."""
    if not value:
        return text("run_page.not_yet")
    return text("run_page.not_of_job") if stamp_problems(stamps, step, job) else value


def moves_lines(text: Catalogue, armed: ArmedCut, machine: MachineProfile, width: int) -> list[Line]:
    """Return what moves when the armed cut is started, in order. `machine` is the nominal profile."""
    plan = armed.plan
    words = text(
        "run_page.moves_first",
        z=text.units.figure(plan.carriage_start / machine.carriage.counts_per_mm, "mm", 1),
        radius=text.units.figure(tool_radius_mm(plan.tool_start, machine, armed.alignment), "mm", 3),
        speed=f"{plan.spindle_speed_rpm:.0f}",
        duration=f"{plan.duration_s:.0f}",
    )
    return wrap_line(words, width, Token.STRONG)


def figure_lines(text: Catalogue, cut: CutProgress, width: int) -> list[Line]:
    """Return the figures of a finished cut: they are the controller's, nothing was measured on the part."""
    word = "held" if cut.stage is CutStage.HELD else "done_in_air" if cut.in_air else "done"
    pairs = [
        ("turns", f"{cut.turn:.0f} / {cut.turns:.0f}"),
        ("length", f"{text.units.figure(cut.z_mm, 'mm', 2)} / {text.units.show(cut.length_mm, 'mm', 2)}"),
    ]
    figures, notes = cut.figures, ["no_figures"]
    if figures is not None:
        peak = text.units.show(figures.tool_error_um, "um", 2)
        where = stretch_words(figures.event(), text, "where")
        pairs += [
            ("speed", f"{figures.spindle_speed_rpm:.1f} rpm"),
            ("error_peak", f"{peak} {where}" if cut.judged else NOTHING),
            ("error_rms", text.units.show(figures.tool_error_rms_um, "um", 2) if cut.judged else NOTHING),
            *_phase_pair(text, cut),
            ("following_peak", text.units.show(figures.following_error_um, "um", 2)),
            ("following_rms", text.units.show(figures.following_error_rms_um, "um", 2)),
            ("verdict", text(f"cut_verdict.{figures.verdict.judgement}")),
            ("tool", tool_words(figures.verdict, text) or NOTHING),
            ("samples", f"{figures.samples}"),
        ]
        notes = ["by_controller"] if cut.judged else ["not_judged", "by_controller"]
    label = LABEL_WIDTH + 6
    rows = [fact(text(f"run_page.figure.{key}"), value, width, label_width=label) for key, value in pairs]
    words = [row for note in notes for row in wrap_line(text(f"run_page.{note}"), width, Token.DIM)]
    changed = changed_lines(text, cut.changed, width)
    if cut.force is not None:
        token = Token.WARNING if cut.force.alarms else Token.TEXT
        changed = [*wrap_line(force_words(cut.force, text), width, token), BLANK, *changed]
    head = [*wrap_line(text(f"run_page.{word}"), width, Token.STRONG), BLANK, *rows, BLANK]
    return [*head, *changed, *words]


def _phase_pair(text: Catalogue, cut: CutProgress) -> list[tuple[str, str]]:
    """Return the phase error of the last turns; none without a lobe.

    It is left out where words on force or changes need the row, unless the phase is out of its limit.
    """
    is_out, has_words = cut.in_phase is False, cut.force is not None or cut.changed is not None
    if cut.lag_deg is None or (has_words and not is_out):
        return []
    out = f"! {text('run_page.out_of_phase')} " if is_out else ""
    return [("phase", f"{out}{cut.lag_deg:+z.2f} °")]


def after_lines(
    text: Catalogue, state: StationState, work: Work | None, machine: MachineProfile, width: int
) -> list[Line]:
    """Return what comes next after a cut, the marks of stops, and what another cut of the same blank lacks."""
    marks = mark_lines(text, state.marks_mm, width)
    if state.cut is not None and state.cut.holds_mm:
        places = ", ".join(text.units.figure(place_mm, "mm", 1) for place_mm in state.cut.holds_mm)
        marks += wrap_line(text("run_page.hold_mark", z=places), width, Token.WARNING)
    missing = [] if is_over(state) else [check for check in checks(state, work, machine) if check.problems]
    rows = check_lines(text, tuple(missing), width)
    following = wrap_line(text(f"run_page.{_after_word(state, work)}"), width)
    return [*following, *([BLANK, *marks] if marks else []), *([BLANK, *rows] if rows else [])]


def _after_word(state: StationState, work: Work | None) -> str:
    if state.cut is not None and state.cut.stage is CutStage.HELD:
        return "after_hold"
    if state.cut is not None and state.cut.in_air:
        return "after_air" if work is None else f"after_air{without_half(Strategy(work.strategy))}"
    if state.cut_done:
        return "after_cut" if state.simulated else "after_real_cut"
    return "after_measured"


def input_lines(text: Catalogue, snapshot: Snapshot | None, width: int, height: int | None = None) -> list[Line]:
    """Return the devices, those in the wrong state first; where not all have room, those are shown alone."""
    seen = {} if snapshot is None else snapshot.inputs
    bad = [(f"✗ {text(f'run_page.input.{name}')}", Token.WARNING) for name, good in seen.items() if not good]
    well = [(f"✓ {text(f'run_page.input.{name}')}", Token.DIM) for name, good in seen.items() if good]
    rows = _in_rows([*bad, *well], width)
    return rows if height is None or len(rows) <= height else _in_rows(bad, width)[: max(height, 0)]


def _in_rows(pieces: list[Piece], width: int) -> list[Line]:
    """Set pieces side by side, two cells apart, as many as fit a row."""
    rows: list[list[Piece]] = []
    room = 0
    for words, token in pieces:
        needs = cell_len(words) + 2
        if not rows or needs > room:
            rows.append([(words, token)])
            room = width - cell_len(words)
        else:
            rows[-1] += [dim("  "), (words, token)]
            room -= needs
    return [tuple(row) for row in rows]
