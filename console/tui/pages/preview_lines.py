"""Text of the page Preview: captions, margins, strategies, findings; the program to be sent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from console.session.cut.alignment import Alignment
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, clip_lines, dim, hanging, justify_line, line, wrap_line
from console.tui.theme import Token
from console.units import METRIC, Units
from drivers.cutting.planning import CutPlan
from drivers.cutting.strategy import UNCOMPENSATED, Strategy
from drivers.preview.preview import ClosedForm, PartialPreview, ProgramPrediction, closed_form, worst_section
from profiles.compensations.learned_compensation import ExpectedPart
from profiles.findings import Finding, Severity
from profiles.forecast import forecast_um
from profiles.job import NO_LOBE, Job
from profiles.problem import Problem, ProblemError

MARKS = {
    Severity.REFUSAL: ("✗", Token.ALARM),
    Severity.WARNING: ("!", Token.WARNING),
    Severity.OK: ("✓", Token.OK),
}
BEFORE_KEY, AFTER_KEY = "- -", "──"  # legend symbols of a broken and a solid trace
UNKNOWN = "…"  # placeholder of a figure until its program exists
_LONGEST_BAR = 40
_LEAST_BAR = 4
_MARGIN_LABEL = 12
_SPACED_ROWS = 2


Span = tuple[float, float]
"""Limits of what is left on a part, um p-p."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """A need against its limit, as formatted: name of its label, decimals, unit; None is not known yet."""

    name: str
    need: float | None
    limit: float | None
    decimals: int
    unit: str
    units: Units = METRIC

    @property
    def value(self) -> str:
        """Both values with their unit."""
        # An unknown value takes the room of a small one.
        unknown = f"{UNKNOWN:>{len(self.units.figure(0.0, self.unit, self.decimals))}}"
        need, limit = (
            unknown if value is None else self.units.figure(value, self.unit, self.decimals)
            for value in (self.need, self.limit)
        )
        return f"{need} / {limit} {self.units.unit(self.unit)}"

    @property
    def percent(self) -> float | None:
        """The need as a percentage of the limit."""
        return None if self.need is None or self.limit is None else 100.0 * self.need / self.limit


def find_prediction(seen: PartialPreview, strategy: Strategy) -> ProgramPrediction | ClosedForm | None:
    """Return the predicted result of a strategy's program; until that exists, its closed form, if any."""
    if strategy in seen.strategies:
        return seen.predictions.get(strategy)
    return closed_form(seen, strategy)


def by_part(seen: PartialPreview, strategy: Strategy) -> ExpectedPart | None:
    """Return the prediction from a measured part for this strategy, instead of the model, if there is one."""
    return seen.taught if strategy is seen.strategy else None


def left_words(seen: PartialPreview, strategy: Strategy, units: Units) -> str:
    """Return the forecast roundness, a number: by the part that the path was learned from, else by the model."""
    left_um = calculated_um(seen, strategy)
    if left_um is None:
        return UNKNOWN if by_part(seen, strategy) is None else NOTHING
    return units.figure(forecast_um(left_um), "um", 1)


def worst_words(seen: PartialPreview, strategy: Strategy, units: Units) -> str:
    """Return the forecast roundness of the section that is left least round, a number."""
    found, left = worst_section(seen, strategy), left_words(seen, strategy, units)
    if found is None or left == NOTHING:
        return NOTHING if left == NOTHING else UNKNOWN
    return units.figure(forecast_um(found[1]), "um", 1)


def calculated_um(seen: PartialPreview, strategy: Strategy) -> float | None:
    """Return what is calculated to be left, by the part that the path was learned from or by the model, um p-p."""
    expected, made = by_part(seen, strategy), seen.predictions.get(strategy)
    if expected is not None:
        return expected.ront_um
    return None if made is None else made.ront_um


def findings_of(seen: PartialPreview, strategy: Strategy) -> tuple[Finding, ...]:
    """Return the rules that are not met, refusals first: of the job, and of this strategy's program."""
    plan, of_plan = seen.strategies.get(strategy), list[Finding]()
    if isinstance(plan, ProblemError):
        of_plan = [Finding(severity=Severity.REFUSAL, problem=problem) for problem in plan.problems]
    elif plan is not None:
        of_plan = list(plan.findings)
    unmet = [finding for finding in (*seen.findings, *of_plan) if finding.severity is not Severity.OK]
    return tuple(sorted(unmet, key=lambda finding: finding.severity is not Severity.REFUSAL))


def is_refused(seen: PartialPreview, strategy: Strategy) -> bool:
    """Whether a cut with this strategy would not be started."""
    return any(finding.severity is Severity.REFUSAL for finding in findings_of(seen, strategy))


def finding_lines(findings: Sequence[Finding], text: Catalogue, width: int) -> list[Line]:
    """Return the findings in words, each with its mark."""
    lines: list[Line] = []
    for finding in findings:
        mark, token = MARKS[finding.severity]
        lines += hanging((f"{mark} ", token), text.problem(finding.problem), width)
    return lines


def problem_lines(problems: Sequence[Problem], text: Catalogue, width: int) -> list[Line]:
    """Return why there is nothing to show, in words."""
    return finding_lines([Finding(severity=Severity.REFUSAL, problem=p) for p in problems], text, width)


def jaw_words(job: Job, alignment: Alignment, text: Catalogue) -> str:
    """Return where jaw 1 is, and whether that was found or is assumed in the job's file."""
    jaw, at = alignment.jaw, text("preview_page.jaw", angle=f"{job.jaw_1_deg:.1f}")
    found = jaw is not None and jaw.angle_deg == job.jaw_1_deg
    how = text("preview_page.jaw_found", at=jaw.at) if jaw and found else text("preview_page.jaw_assumed")
    return f"{at} {how}"


def roundness_caption(
    seen: PartialPreview,
    strategy: Strategy,
    alignment: Alignment,
    um_per_division: float,
    text: Catalogue,
    width: int,
    band: Span | None,
) -> list[Line]:
    """Return the legend of the roundness traces, with the `band` of the strategy, and their scale."""
    without, with_ = seen.predictions.get(UNCOMPENSATED), seen.predictions.get(strategy)
    lines: list[Line] = []
    if seen.job.lobe_error_source == NO_LOBE:
        words = wrap_line(text("preview_page.lobe_unknown"), width, Token.WARNING)
        return [*words, BLANK, *wrap_line(jaw_words(seen.job, alignment, text), width)]
    if without is not None or UNCOMPENSATED not in seen.strategies:
        left_um = seen.job.lobe_error_um_pp if without is None else without.ront_um
        lines += _trace_words(
            BEFORE_KEY,
            text("preview_page.without"),
            Token.BEFORE,
            text.units.figure(forecast_um(left_um), "um", 1),
            text,
            width,
        )
    if strategy.traits.follows_lobe and (with_ is not None or strategy not in seen.strategies):
        left = left_words(seen, strategy, text.units)
        lines += _trace_words(AFTER_KEY, strategy.value, Token.AFTER, left, text, width, band)
    lines.append((dim(text("preview_page.scale", value=text.units.format_short(um_per_division, "um"))),))
    return [*lines, *wrap_line(jaw_words(seen.job, alignment, text), width)]


def worst_line(seen: PartialPreview, strategy: Strategy, text: Catalogue) -> Line:
    """Return the section that is left least round, with its place; "…" until its program exists."""
    found, units = worst_section(seen, strategy), text.units
    if found is None:
        known = strategy in seen.strategies or seen.job.lobe_error_source == NO_LOBE
        return BLANK if known else line(dim(text("preview_page.worst")), f" {UNKNOWN}")
    z_mm, um = found
    place = f" Z {units.show(z_mm, 'mm', 1)}: "
    return line(dim(text("preview_page.worst")), place, (units.show(forecast_um(um), "um", 1), Token.AFTER))


def strategy_lines(
    seen: PartialPreview, strategy: Strategy, text: Catalogue, width: int, height: int
) -> list[Line]:
    """Return each strategy's remaining error, the findings against the chosen one, and its effect on the servo."""
    findings = findings_of(seen, strategy)
    lines = [_left_on_part(seen, each, strategy, text, width) for each in Strategy]
    lines.append(_findings_line(seen.strategies.get(strategy), findings, text, width))
    lines += _servo_lines(seen, strategy, text, width)
    room, words = height - len(lines), finding_lines(findings, text, width)
    if words and room > _SPACED_ROWS:
        lines += [BLANK, *clip_lines(words, room - 1, text("panel.more"))]
    return lines[: max(height, 0)]


def margins(seen: PartialPreview, strategy: Strategy, units: Units) -> tuple[Margin, ...]:
    """Return what the chosen strategy needs of the drive, against the machine's limits."""
    tool, needs = seen.machine.tool, _needs(seen, strategy)
    limits: dict[str, float | None] = {key: drive.limit for key, drive in seen.demands.items()}
    limits["stroke_mm"] = tool.travel_max_mm - tool.travel_min_mm
    limits["lobe_hz"] = seen.bandwidth_hz
    rows = (
        ("stroke", "stroke_mm", 3, "mm"),
        ("velocity", "velocity_mm_per_s", 1, "mm/s"),
        ("acceleration", "acceleration_m_per_s2", 1, "m/s2"),
        ("thrust", "force_rms_n", 1, "N"),
        ("current", "current_a", 2, "A"),
        ("loop", "lobe_hz", 1, "Hz"),
    )
    return tuple(
        Margin(name=name, need=needs.get(key), limit=limits[key], decimals=decimals, unit=unit, units=units)
        for name, key, decimals, unit in rows
    )


def _needs(seen: PartialPreview, strategy: Strategy) -> dict[str, float]:
    made = find_prediction(seen, strategy)
    if made is not None:
        stroke_um, lobe_hz, demands = made.largest_stroke_um, made.lobe_frequency_hz, made.demands
    elif strategy in seen.strategies:  # there is no program: the needs of the inverse may explain why
        stroke_um, lobe_hz, demands = 2.0 * seen.command.largest_um, seen.job.lobe_frequency_hz, seen.demands
    else:
        return {}
    of_drive = {name: drive.need for name, drive in demands.items()}
    return {"stroke_mm": stroke_um / 1000.0, "lobe_hz": lobe_hz, **of_drive}


def margin_lines(
    needs: Sequence[Margin], text: Catalogue, width: int, height: int, window: str = ""
) -> list[Line]:
    """Return the margins, with bars and spaces where there is room, then the `window` of the chucking force."""
    values = max(len(need.value) for need in needs)
    bar = min(width - _MARGIN_LABEL - values - 8, _LONGEST_BAR)
    lines: list[Line] = []
    for need in needs:
        lines.append(_margin(need, text, width, values, bar if bar >= _LEAST_BAR else 0))
        if height >= _SPACED_ROWS * len(needs) + bool(window):
            lines.append(BLANK)
    if window:
        lines.append(justify_line(line(dim(text("preview_page.force_window"))), line(f" {window}"), width))
    return lines[: max(height, 0)]


def _margin(need: Margin, text: Catalogue, width: int, values: int, bar: int) -> Line:
    percent = 0.0 if need.percent is None else need.percent
    over = percent > 100.0
    token = Token.WARNING if over else Token.TEXT
    most = bar if percent >= 100.0 else bar - 1  # a small remainder must stay visible
    filled = min(round(bar * percent / 100.0), most)
    drawn: Line = (("■" * filled, token), dim("□" * (bar - filled)), dim(" ")) if bar else ()
    shown = f"{UNKNOWN:>3}" if need.percent is None else f"{percent:3.0f}"
    right = line((f"{need.value:>{values}}", token), (f" {shown} %", token), "!" if over else " ")
    return justify_line(line(dim(text(f"preview_page.{need.name}"))), (*drawn, *right), width)


def _trace_words(
    key: str, name: str, token: Token, ront: str, text: Catalogue, width: int, band: Span | None = None
) -> list[Line]:
    head, room, unit = line((key, token), " ", name), max(width - 1, 0), text.units.unit("um")
    alone = justify_line(BLANK, line((f"{ront} {unit}", token)), room)
    if band is None:
        return [head, alone]
    span = "–".join(text.units.figure(each, "um", 1) for each in band)
    # The unit is that of the trace before it, where there is no room for another.
    for both in (f"{ront} ({span}) {unit}", f"{ront} ({span})"):
        if len(both) <= room:
            return [head, justify_line(BLANK, line((both, token)), room)]
    return [head, alone, justify_line(BLANK, line((f"({span})", token)), room)]


def _left_on_part(seen: PartialPreview, strategy: Strategy, chosen: Strategy, text: Catalogue, width: int) -> Line:
    mark, token = ("▸ ", Token.STRONG) if strategy is chosen else ("  ", Token.TEXT)
    left = line((mark, Token.ACTION), (f"{strategy.value:<9}", token), dim(text(f"strategy.{strategy}.how")))
    if is_refused(seen, strategy):
        return justify_line(left, line(("✗ " + text("preview_page.refused"), Token.ALARM)), width)
    if seen.job.lobe_error_source == NO_LOBE:
        words = text("preview_page.needs_lobe") if strategy.traits.follows_lobe else "?"
        return justify_line(left, line((f" {words}", Token.DIM)), width)
    return justify_line(
        left, line((f" {worst_words(seen, strategy, text.units)} {text.units.unit('um')}", token)), width
    )


def _findings_line(
    plan: CutPlan | ProblemError | None, findings: Sequence[Finding], text: Catalogue, width: int
) -> Line:
    if plan is None:
        return justify_line(line(dim(f"{UNKNOWN} "), text("preview_page.checking")), line(f" {UNKNOWN} s"), width)
    mark = MARKS[findings[0].severity if findings else Severity.OK]
    words = text("preview_page.findings", count=len(findings)) if findings else text("preview_page.no_findings")
    time = f" {plan.duration_s:.1f} s" if isinstance(plan, CutPlan) else ""
    return justify_line(line(mark, " ", words), line(time), width)


def _servo_lines(seen: PartialPreview, strategy: Strategy, text: Catalogue, width: int) -> list[Line]:
    plan, prediction = seen.strategies.get(strategy), seen.predictions.get(strategy)
    if isinstance(plan, ProblemError):
        return []
    made = find_prediction(seen, strategy)
    depth = UNKNOWN if prediction is None else text.units.figure(prediction.mean_um, "um", 1)
    speed = UNKNOWN if plan is None else f"{plan.spindle_speed_rpm:.0f}"
    frequency = UNKNOWN if made is None else f"{made.lobe_frequency_hz:.1f}"
    servo = UNKNOWN
    if made is not None:
        servo = f"x{made.response.gain:.3f}  {math.degrees(made.response.phase_rad):+z.1f}°"
    rows = (
        (text("preview_page.servo", frequency=frequency), servo),
        (text("preview_page.inverse"), _inverse(seen, strategy, text)),
        (text("preview_page.depth"), f"{depth} {text.units.unit('um')}"),
        (text("preview_page.speed"), f"{speed} rpm"),
    )
    return [justify_line(line(dim(label)), line(" " + value), width) for label, value in rows]


def _inverse(seen: PartialPreview, strategy: Strategy, text: Catalogue) -> str:
    if not strategy.traits.inverts or seen.target.amplitude_um == 0.0:
        return text("preview_page.not_inverted")
    if strategy is not seen.strategy:
        return UNKNOWN
    factor = seen.command.amplitude_um / seen.target.amplitude_um
    lead_deg = seen.target.phase_deg - seen.command.phase_deg
    return text("preview_page.inverted", factor=f"{factor:.3f}", lead=f"{lead_deg:.1f}")


def program_lines(text: str, width: int) -> list[Line]:
    """Return a program with numbered lines, nothing left out; a comment is dim, because it is not sent."""
    rows = text.rstrip("\n").split("\n")
    number_width = len(str(len(rows)))
    room = max(width - number_width - 1, 1)
    lines: list[Line] = []
    for number, row in enumerate(rows, start=1):
        code, mark, comment = row.partition(";")
        for start in range(0, max(len(row), 1), room):
            head = f"{number:>{number_width}} " if start == 0 else " " * (number_width + 1)
            end = start + room
            sent, remark = code[start:end], (mark + comment)[max(start - len(code), 0) : max(end - len(code), 0)]
            lines.append(line(dim(head), (sent, Token.TEXT), dim(remark)))
    return lines


def program_rows(seen: PartialPreview, strategy: Strategy, text: Catalogue, width: int) -> list[Line]:
    """Return the findings in words, then the program, if there is one."""
    found = finding_lines(findings_of(seen, strategy), text, width)
    plan = seen.strategies.get(strategy)
    if plan is None:
        return [*found, line(dim(f"{UNKNOWN} "), text("preview_page.checking"))]
    head = found or [line(("✓ ", Token.OK), text("preview_page.no_findings"))]
    return [*head, BLANK, *program_lines(plan.text, width)] if isinstance(plan, CutPlan) else head
