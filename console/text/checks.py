"""Checks of a controller for people and for JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import groupby

from console.text.catalogue import Catalogue
from console.text.columns import wrap_text
from drivers.commissioning.check import Check
from profiles.findings import Severity

WIDTH = 80
MARKS = {Severity.OK: "✓", Severity.NOTICE: "·", Severity.WARNING: "!", Severity.REFUSAL: "✗"}

_OUTCOMES = {Severity.OK: "holds", Severity.NOTICE: "noted", Severity.WARNING: "warned", Severity.REFUSAL: "fails"}
"""JSON names of the severities of checks."""


def check_fields(checks: Iterable[Check], text: Catalogue) -> list[dict[str, object]]:
    """Return the checks, each with its sentence."""
    return [
        {
            "group": check.group.value,
            "code": check.code,
            "outcome": _OUTCOMES[check.severity],
            **{name: getattr(check, name) for name in ("subject", "setting", "variable", "found", "wanted")},
            "facts": dict(check.facts),
            "text": _sentence(check, text),
        }
        for check in checks
    ]


def check_lines(checks: Iterable[Check], text: Catalogue) -> list[str]:
    """Return the checks by group, each with a mark; long lines continue below."""
    lines: list[str] = []
    for group, members in groupby(checks, key=lambda check: check.group):
        lines += ["", text(f"configuration.group.{group}")]
        for check in members:
            first, *others = wrap_text(_sentence(check, text), WIDTH - 4)
            lines += [f"  {MARKS[check.severity]} {first}", *(f"    {line}" for line in others)]
    return lines


def summary_line(checks: Iterable[Check], text: Catalogue) -> str:
    """Return the number of checks of each severity."""
    counts = Counter(check.severity for check in checks)
    return text(
        "configuration.summary",
        holds=counts[Severity.OK],
        failed=counts[Severity.REFUSAL],
        count=counts[Severity.WARNING],
        noted=counts[Severity.NOTICE],
    )


def _sentence(check: Check, text: Catalogue) -> str:
    kind, _, number = check.subject.partition(" ")
    subject = text(f"configuration.subject.{kind}", number=number) if kind else ""  # `motor 5` keeps its number
    facts = {
        "what": _describe_setting(check, subject, text),
        "subject": subject,
        "variable": check.variable,
        "found": text.words(check.found) if check.code.endswith(("_faults", "_lost")) else check.found,
        "wanted": check.wanted,
        **check.facts,
    }
    if check.setting:
        facts["effect"] = text(f"setting.{check.setting}.effect")
        facts["remedy"] = text(f"remedy.{check.facts['nature']}")
    return text(f"check.{check.code}{'.holds' if check.severity is Severity.OK else ''}", **facts)


def _describe_setting(check: Check, subject: str, text: Catalogue) -> str:
    if not check.setting:
        return check.variable
    setting = text(f"setting.{check.setting}")
    if not subject:
        return text("configuration.what_alone", setting=setting, variable=check.variable)
    return text("configuration.what", setting=setting, subject=subject, variable=check.variable)
