"""The verdict on a cut in words, with what the tool itself took of roundness and diameter."""

from __future__ import annotations

from console.session.cut.cut_verdict import CutVerdict
from console.text.catalogue import Catalogue


def verdict_words(verdict: CutVerdict, text: Catalogue) -> str:
    """Return the judgement; the error of the tool with its limits where the polls told it."""
    said = text(f"cut_verdict.{verdict.judgement}")
    tool = tool_words(verdict, text)
    return f"{said}: {text('cut_verdict.tool')} {tool}" if tool else said


def tool_words(verdict: CutVerdict, text: Catalogue) -> str:
    """Return what the tool took of the roundness and, at most, of the diameter; "" where the polls do not tell."""
    tool = verdict.tool
    if tool is None:
        return ""
    return f"{text.units.figure(tool.roundness_um, 'um', 1)}, {text.units.show(tool.size_um, 'um', 1)}"
