"""The verdict on a cut in words, with what the tool itself took of roundness and diameter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from console.session.cut.cut_verdict import CutJudgement, CutVerdict
from console.text.catalogue import Catalogue


def verdict_words(event: Mapping[str, Any], text: Catalogue) -> str:
    """Return the judgement as JSON and the record have it, with what the tool took; "" where none is known."""
    judgement, tool = event.get("cut_verdict"), event.get("tool")
    if judgement not in [*CutJudgement]:
        return ""
    said = text(f"cut_verdict.{judgement}")
    figures = tool if isinstance(tool, Mapping) else {}
    took = [each for name in ("roundness", "size") if isinstance(each := figures.get(f"{name}_um"), float)]
    if len(took) < 2:
        return said
    round_um, size_um = (text.units.show(each, "um", 1) for each in took)
    return f"{said} · {text('cut_verdict.tool', round=round_um, size=size_um)}"


def tool_words(verdict: CutVerdict, text: Catalogue) -> str:
    """Return what the tool took of the roundness and, at most, of the diameter; "" where the polls do not tell."""
    tool = verdict.tool
    if tool is None:
        return ""
    return f"{text.units.figure(tool.roundness_um, 'um', 1)} / {text.units.show(tool.size_um, 'um', 1)}"
