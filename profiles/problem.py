"""Refusals and findings as values. The words for them are the console's; here are the facts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One fact that stands in the way (or deserves attention), free of any language.

    `code` is stable and names the sentence in the text catalogues (`problem.<code>`). The other fields
    are already text with units, fit to be put into that sentence: `where` a file, axis or link address,
    `key` the field, variable or quantity, `value` what was met, `limit` what is allowed.
    """

    code: str
    where: str = ""
    key: str = ""
    value: str = ""
    limit: str = ""

    def __str__(self) -> str:
        facts = (("", self.where), ("", self.key), ("met ", self.value), ("allowed ", self.limit))
        return " · ".join([self.code, *(f"{label}{text}" for label, text in facts if text)])


class ProblemError(Exception):
    """Raised with every problem that was found, never with the first one only."""

    def __init__(self, *problems: Problem) -> None:
        super().__init__("; ".join(str(problem) for problem in problems))
        self.problems: Sequence[Problem] = problems


class ProfileError(ProblemError):
    """A job, a machine profile or a trace that cannot be used as it stands."""
