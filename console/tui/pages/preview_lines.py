"""What the page Preview says beside its plots, as lines: captions, margins, strategies, findings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from console.session.alignment import Alignment
from console.session.preview import Prediction, Preview, Response, Share
from console.session.work import STRATEGIES
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, Line, dim, line, ranged, wrapped
from console.tui.theme import Token
from drivers.cut import CutPlan, Strategy
from profiles.job import Job
from profiles.problem import Problem, ProblemError
from profiles.rules import Finding, Severity

MARKS = {
    Severity.REFUSAL: ("✗", Token.ALARM),
    Severity.WARNING: ("!", Token.WARNING),
    Severity.OK: ("✓", Token.OK),
}
BEFORE_KEY, AFTER_KEY = "- -", "──"
"""How a broken and a solid trace are written in a caption."""

_LONGEST_BAR = 40
_LEAST_BAR = 4
_MARGIN_LABEL = 12
_SPACED_ROWS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """A need against what there is, as it is written: name of its label, decimals, unit."""

    name: str
    share: Share
    decimals: int
    unit: str

    @property
    def value(self) -> str:
        """Both values with their unit."""
        return f"{self.share.need:.{self.decimals}f} / {self.share.limit:.{self.decimals}f} {self.unit}"


def findings_of(seen: Preview, strategy: Strategy) -> tuple[Finding, ...]:
    """Return what does not hold, refusals first: of the job, and of the program of this strategy."""
    plan = seen.strategies[strategy]
    if isinstance(plan, ProblemError):
        of_plan = tuple(Finding(severity=Severity.REFUSAL, problem=problem) for problem in plan.problems)
    else:
        of_plan = plan.findings
    told = [finding for finding in (*seen.findings, *of_plan) if finding.severity is not Severity.OK]
    return tuple(sorted(told, key=lambda finding: finding.severity is not Severity.REFUSAL))


def refused(seen: Preview, strategy: Strategy) -> bool:
    """Whether a cut with this strategy would not be started."""
    return any(finding.severity is Severity.REFUSAL for finding in findings_of(seen, strategy))


def finding_lines(findings: Sequence[Finding], text: Catalogue, width: int) -> list[Line]:
    """Return the findings in words, each with its mark."""
    lines: list[Line] = []
    for finding in findings:
        mark = MARKS[finding.severity]
        sentence = wrapped(text.problem(finding.problem), max(width - 2, 1))
        lines += [line(mark if row == 0 else " ", " ", *pieces) for row, pieces in enumerate(sentence)]
    return lines


def problem_lines(problems: Sequence[Problem], text: Catalogue, width: int) -> list[Line]:
    """Return why there is nothing to show, in words."""
    return finding_lines([Finding(severity=Severity.REFUSAL, problem=p) for p in problems], text, width)


def jaw_words(job: Job, alignment: Alignment, text: Catalogue) -> str:
    """Return where jaw 1 is, and whether that was found or is the assumption of the job's file."""
    at = text("preview_page.jaw", angle=f"{job.jaw_1_deg:.1f}")
    jaw = alignment.jaw
    if jaw is None or jaw.angle_deg != job.jaw_1_deg:
        return f"{at} {text('preview_page.jaw_assumed')}"
    return f"{at} {text('preview_page.jaw_found', at=jaw.at)}"


def roundness_caption(
    seen: Preview, strategy: Strategy, alignment: Alignment, um_per_division: float, text: Catalogue, width: int
) -> list[Line]:
    """Return what the traces of roundness are, and their scale."""
    without, with_ = seen.predictions.get(Strategy.NONE), seen.predictions.get(strategy)
    lines: list[Line] = []
    if without is not None:
        lines += _trace_words(BEFORE_KEY, text("preview_page.without"), Token.BEFORE, without.ront_um, width)
    if with_ is not None and strategy is not Strategy.NONE:
        lines += _trace_words(AFTER_KEY, strategy.value, Token.AFTER, with_.ront_um, width)
    lines.append((dim(text("preview_page.scale", value=f"{um_per_division:g}")),))
    return [*lines, *wrapped(jaw_words(seen.job, alignment, text), width)]


def strategy_lines(seen: Preview, strategy: Strategy, text: Catalogue, width: int, height: int) -> list[Line]:
    """Return what each strategy leaves, what is found against the chosen one, and what it makes of the servo."""
    lines = [_left_on_part(seen, Strategy(name), strategy, text, width) for name in STRATEGIES]
    findings = findings_of(seen, strategy)
    lines.append(_found(seen.strategies[strategy], findings, text, width))
    prediction = seen.predictions.get(strategy)
    if prediction is not None:
        lines += _servo_lines(seen, strategy, prediction, text, width)
    room = height - len(lines)
    words = finding_lines(findings, text, width)
    if words and room > _SPACED_ROWS:
        shown = words if len(words) < room else [*words[: room - 2], line(dim("…"))]
        lines += [BLANK, *shown]
    return lines[: max(height, 0)]


def margins(seen: Preview, strategy: Strategy) -> tuple[Margin, ...]:
    """Return what the chosen strategy needs of the drive, against what the machine has."""
    prediction, tool = seen.predictions.get(strategy), seen.machine.tool
    stroke_um = 2.0 * seen.command.amplitude_um if prediction is None else prediction.stroke_um
    lobe_hz = seen.job.lobe_frequency_hz if prediction is None else prediction.lobe_frequency_hz
    shares = seen.shares if prediction is None else prediction.shares
    stroke = Share(need=stroke_um / 1000.0, limit=tool.travel_max_mm - tool.travel_min_mm)
    loop = Share(need=lobe_hz, limit=seen.eq9_loop.bandwidth_hz)
    return (
        Margin(name="stroke", share=stroke, decimals=3, unit="mm"),
        Margin(name="velocity", share=shares["velocity_mm_per_s"], decimals=1, unit="mm/s"),
        Margin(name="acceleration", share=shares["acceleration_m_per_s2"], decimals=1, unit="m/s2"),
        Margin(name="thrust", share=shares["force_rms_n"], decimals=1, unit="N"),
        Margin(name="current", share=shares["current_a"], decimals=2, unit="A"),
        Margin(name="loop", share=loop, decimals=1, unit="Hz"),
    )


def margin_lines(needs: Sequence[Margin], text: Catalogue, width: int, height: int) -> list[Line]:
    """Return the margins with bars, spaced where there is room; a narrow panel gives up the bars."""
    values = max(len(need.value) for need in needs)
    bar = min(width - _MARGIN_LABEL - values - 8, _LONGEST_BAR)
    lines: list[Line] = []
    for need in needs:
        lines.append(_margin(need, text, width, values, bar if bar >= _LEAST_BAR else 0))
        if height >= _SPACED_ROWS * len(needs):
            lines.append(BLANK)
    return lines[: max(height, 0)]


def _margin(need: Margin, text: Catalogue, width: int, values: int, bar: int) -> Line:
    over = need.share.percent > 100.0
    token = Token.WARNING if over else Token.TEXT
    most = bar if need.share.percent >= 100.0 else bar - 1  # what is left may be small, but it is there
    filled = min(round(bar * need.share.percent / 100.0), most)
    drawn: Line = (("■" * filled, token), dim("□" * (bar - filled)), dim(" ")) if bar else ()
    right = line(
        (f"{need.value:>{values}}", token), (f" {need.share.percent:3.0f} %", token), "!" if over else " "
    )
    return ranged(line(dim(text(f"preview_page.{need.name}"))), (*drawn, *right), width)


def _trace_words(key: str, name: str, token: Token, ront_um: float, width: int) -> list[Line]:
    return [line((key, token), " ", name), ranged(BLANK, line((f"{ront_um:.1f} um", token)), max(width - 1, 0))]


def _left_on_part(seen: Preview, strategy: Strategy, chosen: Strategy, text: Catalogue, width: int) -> Line:
    """One strategy with what it leaves."""
    prediction = seen.predictions.get(strategy)
    mine = strategy is chosen
    left = line(
        ("▸ " if mine else "  ", Token.ACTION),
        (f"{strategy.value:<9}", Token.STRONG if mine else Token.TEXT),
        dim(text(f"preview_page.how.{strategy}")),
    )
    if prediction is None or refused(seen, strategy):
        return ranged(left, line(("✗ " + text("preview_page.refused"), Token.ALARM)), width)
    return ranged(left, line((f" {prediction.ront_um:.1f} um", Token.STRONG if mine else Token.TEXT)), width)


def _found(plan: CutPlan | ProblemError, findings: Sequence[Finding], text: Catalogue, width: int) -> Line:
    """How many findings there are, and how long the program runs."""
    mark = MARKS[findings[0].severity if findings else Severity.OK]
    words = text("preview_page.findings", count=len(findings)) if findings else text("preview_page.no_findings")
    time = f" {plan.duration_s:.1f} s" if isinstance(plan, CutPlan) else ""
    return ranged(line(mark, " ", words), line(time), width)


def _servo_lines(
    seen: Preview, strategy: Strategy, prediction: Prediction, text: Catalogue, width: int
) -> list[Line]:
    """The servo at the lobe frequency, its inverse, and what the program does besides."""
    frequency = f"{prediction.lobe_frequency_hz:.1f}"
    plan = seen.strategies[strategy]
    rows = [
        (text("preview_page.servo", frequency=frequency), _gain_and_phase(prediction.response)),
        (text("preview_page.inverse"), _inverse(seen, strategy, text)),
        (text("preview_page.depth"), f"{prediction.mean_um:.1f} um"),
    ]
    if isinstance(plan, CutPlan):
        rows.append((text("preview_page.speed"), f"{plan.spindle_speed_rpm:.0f} rpm"))
    return [ranged(line(dim(label)), line(" " + value), width) for label, value in rows]


def _gain_and_phase(response: Response) -> str:
    return f"x{response.gain:.3f}  {math.degrees(response.phase_rad):+.1f}°"


def _inverse(seen: Preview, strategy: Strategy, text: Catalogue) -> str:
    if strategy is not Strategy.PVT or seen.wanted.amplitude_um == 0.0:
        return text("preview_page.not_inverted")
    factor = seen.command.amplitude_um / seen.wanted.amplitude_um
    lead_deg = seen.wanted.crest_deg - seen.command.crest_deg
    return text("preview_page.inverted", factor=f"{factor:.3f}", lead=f"{lead_deg:.1f}")
