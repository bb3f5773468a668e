"""The outcome of a judgement: one scale of severity, and one type for a judged condition with its problem."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from profiles.problem import Problem


class Severity(StrEnum):
    """A refusal stops the work, warning and notice are for the operator, ok is a condition that is met."""

    OK = "ok"
    NOTICE = "notice"
    WARNING = "warning"
    REFUSAL = "refusal"

    @property
    def rank(self) -> int:
        """Its rank on the scale: the higher, the worse."""
        return list(Severity).index(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """The outcome of one rule; the problem carries the numbers also where the rule passes."""

    severity: Severity
    problem: Problem


def judge_condition(holds: bool, problem: Problem, otherwise: Severity = Severity.REFUSAL) -> Finding:
    """Return the finding of a condition: ok where it holds, else of the severity `otherwise`."""
    return Finding(severity=Severity.OK if holds else otherwise, problem=problem)


class HasSeverity(Protocol):
    """Anything with a severity."""

    @property
    def severity(self) -> Severity:
        """How bad it is."""


def worst(judged: Iterable[HasSeverity]) -> Severity:
    """Return the worst severity; nothing judged is ok."""
    return max((each.severity for each in judged), key=lambda each: each.rank, default=Severity.OK)


def refusals(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings that stop the work."""
    return tuple(finding for finding in findings if finding.severity is Severity.REFUSAL)
