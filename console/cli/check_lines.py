"""Checks of a controller as lines for people, and as values for programs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from console.cli.card_access import Card
from console.cli.output import MARKS
from console.text.catalogue import Catalogue
from console.text.columns import broken
from drivers.commissioning.check import Check, Group
from profiles.findings import Severity
from profiles.machine import iron_problems

WIDTH = 80

_OUTCOMES = {
    Severity.OK: "holds",
    Severity.NOTICE: "noted",
    Severity.WARNING: "warned",
    Severity.REFUSAL: "fails",
}
"""How the JSON of checks names a severity."""


def check_lines(checks: Sequence[Check], text: Catalogue) -> list[str]:
    """Return the checks by their groups, a mark in front of each; what is long goes on below itself."""
    lines: list[str] = []
    group = None
    for check in checks:
        if check.group != group:
            group = check.group
            lines += ["", text(f"card.group.{group}")]
        first, *others = broken(sentence(check, text), WIDTH - 4)
        lines.append(f"  {MARKS[check.severity]} {first}")
        lines += [f"    {line}" for line in others]
    return lines


def sentence(check: Check, text: Catalogue) -> str:
    """Return what is to be said of a check."""
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


def summary(checks: Iterable[Check], text: Catalogue) -> str:
    """Return how many there are of each severity."""
    severities = [check.severity for check in checks]
    return text(
        "card.summary",
        holds=severities.count(Severity.OK),
        failed=severities.count(Severity.REFUSAL),
        warned=severities.count(Severity.WARNING),
        noted=severities.count(Severity.NOTICE),
    )


def check_fields(checks: Iterable[Check], text: Catalogue) -> list[dict[str, object]]:
    """Return the checks for JSON."""
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
            "text": sentence(check, text),
        }
        for check in checks
    ]


def _subject(subject: str, text: Catalogue) -> str:
    """Return whose it is, in the operator's language; `motor 5` has a number of its own."""
    kind, _, number = subject.partition(" ")
    return text(f"card.subject.{kind}", number=number) if kind else ""


def _what(check: Check, subject: str, text: Catalogue) -> str:
    if not check.setting:
        return check.variable
    setting = text(f"setting.{check.setting}")
    if not subject:
        return text("card.what_alone", setting=setting, variable=check.variable)
    return text("card.what", setting=setting, subject=subject, variable=check.variable)


def signature_checks(card: Card) -> list[Check]:
    """Return what fails where the profile of a simulated lathe meets a real link; nothing where all is well."""
    if card.simulated:
        return []
    return [
        Check(
            group=Group.SAFETY,
            code=problem.code.partition(".")[2],
            severity=Severity.REFUSAL,
            found=problem.value,
            wanted=problem.limit,
        )
        for problem in iron_problems(card.machine)
    ]
