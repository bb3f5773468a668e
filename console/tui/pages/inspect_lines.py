"""Text of the page Inspect: the part before and after compensation, compared and in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from console.session.station.state import MeasuredPart, StationState
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, Piece, clipped, dim, fitted, hanging, line, ranged, wrapped
from console.tui.pages.preview_lines import AFTER_KEY, BEFORE_KEY
from console.tui.pages.stop_lines import mark_lines
from console.tui.theme import Token
from profiles.compensations.path import free_state_lobe
from profiles.job import Job
from profiles.lobe.lobe_origin import without_lobe
from profiles.roundness import RoundnessResult, centred_profile

FloatArray = NDArray[np.float64]
FRONT_MULTIPLES = 3  # multiples of the number of jaws that are listed before the other harmonics
LEAST_PHASED_UM_PP = 0.1  # amplitude below which the phase of a lobe is not shown
_COLUMN = 9
_TURN_DEG = np.arange(360.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """One of the two parts, at angles with jaw 1 of the page, um; the lobe that the job states has no `result`."""

    angle_deg: FloatArray
    profile_um: FloatArray
    ront_um: float
    result: RoundnessResult | None
    jaw_1_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """The last part against the same part without compensation; `after` is None when that was the last part."""

    part: MeasuredPart
    before: Side
    after: Side | None


def compared(state: StationState) -> Comparison | None:
    """Return the comparison of the last measured part, None when nothing is measured."""
    part, plain = state.measured, state.uncompensated
    if part is None:
        return None
    if not part.strategy.traits.follows_lobe:
        return Comparison(part=part, before=_measured(part, part.jaw_1_deg), after=None)
    before = _stated(part)
    if plain is not None and _as_cut(plain.job) == _as_cut(part.job):
        before = _measured(plain, part.jaw_1_deg)
    return Comparison(part=part, before=before, after=_measured(part, part.jaw_1_deg))


def _as_cut(job: Job) -> Job:
    """Return what a plain cut of a job depends on: all but its name, and what its file says of the lobe."""
    return replace(without_lobe(job), name="", lobe_phase_deg=0.0, assumed=(), source="", copied_from=None)


def named(result: RoundnessResult, text: Catalogue) -> str:
    """Return the state, circle and filter that apply to all figures of a result."""
    upr = result.filter_upr
    filtered = text("inspect_page.filtered", upr=f"{upr:g}") if upr else text("inspect_page.unfiltered")
    return " · ".join((text(f"state.{result.state}"), result.reference_circle, filtered))


def caption_lines(seen: Comparison, um_per_division: float, text: Catalogue, width: int) -> list[Line]:
    """Return the legend of the traces, their scale, and where jaw 1 is."""
    before, after = seen.before, seen.after
    what = text("inspect_page.measured_before") if before.result else text("inspect_page.stated")
    lines = [_trace_words((BEFORE_KEY, Token.BEFORE), what, before.ront_um, width)]
    if after is not None:
        how = text("inspect_page.measured_after", strategy=seen.part.strategy.value)
        lines.append(_trace_words((AFTER_KEY, Token.AFTER), how, after.ront_um, width))
    angle = f"{seen.part.jaw_1_deg:.1f}"
    jaw = text("inspect_page.jaw", angle=angle) if seen.part.phase_known else text("inspect_page.jaw_unknown")
    scale = text("inspect_page.scale", value=f"{um_per_division:g}")
    lines.append(ranged(line(dim(jaw)), line(dim(" " + scale)), width))
    return lines


def wrong_lines(part: MeasuredPart, text: Catalogue, width: int) -> list[Line]:
    """Return the defects of a measured part: marks of stops, warnings of its evaluation."""
    lines = mark_lines(text, part.marks_mm, width, "inspect_page")
    for problem in part.result.warnings:
        lines += hanging(("! ", Token.WARNING), text.problem(problem), width, Token.WARNING)
    return lines


def result_lines(seen: Comparison, simulated: bool, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the table of both parts and the verdict; in little room lesser figures go, not the defects."""
    before, after = seen.before, seen.after.result if seen.after else None
    ront = _columns("RONt", f"{before.ront_um:.2f}", _figure(after, "ront_um"), width, Token.STRONG)
    head = [_heading(text, width), ront, *_diameter(seen.part, text, width)]
    lesser = [
        _columns(name, _figure(before.result, key), _figure(after, key), width, Token.TEXT)
        for name, key in (("RONp", "ronp_um"), ("RONv", "ronv_um"), ("RONq", "ronq_um"))
    ]
    gained, lines = _gained(seen, text, width), _verdict(seen, text, width)
    if simulated:
        lines += wrapped(text("inspect_page.simulated"), width, Token.SIM)
    spare = height - len(head) - len(lesser) - len(gained) - len(lines)
    if spare > 1 and before.result is None and seen.after is not None:
        lines += [BLANK, *wrapped(text("inspect_page.stated_long"), width, Token.DIM)]
    wrong = wrong_lines(seen.part, text, width)
    room = height - len(head) - len(gained) - len(lines) - len(wrong)
    if room < 0:
        gained = []
    return clipped([*head, *lesser[: max(room, 0)], *gained, *lines, *wrong], height, text("panel.more"))


def _diameter(part: MeasuredPart, text: Catalogue, width: int) -> list[Line]:
    """Return the mean diameter and how far the tool has to move for the nominal one; nothing without a size."""
    offset_um = part.tool_offset_um
    if offset_um is None:
        return []
    name = text("inspect_page.diameter_taken" if part.offset_taken else "inspect_page.diameter")
    return [
        ranged(line(dim(name)), line(f" {part.diameter_mm:.3f} ", (f"{offset_um:+.1f} um", Token.STRONG)), width)
    ]


def harmonic_lines(seen: Comparison, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the harmonics of both parts, those of the jaws first, and the phase of the lobe from jaw 1."""
    jaws, result = seen.part.job.jaws, seen.part.result
    known = [harmonic.n for harmonic in result.harmonics]
    front = [jaws * multiple for multiple in range(1, FRONT_MULTIPLES + 1) if jaws * multiple in known]
    # In the least room the heading is that of the table above.
    lines = [_heading(text, width)] if height > len(front) + 1 else []
    lines += [_harmonic(seen, n, text, width, Token.STRONG) for n in front]
    lines.append(_phases(seen, jaws, text, width))
    lines += [_harmonic(seen, n, text, width, Token.DIM) for n in known if n not in front]
    return lines[: max(height, 0)]


def phase_from_jaw_deg(side: Side, n: int) -> float | None:
    """Return the phase of harmonic `n` from jaw 1, signed; None where it is not meaningful."""
    if side.result is None or side.jaw_1_deg is None:
        return None
    found = next((harmonic for harmonic in side.result.harmonics if harmonic.n == n), None)
    if found is None or 2.0 * found.amplitude_um < LEAST_PHASED_UM_PP:
        return None
    return math.remainder(found.phase_deg - side.jaw_1_deg, 360.0 / n)


def _measured(part: MeasuredPart, jaw_1_deg: float) -> Side:
    """Return a measured part, turned so that its jaw 1 is at an angle; unequal angles stay unfiltered."""
    trace, result = part.trace, part.result
    return Side(
        angle_deg=trace.angle_deg + (jaw_1_deg - part.jaw_1_deg),
        profile_um=centred_profile(trace.angle_deg, trace.deviation_um, result.filter_upr),
        ront_um=result.ront_um,
        result=result,
        jaw_1_deg=part.jaw_1_deg if part.phase_known else None,
    )


def _stated(part: MeasuredPart) -> Side:
    past_deg = part.job.lobe_past_jaw_deg or 0.0
    lobe = free_state_lobe(replace(part.job, lobe_phase_deg=part.jaw_1_deg + past_deg))
    return Side(
        angle_deg=_TURN_DEG,
        profile_um=lobe.at_um(_TURN_DEG),
        ront_um=part.job.lobe_error_um_pp,
        result=None,
        jaw_1_deg=part.jaw_1_deg,
    )


def _trace_words(key: Piece, what: str, ront_um: float, width: int) -> Line:
    return ranged(line(key, " ", what), line((f" {ront_um:.2f} um", key[1])), width)


def _figure(result: RoundnessResult | None, key: str) -> str:
    return NOTHING if result is None else f"{getattr(result, key):.2f}"


def _heading(text: Catalogue, width: int) -> Line:
    return _columns("um", text("inspect_page.before"), text("inspect_page.after"), width, Token.DIM)


def _columns(name: str, before: str, after: str, width: int, token: Token) -> Line:
    """Return one row of a table: a name, and two values in columns of cells."""
    values = "".join(text for value in (before, after) for text, _ in ranged(BLANK, line(value), _COLUMN))
    return ranged(line(dim(name)), line((values, token)), width)


def _gained(seen: Comparison, text: Catalogue, width: int) -> list[Line]:
    if seen.after is None or seen.before.ront_um == 0.0:
        return []
    percent = 100.0 * (seen.before.ront_um - seen.after.ront_um) / seen.before.ront_um
    label = text("inspect_page.improvement") if seen.before.result else text("inspect_page.improvement_stated")
    return [ranged(line(dim(label)), line(f" {percent:.1f} %"), width)]


def _verdict(seen: Comparison, text: Catalogue, width: int) -> list[Line]:
    return [*_roundness_verdict(seen, text, width), *_diameter_verdict(seen.part, text, width)]


def _diameter_verdict(part: MeasuredPart, text: Catalogue, width: int) -> list[Line]:
    """Return whether the diameter is within its tolerance; nothing without one, or without the size."""
    passes = part.diameter_passes
    if passes is None:
        return []
    word = "diameter_pass" if passes else "diameter_fail"
    facts = {"value": f"{part.diameter_mm:.3f}", "limit": f"{part.job.diameter_tolerance_um:g}"}
    return [_judged(text(f"inspect_page.{word}", **facts), passes, width)]


def _judged(words: str, passes: bool, width: int) -> Line:
    mark, token = ("✓ ", Token.STRONG) if passes else ("✗ ", Token.WARNING)
    return line((mark + fitted(words, max(width - 2, 0)), token))


def _roundness_verdict(seen: Comparison, text: Catalogue, width: int) -> list[Line]:
    if seen.part.is_half:
        return [line(dim(fitted(f"· {text('inspect_page.half')}", width)))]
    ront_um, limit_um = seen.part.result.ront_um, seen.part.job.roundness_tolerance_um
    facts = {"value": f"{ront_um:.2f}", "limit": f"{limit_um:.2f}"}
    passes = ront_um <= limit_um
    words = text("inspect_page.pass", **facts) if passes else text("inspect_page.fail", **facts)
    return [_judged(words, passes, width)]


def _harmonic(seen: Comparison, n: int, text: Catalogue, width: int, token: Token) -> Line:
    jaws, before = seen.part.job.jaws, seen.before
    if before.result is not None:
        one = f"{2.0 * before.result.amplitude_um(n):.2f}"
    else:
        one = f"{before.ront_um:.2f}" if n == jaws else NOTHING
    after = seen.after.result if seen.after else None
    other = NOTHING if after is None else f"{2.0 * after.amplitude_um(n):.2f}"
    return _columns(text("inspect_page.harmonic", n=f"{n:>2}"), one, other, width, token)


def _phases(seen: Comparison, jaws: int, text: Catalogue, width: int) -> Line:
    phases = (phase_from_jaw_deg(side, jaws) if side else None for side in (seen.before, seen.after))
    before, after = (NOTHING if phase is None else f"{phase:+z.1f}°" for phase in phases)
    return _columns(text("inspect_page.phase", n=jaws), before, after, width, Token.TEXT)
