"""Findings of the rules as lines for people, for every command that judges a job."""

from __future__ import annotations

from collections.abc import Iterable

from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.findings import Finding, Severity

MARKS = {Severity.OK: "✓", Severity.NOTICE: "·", Severity.WARNING: "!", Severity.REFUSAL: "✗"}


def finding_lines(findings: Iterable[Finding], text: Catalogue) -> list[str]:
    """Return one line for each finding: mark, name, actual value, limit."""
    rows = [
        (MARKS[f.severity], text(f"name.{f.problem.code}"), f.problem.value, f.problem.limit) for f in findings
    ]
    return table(rows)


def finding_line(finding: Finding, text: Catalogue) -> str:
    """Return a sentence; for a rule that is met only its name, value and limit."""
    problem = finding.problem
    if finding.severity is Severity.OK:
        return f"{text(f'name.{problem.code}')}: {problem.value} ({problem.limit})"
    return text.problem(problem)
