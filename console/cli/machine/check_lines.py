"""Checks of a controller as lines for people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from console.cli.finding_lines import MARKS
from console.text.catalogue import Catalogue
from console.text.columns import broken
from drivers.commissioning.check import Check
from profiles.findings import Severity

WIDTH = 80


def check_lines(checks: Sequence[Check], text: Catalogue) -> list[str]:
    """Return the checks by group, each with a mark; long lines continue below."""
    lines: list[str] = []
    group = None
    for check in checks:
        if check.group != group:
            group = check.group
            lines += ["", text(f"card.group.{group}")]
        first, *others = broken(check_line(check, text), WIDTH - 4)
        lines.append(f"  {MARKS[check.severity]} {first}")
        lines += [f"    {line}" for line in others]
    return lines


def check_line(check: Check, text: Catalogue) -> str:
    """Return the sentence for a check."""
    key = f"check.{check.code}"
    if check.severity is Severity.OK:
        key += ".holds"
    subject = _subject(check.subject, text)
    facts = {
        "what": _what(check, subject, text),
        "subject": subject,
        "variable": check.variable,
        "found": text.words(check.found) if check.code.endswith("_faults") else check.found,
        "wanted": check.wanted,
        **check.facts,
    }
    if check.setting:
        facts["effect"] = text(f"setting.{check.setting}.effect")
        facts["remedy"] = text(f"remedy.{check.facts['nature']}")
    return text(key, **facts)


def summary_line(checks: Iterable[Check], text: Catalogue) -> str:
    """Return the number of checks of each severity."""
    severities = [check.severity for check in checks]
    return text(
        "card.summary",
        holds=severities.count(Severity.OK),
        failed=severities.count(Severity.REFUSAL),
        count=severities.count(Severity.WARNING),
        noted=severities.count(Severity.NOTICE),
    )


def _subject(subject: str, text: Catalogue) -> str:
    """Return the subject of a check in the operator's language; `motor 5` keeps its number."""
    kind, _, number = subject.partition(" ")
    return text(f"card.subject.{kind}", number=number) if kind else ""


def _what(check: Check, subject: str, text: Catalogue) -> str:
    if not check.setting:
        return check.variable
    setting = text(f"setting.{check.setting}")
    if not subject:
        return text("card.what_alone", setting=setting, variable=check.variable)
    return text("card.what", setting=setting, subject=subject, variable=check.variable)
