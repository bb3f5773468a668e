"""The verdict of a run in words, with a sign that needs no colour."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from console.report.quantities import against_limit, mm, um
from console.session.cut.cut_verdict import CutJudgement
from console.session.data.run_rows import FAILED_HOW, RunOutcome
from console.session.learning.opened_run import OpenedRun
from console.session.stages import Stage
from console.text.catalogue import Catalogue
from console.text.part_sentences import judged_words, place_words, rule_words, u_words
from console.text.recorded_words import Layout, ending_words
from profiles.metrology.conformity import ToleranceKind


class Judgement(StrEnum):
    """Verdict of a report on a part."""

    GOOD = "good"
    BAD = "bad"
    DOUBTFUL = "doubtful"
    OPEN = "open"


FIGURES = ("roundness", "size")
_WORDS = {
    ToleranceKind.ROUNDNESS: "round",
    ToleranceKind.CYLINDRICITY: "cylindrical",
    ToleranceKind.DIAMETER: "diameter",
}
SIGNS = {Judgement.GOOD: "✓", Judgement.BAD: "✗", Judgement.DOUBTFUL: "?", Judgement.OPEN: "–"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportVerdict:
    """A judgement with its reasons as sentences."""

    judgement: Judgement
    reasons: tuple[str, ...]


def judge_run(run: OpenedRun, text: Catalogue) -> ReportVerdict:
    """Return the verdict of a run: a part is good only if it was cut as planned, and the record agrees."""
    row, product = run.story.row, run.product
    judged = tuple(_list_verdict_reasons(run, text))
    contradiction = run.contradicts_itself or (product is not None and run.doubts(product))
    if row.damaged or run.story.damaged or contradiction:
        return ReportVerdict(judgement=Judgement.DOUBTFUL, reasons=(text("report.why.doubtful"), *judged))
    if row.ended.how in FAILED_HOW | {RunOutcome.OPEN, RunOutcome.NOT_STARTED}:
        ended = ending_words(row.ended, text, Layout.REPORT)
        judgement = Judgement.BAD if row.ended.how in FAILED_HOW else Judgement.OPEN
        return ReportVerdict(judgement=judgement, reasons=(ended, *judged))
    if product is None:
        why = "report.why.air" if row.stage == Stage.AIR else "report.why.not_measured"
        return ReportVerdict(judgement=Judgement.OPEN, reasons=(text(why),))
    passed = product.passed
    if passed is None:
        unproven = run.story.cut_verdict.get("cut_verdict") == CutJudgement.NOT_PROVEN
        if any(each.is_open for each in product.judged) and not unproven and row.stage != Stage.PARTIAL:
            return ReportVerdict(judgement=Judgement.OPEN, reasons=judged)
        open_for = "report.why.no_length" if product.is_good is None else "report.why.no_judgement"
        open_for = "report.why.no_sections" if product.ront_um is None else open_for
        open_for = "report.why.not_proven" if unproven else open_for
        why = "report.why.partial" if row.stage == Stage.PARTIAL else open_for
        return ReportVerdict(judgement=Judgement.OPEN, reasons=(text(why), *judged))
    return ReportVerdict(judgement=Judgement.GOOD if passed else Judgement.BAD, reasons=judged)


def _list_verdict_reasons(run: OpenedRun, text: Catalogue) -> Iterator[str]:
    """Yield each measured value against its limit."""
    recorded = run.product
    if recorded is None:
        return
    is_open = any(each.is_open for each in recorded.judged)
    if recorded.passed is None and recorded.ront_um is not None and not is_open:
        return
    for each in recorded.judged:
        if each.is_open:
            yield judged_words(each, text)
        elif each.value_um is not None:
            value, limit = against_limit(abs(each.value_um), each.limit_um)
            diameter = mm((recorded.nominal_diameter_mm or 0.0) + each.value_um / 1000.0)
            key = f"report.why.{'' if each.passes else 'not_'}{_WORDS[each.kind]}"
            value += u_words(each, text)
            said = text(key, diameter=diameter, value=value, limit=limit, at=place_words(each.z_mm, text))
            yield f"{said} ({rule_words(each, text)})"
    yield from _tool(run.story.cut_verdict, text)


def _tool(found: Mapping[str, Any], text: Catalogue) -> Iterator[str]:
    """Yield each tool error that exceeds its fraction of the tolerance."""
    tool = found.get("tool")
    if found.get("cut_verdict") == CutJudgement.TOOL_ERROR and isinstance(tool, Mapping):
        for name in FIGURES:
            off_um, limit_um = tool.get(f"{name}_um"), tool.get(f"{name}_limit_um")
            if isinstance(off_um, float) and isinstance(limit_um, float) and off_um > limit_um:
                yield text(f"report.why.tool_{name}", value=um(off_um), limit=um(limit_um))
