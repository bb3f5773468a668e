"""Text of the page Align: axis positions, what is done, what is missing, how to jog."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from rich.cells import cell_len
from textual.geometry import Size

from console.session.cut.alignment import (
    Alignment,
    AlignStep,
    is_done,
    problems,
    step_now,
)
from console.session.cut.jaw_by_indicator import (
    READINGS,
    RESULTS,
    allowed_spread_deg,
    mean_deg,
    results_deg,
    spread_deg,
)
from console.session.guide.rows import ALIGN_STEPS, row_of
from console.session.guide.situation import NEAR_MARK_DEG, Situation, angle_deg, jaw_off_deg
from console.session.guide.waiting import waiting
from console.session.station.jogging import counts_per_unit, tool_radius_mm
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.align.travel_lines import moving_words
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    clip_lines,
    dim,
    fact,
    first_fitting,
    fit_text,
    hanging,
    justify_line,
    line,
    to_the_right,
    wrap_line,
)
from console.tui.pages.fields import name_field
from console.tui.plot.big_number import big_number
from console.tui.theme import Token
from console.units import Units
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.job import NO_LOBE, Job
from profiles.lobe.lobe_conditions import MEASURED
from profiles.machine import MachineProfile

WIDEST_STAMP = 44  # columns in which a label and its value are still read together
STAMP_LABEL_WIDTH = 10
_NO_ADVICE = ("lost", "stopping", "connecting", "observing")  # no advice for manual work while something may move
_DONE, _CURRENT, _OPEN, _UNKNOWN = "✓", "●", "○", "?"
_LABEL_WIDTH, _POSITION_WIDTH, _ERROR_WIDTH, _HOMED_WIDTH = 9, 12, 10, 6


def axes_lines(
    text: Catalogue, state: StationState, machine: MachineProfile, now_s: float, width: int
) -> list[Line]:
    """Return the table of the axes, and below it the facts common to all."""
    heads = (
        fit_text("", _LABEL_WIDTH),
        to_the_right(text("align_page.position"), _POSITION_WIDTH),
        to_the_right(text("align_page.error"), _ERROR_WIDTH),
        to_the_right(text("align_page.homed"), _HOMED_WIDTH),
        " ",
        text("align_page.drive"),
    )
    stale, axes = state.is_stale(now_s), (AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE)
    rows = [_axis_line(text, axis, state, machine, stale) for axis in axes]
    return [(dim("".join(heads)),), *rows, _drives_line(text, state, now_s, width)]


def _axis_line(text: Catalogue, axis: AxisName, state: StationState, machine: MachineProfile, stale: bool) -> Line:
    label = dim(fit_text(text(f"align_page.axis.{axis}"), _LABEL_WIDTH))
    if state.snapshot is None:
        columns = (_POSITION_WIDTH, _ERROR_WIDTH, _HOMED_WIDTH)
        return (label, dim("".join(to_the_right(NOTHING, width) for width in columns)), dim(f" {NOTHING}"))
    seen = state.snapshot.axis(axis)
    position, error = _position(axis, state.snapshot, machine, state.alignment, text.units)
    homed = "home_complete" in seen.flags
    if not homed:
        position = NOTHING  # counts from the axis position at power-on of the controller
    gaps = [" " * (_POSITION_WIDTH - cell_len(position)), " " * (_ERROR_WIDTH - cell_len(error))]
    live, lesser = (Token.STALE, Token.STALE) if stale else (Token.TEXT, Token.DIM)
    pieces = line(label, gaps[0], (position, live), gaps[1], (error, lesser))
    if stale:
        return (*pieces, dim(to_the_right(_UNKNOWN, _HOMED_WIDTH)), dim(f" {_UNKNOWN}"))
    return (
        *pieces,
        (to_the_right(_DONE if homed else _OPEN, _HOMED_WIDTH), Token.OK if homed else Token.WARNING),
        dim(" " + (text("align_page.on") if seen.closed else text("align_page.off"))),
    )


def large_lines(
    text: Catalogue, state: StationState, machine: MachineProfile, now_s: float, width: int
) -> list[Line]:
    """Return the positions in large digits, a dash where there is none."""
    rows: list[Line] = []
    for axis in (AxisName.TOOL, AxisName.CARRIAGE, AxisName.SPINDLE):
        number, unit, label = NOTHING, "", text(f"align_page.axis.{axis}")
        if state.snapshot is not None and "home_complete" in state.snapshot.axis(axis).flags:
            position, _ = _position(axis, state.snapshot, machine, state.alignment, text.units)
            *radius, number, unit = position.split()
            label = " ".join((label, *radius))
        token = Token.STALE if state.is_stale(now_s) else Token.STRONG
        rows += [*([BLANK] if rows else []), *big_number(number, label, unit, width, token)]
    return rows


def _position(
    axis: AxisName, snapshot: Snapshot, machine: MachineProfile, alignment: Alignment, units: Units
) -> tuple[str, str]:
    seen, per_unit = snapshot.axis(axis), counts_per_unit(machine, axis)
    error = seen.following_error / per_unit
    match axis:
        case AxisName.TOOL:
            radius_mm = tool_radius_mm(seen.position, machine, alignment)
            return f"R {units.show(radius_mm, 'mm', 4, 'z')}", _error_um(1000.0 * error, units)
        case AxisName.CARRIAGE:
            return units.show(seen.position / per_unit, "mm", 3, "z"), _error_um(1000.0 * error, units)
        case AxisName.SPINDLE:
            return f"{angle_deg(snapshot, machine):z.2f} °", f"{error:z.2f} °"


def _error_um(error_um: float, units: Units) -> str:
    """Format a following error; a large one in mm, so that it never runs into the position beside it."""
    if abs(error_um) < 999.95:
        return units.show(error_um, "um", 1, "z")
    return units.show(error_um / 1000.0, "mm", 3, "z")


def _drives_line(text: Catalogue, state: StationState, now_s: float, width: int) -> Line:
    age_s = state.age_s(now_s)
    if state.snapshot is None or age_s is None:
        return (dim(fit_text(text("align_page.nothing_known"), width)),)
    if state.is_stale(now_s):
        return ((fit_text("! " + text("align_page.stale", age=f"{age_s:.0f} s"), width), Token.WARNING),)
    drives = ("! " + text("align_page.drives_partly"), Token.WARNING)
    if state.snapshot.loops_closed:  # in motion the room is for how long it takes
        drives = dim(text("align_page.drives_moving" if state.seen_moving else "align_page.drives_on"))
    elif state.snapshot.loops_open:
        drives = dim(text("align_page.drives_off"))
    moving = dim(text("align_page.at_rest"))
    if state.seen_moving:
        moving = moving_words(text, state, now_s), Token.STRONG
    return justify_line((drives,), (dim(" "), moving), width)


def step_lines(text: Catalogue, state: StationState, job: Job | None) -> list[Line]:
    """Return the steps in order, each with its mark; the drives of a lost machine are unknown."""
    alignment, lost = state.alignment, state.activity is Activity.LOST
    now = None if lost else step_now(alignment, job)
    rows = []
    for number, step in enumerate(AlignStep, start=1):
        words = f" {number} " + text(f"align_page.step.{step}")
        if lost and step in (AlignStep.DRIVES, AlignStep.HOME):
            rows.append(line((_UNKNOWN + words, Token.WARNING)))
        elif is_done(alignment, step, job):
            rows.append(line((_DONE, Token.OK), dim(words)))
        else:
            rows.append(line((_CURRENT + words, Token.ACTION) if step is now else _OPEN + words))
    return rows


def beside_each_other(steps: list[Line], size: Size) -> list[Line]:
    """Return the steps in two columns of half the rows; each is cut where it is too wide."""
    half, column = (len(steps) + 1) // 2, (size.width - 1) // 2
    pairs = zip(steps[:half], steps[half:], strict=False)
    return [
        (*justify_line(left, BLANK, column), dim(" "), *justify_line(right, BLANK, column))
        for left, right in pairs
    ]


def is_valid(alignment: Alignment, job: Job | None) -> bool:
    """Whether tool and lobe would be in phase for this job."""
    return job is not None and not problems(alignment, job)


def why_lines(
    text: Catalogue, now: Situation, width: int, height: int | None, *, reads_itself: bool = False
) -> list[Line]:
    """Return what to do now and why the alignment is not valid, or what it rests on when it is.

    `reads_itself`: there is a digital indicator on a serial line, which makes a fingerprint shorter.
    """
    offer = [] if waiting(now.state) else _offer_lines(text, now, width, reads_itself=reads_itself)
    if is_valid(now.state.alignment, now.job) and waiting(now.state) not in _NO_ADVICE:
        return _stamps(text, now, offer, width, height)
    return clip_lines([*offer, *_missing(text, now, width)], height, text("panel.more"))


def _offer_lines(text: Catalogue, now: Situation, width: int, *, reads_itself: bool) -> list[Line]:
    """Return what a fingerprint of this clamping costs and gains, where it is worth it."""
    from console.session.guide.fingerprint_offer import fingerprint_offer

    offer = fingerprint_offer(now)
    if offer is None:
        return []
    before, after = (text.units.figure(um, "um", 1) for um in (offer.now_um, offer.then_um))
    minutes = f"{offer.minutes(reads_itself=reads_itself):.0f}"
    return wrap_line(text("align_page.offer", minutes=minutes, before=before, after=after), width, Token.ACTION)


def flank_lines(text: Catalogue, alignment: Alignment, job: Job, width: int) -> list[Line]:
    """Return the readings, nothing before the first one."""
    flanks = alignment.flanks
    if not flanks:
        return []
    results = results_deg(flanks)
    rows = []
    for place, result in enumerate(results):
        first, second = flanks[2 * place : 2 * place + 2]
        rows.append(line(f"{place + 1}: {first:.2f} {second:.2f} → {result:.2f}°"))
    if len(flanks) % 2:
        rows.append(line(f"{len(results) + 1}: {flanks[-1]:.2f} …"))
    if len(results) < RESULTS:
        return [
            *rows,
            *wrap_line(text("align_page.flanks_next", count=len(flanks), of=READINGS), width, Token.STRONG),
        ]
    spread, most = spread_deg(results), allowed_spread_deg(job)
    within = most is None or spread <= most
    words = text(
        "align_page.flanks_result",
        angle=f"{mean_deg(results):.2f}°",
        spread=f"{spread:.2f}°",
        most="∞" if most is None else f"{most:.2f}°",
    )
    return [*rows, *wrap_line(words, width, Token.OK if within else Token.WARNING)]


def _missing(text: Catalogue, now: Situation, width: int) -> list[Line]:
    word, state, job = waiting(now.state), now.state, now.job
    if word in (*_NO_ADVICE, "moving"):
        free = "_free" if word == "observing" and not state.holder else ""
        return wrap_line(text(f"align_page.next.{word}{free}"), width, Token.STRONG)
    if job is None:
        return wrap_line(text("align_page.no_job"), width)
    missing = [text.problem(name_field(problem, text)) for problem in problems(state.alignment, job)]
    rows = [row for each in missing for row in hanging(dim("· "), each, width)]
    if now.step is AlignStep.JAW and state.alignment.flanks:
        return [*flank_lines(text, state.alignment, job, width), *rows]
    advice = text("align_page.next.stopped") if word == "stopped" else hint(text, now, job)
    return [*wrap_line(advice, width, Token.STRONG), *rows]


def hint(text: Catalogue, now: Situation, job: Job) -> str:
    """Return in a sentence or two how to do the present step."""
    row = row_of(ALIGN_STEPS, replace(now, state=replace(now.state, jog_enabled=True)))
    if now.step is AlignStep.CLAMP and now.must_come_out:
        return text(row.sentence)
    how = row.sentence.replace(".next.", ".hint.")
    if row.word == "align.clamp" and job.lobe_error_source not in MEASURED:
        how += "_any"
    return text(
        how,
        material=job.material,
        diameter=text.units.figure(job.diameter_mm, "mm", 3),
        radius=text.units.figure(job.radius_mm, "mm", 3),
        force=f"{job.chucking_force_n:.0f}",
        error=text.units.figure(job.lobe_error_um_pp, "um", 1),
    )


def _stamps(text: Catalogue, now: Situation, offer: list[Line], width: int, height: int | None) -> list[Line]:
    """Return what the alignment rests on; in little room the blank rows go first, then how to undo."""
    head = [*_all_taken(text, now, width), *offer]
    facts = _facts(text, now.state.alignment, min(width, WIDEST_STAMP))
    back = wrap_line(text("align_page.back"), width)
    roomy, close = [*head, BLANK, *facts, BLANK, *back], [*head, *facts, *back]
    return first_fitting(height, text("panel.more"), roomy, close, [*head, *facts])


def _all_taken(text: Catalogue, now: Situation, width: int) -> list[Line]:
    """Return that all is taken; that tool and lobe are in phase only of a lobe that is known."""
    off_deg, job = jaw_off_deg(now.state, now.machine), now.job
    knows_lobe = job is not None and job.lobe_error_source != NO_LOBE
    seen_well = off_deg is not None and off_deg <= NEAR_MARK_DEG
    if knows_lobe and (seen_well or not now.state.simulated):
        return [line(("✓ " + text("align_page.valid"), Token.OK))]
    rows = [line("✓ " + text("align_page.all_taken"))]
    if off_deg is not None and not seen_well:
        first, *rest = wrap_line(text("align_page.jaw_off", angle=f"{off_deg:z.2f}°"), width - 4, Token.WARNING)
        rows += [(("SIM", Token.SIM), dim(" "), *first), *((dim(" " * 4), *more) for more in rest)]
    return rows


def _facts(text: Catalogue, alignment: Alignment, width: int) -> list[Line]:
    """Return what was taken, when, and on what basis: after the value where there is room, else below it."""
    pairs: list[tuple[str, str]] = []
    for label, value, on, at in _list_touch_off(text, alignment):
        whole = ", ".join(filter(None, (value, on)))
        if not on or cell_len(whole) + cell_len(at) + 2 <= width - STAMP_LABEL_WIDTH:
            pairs.append((label, f"{whole}  {at}"))
        else:
            pairs += [(label, f"{value}  {at}"), ("", on)]
    return [fact(label, value, width, label_width=STAMP_LABEL_WIDTH) for label, value in pairs]


def _list_touch_off(text: Catalogue, alignment: Alignment) -> Iterator[tuple[str, str, str, str]]:
    clamping, jaw, touched = alignment.clamping, alignment.jaw, alignment.touch_off
    if clamping is not None:
        yield text("align_page.stamp.force"), f"{clamping.force_n:.0f} N", "", clamping.at
    if alignment.readings is not None:
        places = text("align_page.stamp.places", places=alignment.readings.places)
        yield text("align_page.stamp.indicator"), places, "", "" if clamping is None else clamping.at
    if jaw is not None:
        on = ", ".join(filter(None, (text("align_page.stamp.jaws", jaws=jaw.jaws), jaw.on.chuck)))
        within = "" if jaw.spread_deg is None else f" ± {jaw.spread_deg:.2f}"
        yield text("align_page.stamp.jaw"), f"{jaw.angle_deg:.2f}{within} °", on, jaw.at
    if touched is not None:
        zero, on = (
            f"R {text.units.show(touched.zero_radius_mm, 'mm', 3)}",
            f"D {text.units.format_short(touched.diameter_mm, 'mm')}",
        )
        how = text("align_page.stamp.skimmed") if touched.skimmed else ""
        on = ", ".join(filter(None, (on, how, touched.on.tool)))
        yield text("align_page.stamp.touch"), zero, on, touched.at
