"""The panel of an entry of the page Align: how what is typed is understood, and what to press."""

from __future__ import annotations

from console.session.station.durations import jog_s
from console.session.station.jogging import TOUCH_OFF_BAND_MM, setup_speed, step_speed
from console.session.station.targets import distance_to, target_problems, target_range
from console.session.typed_number import typed_length
from console.text.catalogue import Catalogue
from console.tui.align.entry_context import (
    AXES,
    CLAMPING,
    MOST_TYPED,
    UNITS,
    EntryContext,
    EntryKind,
    EntryValue,
    entry_row,
    number_of,
    range_of,
    range_words,
)
from console.tui.lines import BLANK, NOTHING, Line, Piece, dim, first_fitting, hanging, line, wrap_line
from console.tui.pages.fields import name_field
from console.tui.rows import wrap_problems
from console.tui.theme import Token
from drivers.lathe.snapshot import Snapshot
from profiles.chucking.advice import ForcePosition, ForceSpan, force_span
from profiles.chucking.holding import Holding, Wrench, holding_of, torque_or_none_n_m
from profiles.fingerprint.readings import LEAST_PLACES
from profiles.problem import Problem, ProfileError

_LARGEST_TORQUE_N_M = 1000.0
MOST_TYPED_UM = 2000.0


def diameter_range(question: EntryContext) -> tuple[float, float]:
    """Return what may be typed: about the diameter that was clamped."""
    clamping = question.alignment.clamping
    nominal_mm = 0.0 if clamping is None else clamping.diameter_mm
    return nominal_mm - 2.0 * TOUCH_OFF_BAND_MM, nominal_mm + 2.0 * TOUCH_OFF_BAND_MM


def diameter_answer(question: EntryContext) -> EntryValue:
    """Return the measured diameter, mm."""
    return number_of(question, "diameter_mm", *diameter_range(question))


def zero_radius_mm(question: EntryContext, diameter_mm: float) -> float | None:
    """Return the radius of the tip at position zero that follows; None without a noted skim cut."""
    at_counts = question.alignment.skim_counts
    return None if at_counts is None else diameter_mm / 2.0 + at_counts / question.machine.tool.counts_per_mm


def diameter_lines(text: Catalogue, question: EntryContext, width: int) -> list[Line]:
    """Return the panel of the entry: the range, what follows, and the difference to what is known."""
    low, high = range_of(question, *diameter_range(question))
    rows = [
        entry_row(text("align_page.measured"), question),
        line(dim(text("align_page.range", low=f"D {low}", high=high))),
        BLANK,
    ]
    answer = diameter_answer(question)
    if answer.value is not None and not answer.problems:
        zero_mm = zero_radius_mm(question, answer.value)
        if zero_mm is not None:
            rows += [
                line(("→ ", Token.OK), (f"D {text.units.show(answer.value, 'mm', 3)}", Token.STRONG)),
                line(text("align_page.tool_zero", radius=f"R {text.units.show(zero_mm, 'mm', 4)}")),
                *_zero_compared(text, question, zero_mm, width),
            ]
    return rows


def _zero_compared(text: Catalogue, question: EntryContext, zero_mm: float, width: int) -> list[Line]:
    touched = question.alignment.touch_off
    before_mm = question.machine.tool.home_radius_mm if touched is None else touched.zero_radius_mm
    word = "by_profile" if touched is None else "by_touch_off"
    off_um = 1000.0 * (zero_mm - before_mm)
    off = text.units.show(off_um, "um", 1, "+")
    return wrap_line(text(f"align_page.{word}", radius=f"R {text.units.show(before_mm, 'mm', 4)}", off=off), width)


def force_range(question: EntryContext) -> tuple[float, float]:
    """Return what may be typed: up to the chuck's own maximum, as force or as torque."""
    most_n = question.machine.chuck.max_force_n
    if question.asked is EntryKind.FORCE:
        return 0.0, most_n
    wrench = holding_of(question.machine).wrench
    most = None if wrench is None else torque_or_none_n_m(wrench, most_n)
    return 0.0, _LARGEST_TORQUE_N_M if most is None else most


def force_answer(question: EntryContext) -> EntryValue:
    """Return the typed torque (N m) or force (N)."""
    return number_of(question, str(question.asked), *force_range(question), decimals=1)


def force_lines(text: Catalogue, question: EntryContext, width: int) -> list[Line]:
    """Return the panel: the job's force, its window, and what the entry comes to; nothing is changed by it."""
    holding, job = holding_of(question.machine), question.job
    rows: list[Line] = [entry_row(text(f"align_page.{question.asked}"), question)]
    if job is None:
        return rows
    span, wrench = force_span(job, question.machine), holding.wrench
    ends = {
        name: _with_torque(wrench, force_n) for name, force_n in (("least", span.least_n), ("most", span.most_n))
    }
    rows += [
        line(dim(text("align_page.force_job", both=_with_torque(wrench, job.chucking_force_n)))),
        line(dim(text("align_page.force_least", least=ends["least"]))),
        line(dim(text("align_page.force_most", most=ends["most"]))),
    ]
    if wrench is None:
        return [*rows, *wrap_line(text("align_page.no_wrench"), width, Token.WARNING)]
    answer = force_answer(question)
    if answer.value is None or answer.problems:
        return [*rows, BLANK]
    force_n = answer.value
    if question.asked is EntryKind.TORQUE:
        force_n = wrench.offset_n + wrench.force_per_torque_n_per_n_m * answer.value
    return [*rows, BLANK, *_torque_lines(text, holding, wrench, span, force_n, width)]


def _torque_lines(
    text: Catalogue, holding: Holding, wrench: Wrench, span: ForceSpan, force_n: float, width: int
) -> list[Line]:
    torque = torque_or_none_n_m(wrench, force_n)
    if torque is None:
        return wrap_line(text("align_page.no_torque", force=f"{force_n:.0f} N"), width, Token.WARNING)
    scatter_n = ((force_n * holding.force_sd_fraction) ** 2 + wrench.line_sd_n(torque) ** 2) ** 0.5
    stands = span.stands(force_n)
    mark: Piece = ("✓ ", Token.OK) if stands is ForcePosition.INSIDE else ("! ", Token.WARNING)
    return [
        line(("→ ", Token.OK), (f"{torque:.2f} N m = {force_n:.0f} N", Token.STRONG), dim(f" ±{scatter_n:.0f} N")),
        *[(mark, *rest) for rest in wrap_line(text(f"align_page.stands_{stands}"), width - 2)],
    ]


def _with_torque(wrench: Wrench | None, force_n: float) -> str:
    """Return a force with its torque, where the wrench gives it."""
    torque = None if wrench is None else torque_or_none_n_m(wrench, force_n)
    return f"{force_n:.0f} N" if torque is None else f"{force_n:.0f} N ({torque:.1f} N m)"


def target_answer(question: EntryContext) -> EntryValue:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if not question.typed.strip():
        return EntryValue()
    axis = AXES[question.asked]
    low, high = target_range(question.machine, axis)
    try:
        unit = UNITS[question.asked]
        value = typed_length(question.typed, axis, range_words(question, low, high), unit, question.units)
    except ProfileError as error:
        return EntryValue(problems=tuple(error.problems))
    if question.state.snapshot is None:
        return EntryValue(value=value, problems=(Problem(code="screen.nothing_known"),))
    against = target_problems(question.state.snapshot, question.machine, question.alignment, axis, value)
    return EntryValue(value=value, problems=against)


def target_lines(text: Catalogue, question: EntryContext, width: int) -> list[Line]:
    """Return the panel of an entry: its row, the range, how it is understood."""
    axis, snapshot = AXES[question.asked], question.state.snapshot
    low, high = target_range(question.machine, axis)
    now = NOTHING if snapshot is None else _position(question, snapshot)
    ends = range_of(question, low, high)
    rows = [
        entry_row(text(f"align_page.axis.{axis}"), question),
        line(dim(text("align_page.target_range", now=now, low=ends[0], high=ends[1]))),
        BLANK,
    ]
    answer = target_answer(question)
    if answer.value is None or answer.problems or snapshot is None:
        return rows
    return [*rows, *_target_echo(text, question, snapshot, answer.value, width)]


def _position(question: EntryContext, snapshot: Snapshot) -> str:
    if question.asked is EntryKind.Z:
        return question.units.figure(
            snapshot.carriage.position / question.machine.carriage.counts_per_mm, "mm", 3, "z"
        )
    turns = snapshot.spindle.position / question.machine.spindle.counts_per_rev
    return f"{360.0 * (turns % 1.0):.2f}"


def _target_echo(
    text: Catalogue, question: EntryContext, snapshot: Snapshot, value: float, width: int
) -> list[Line]:
    """Return the target as understood, with its way, its time and its speed."""
    axis, machine = AXES[question.asked], question.machine
    distance = distance_to(snapshot, machine, axis, value)
    speed, most = step_speed(machine, axis, distance), setup_speed(axis)
    decimals, unit = (2, "°") if question.asked is EntryKind.C else (3, "mm")
    way = (
        ("forward" if distance >= 0.0 else "backward")
        if question.asked is EntryKind.C
        else ("to_chuck" if distance >= 0.0 else "to_tail")
    )
    rate, units = "rpm" if question.asked is EntryKind.C else "mm/s", question.units
    words = text(
        f"align_page.target_{way}",
        way=units.show(abs(distance), unit, decimals),
        time=f"{jog_s(machine, axis, distance):.1f} s",
    )
    return [
        line(("→ ", Token.OK), (units.show(value, unit, decimals), Token.STRONG)),
        *wrap_line(words, width),
        line(
            dim(
                text("align_page.target_speed", speed=units.figure(speed, rate, 1), most=units.show(most, rate, 1))
            )
        ),
    ]


def clamp_answer(question: EntryContext) -> EntryValue:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if question.asked is EntryKind.INDICATED:
        return EntryValue()
    if question.asked is EntryKind.READING:
        return number_of(question, "indicator_um", -MOST_TYPED_UM, MOST_TYPED_UM, decimals=0)
    least, _ = _least_places(question)
    answer = number_of(question, "places", least, MOST_TYPED, decimals=0)
    if answer.value is not None and not answer.problems and answer.value != round(answer.value):
        limit = f"{least}, {least + 1} … {MOST_TYPED}"
        return EntryValue(
            value=answer.value,
            problems=(Problem(code="screen.number_out_of_range", value=question.typed, limit=limit),),
        )
    return answer


def clamp_lines(text: Catalogue, question: EntryContext, width: int) -> list[Line]:
    """Return the panel: what to read where, or what the readings show."""
    typing = question.clamp
    if question.asked is EntryKind.PLACES:
        low, both = _least_places(question)
        advice = text("align_page.clamp_places", low=low, high=MOST_TYPED, both=both)
        return [entry_row(text("align_page.places"), question), *wrap_line(advice, width, Token.DIM)]
    if question.asked is EntryKind.INDICATED:
        return _deflection_lines(text, question, width)
    state = text("align_page.full_force" if typing.full else "align_page.finger_tight")
    where = text("align_page.clamp_place", place=typing.place + 1, of=typing.places, angle=f"{typing.angle_deg:g}")
    rows: list[Line] = [entry_row(text("align_page.reads"), question), line((state, Token.STRONG)), line(where)]
    if typing.full:
        rows.append(
            line(
                dim(
                    text(
                        "align_page.clamp_before",
                        value=text.units.show(typing.values[typing.place], "um", 1, "+z"),
                    )
                )
            )
        )
    return [*rows, *_simulated_reading(text, question)]


def _least_places(question: EntryContext) -> tuple[int, int]:
    """Return how many places show the height of the lobe, and how many its angle, too."""
    from profiles.fingerprint.deflection import places_needed

    lobes = question.job.jaws if question.job is not None else question.machine.chuck.jaws
    return places_needed(lobes), max(LEAST_PLACES, 2 * lobes + 1)


def _simulated_reading(text: Catalogue, question: EntryContext) -> list[Line]:
    """Return what the indicator of the simulated lathe reads there."""
    found, typing = question.state.indicated, question.clamp
    if found is None or len(found.angle_deg) != typing.places:
        return []
    value = (found.full_um if typing.full else found.finger_um)[typing.place]
    return [
        line(
            ("SIM", Token.SIM),
            dim(" " + text("align_page.clamp_sim", value=text.units.show(value, "um", 0, "+z"))),
        )
    ]


def _deflection_lines(text: Catalogue, question: EntryContext, width: int) -> list[Line]:
    """Return the deflection that all readings show, with its confidence, or why they show none."""
    from console.session.learning.fingerprint import expected_of
    from console.text.part_sentences import blank_lines
    from profiles.fingerprint.blank_form import blank_oval
    from profiles.fingerprint.deflection import deflection_of

    units = question.units
    job, typing = question.job, question.clamp
    rows: list[Line] = [BLANK, line((text("align_page.clamp_all", count=2 * typing.places), Token.STRONG))]
    if job is None:
        return rows
    try:
        readings = typing.readings(simulated=question.state.simulated, inch=units.is_inch)
        shown, unlikely = deflection_of(readings, job), expected_of(readings, job, question.machine)
    except ProfileError as refused:
        return [*rows, *wrap_problems(refused.problems, text, width)]
    lobe = 2.0 * abs(shown.coefficients_um[job.jaws])
    limit = 2.0 * shown.limit_um(job.jaws)
    words = text(
        "align_page.clamp_lobe", n=job.jaws, lobe=units.figure(lobe, "um", 1), limit=units.figure(limit, "um", 1)
    )
    rows.append(line(("→ ", Token.OK), (words, Token.STRONG)))
    if shown.upright:
        rows += wrap_line(text("align_page.clamp_upright"), width, Token.DIM)
    rows += wrap_problems(unlikely, text, width)
    for each in blank_lines(blank_oval(readings, job, question.machine), text):
        rows += wrap_line(each, width, Token.DIM)
    return rows


def interpret_entry(question: EntryContext) -> EntryValue:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if question.asked in AXES:
        return target_answer(question)
    if question.asked in CLAMPING:
        return clamp_answer(question)
    return diameter_answer(question) if question.asked is EntryKind.DIAMETER else force_answer(question)


def asked_lines(text: Catalogue, question: EntryContext, width: int, height: int | None) -> list[Line]:
    """Return the panel of an entry; what is against it comes before what to press."""
    of_force = question.asked in (EntryKind.TORQUE, EntryKind.FORCE)
    lines = target_lines if question.asked in AXES else force_lines if of_force else diameter_lines
    lines = clamp_lines if question.asked in CLAMPING else lines
    rows, keys = lines(text, question, width), "target" if question.asked in AXES else question.asked
    for problem in interpret_entry(question).problems:
        rows += hanging(("✗ ", Token.WARNING), text.problem(name_field(problem, text)), width)
    hint = wrap_line(text(f"align_page.{keys}_keys"), width, Token.DIM)
    if question.reads_itself and question.asked is EntryKind.READING:
        hint = [*wrap_line(text("align_page.reads_itself"), width), *hint]
    return first_fitting(height, text("panel.more"), [*rows, BLANK, *hint], [*rows, *hint])
