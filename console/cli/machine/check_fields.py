"""Checks of a controller for JSON."""

from __future__ import annotations

from collections.abc import Iterable

from console.cli.machine.check_lines import check_line
from console.text.catalogue import Catalogue
from drivers.commissioning.check import Check
from profiles.findings import Severity

_OUTCOMES = {
    Severity.OK: "holds",
    Severity.NOTICE: "noted",
    Severity.WARNING: "warned",
    Severity.REFUSAL: "fails",
}
"""JSON names of the severities of checks."""


def check_fields(checks: Iterable[Check], text: Catalogue) -> list[dict[str, object]]:
    """Return the checks, each with its sentence."""
    return [
        {
            "group": check.group.value,
            "code": check.code,
            "outcome": _OUTCOMES[check.severity],
            "subject": check.subject,
            "setting": check.setting,
            "variable": check.variable,
            "found": check.found,
            "wanted": check.wanted,
            "facts": dict(check.facts),
            "text": check_line(check, text),
        }
        for check in checks
    ]
