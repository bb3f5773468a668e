"""Findings for people and for JSON, wherever a command judges a job."""

from __future__ import annotations

from collections.abc import Iterable

from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.rules import Finding, Severity

MARKS = {Severity.OK: "✓", Severity.WARNING: "!", Severity.REFUSAL: "✗"}


def finding_rows(findings: Iterable[Finding], text: Catalogue) -> list[str]:
    """Return one line for each finding: mark, name, what was met, what is allowed."""
    rows = [
        (MARKS[f.severity], text(f"name.{f.problem.code}"), f.problem.value, f.problem.limit) for f in findings
    ]
    return table(rows)


def finding_fields(finding: Finding, text: Catalogue) -> dict[str, object]:
    """Return a finding for JSON; one that holds has no sentence but its name and numbers."""
    problem = finding.problem
    held = f"{text(f'name.{problem.code}')}: {problem.value} ({problem.limit})"
    return {
        "severity": finding.severity.value,
        "code": problem.code,
        "text": held if finding.severity is Severity.OK else text.problem(problem),
    }
