"""Findings of the rules for JSON, for every command that judges a job."""

from __future__ import annotations

from console.cli.finding_lines import finding_line
from console.text.catalogue import Catalogue
from profiles.findings import Finding


def finding_fields(finding: Finding, text: Catalogue) -> dict[str, object]:
    """Return a finding with its sentence."""
    return {
        "severity": finding.severity.value,
        "code": finding.problem.code,
        "text": finding_line(finding, text),
    }
