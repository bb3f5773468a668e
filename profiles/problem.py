"""Refusals and findings as values: the facts are here, their wording is with the package that raises them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """One fact that prevents something (or deserves attention), independent of any language.

    `code` is stable and names the sentence in the words of its package (`problem.<code>`). The other fields
    are already text with units, fit to be put into that sentence: `where` a file, axis or link address,
    `key` the field, variable or quantity, `value` the actual value, `limit` what is allowed.
    """

    code: str
    where: str = ""
    key: str = ""
    value: str = ""
    limit: str = ""

    @property
    def facts(self) -> str:
        """The code and the facts, for a log."""
        facts = (("", self.where), ("", self.key), ("actual ", self.value), ("allowed ", self.limit))
        return " · ".join([self.code, *(f"{label}{text}" for label, text in facts if text)])

    def __str__(self) -> str:
        """Return the English sentence: what, where, value, limit and remedy."""
        # Words are loaded on first use: most problems are never shown in English.
        from profiles.words.sentences import english

        return english().problem(self)


class ProblemError(Exception):
    """Raised with every problem found, not only the first; its text is their sentences."""

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*problems)
        self.problems: Sequence[Problem] = tuple(dict.fromkeys(problems))  # a link that is lost twice is told once
        self.add_note("; ".join(problem.facts for problem in self.problems))

    def __str__(self) -> str:
        return "; ".join(str(problem) for problem in self.problems)


class ProfileError(ProblemError):
    """A job, a machine profile or a trace that cannot be used."""


def refusal_error(code: str, *, where: str = "", key: str = "", value: str = "", limit: str = "") -> ProfileError:
    """Return the error of one problem."""
    return ProfileError(Problem(code=code, where=where, key=key, value=value, limit=limit))
