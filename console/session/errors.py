"""Errors that the session raises, besides those of the profiles and the drivers; what it refuses to do without."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.util import find_spec

from profiles.problem import Problem, ProblemError


class SessionError(ProblemError):
    """The job does not continue; nothing is moving."""


class Interrupted(KeyboardInterrupt):
    """A signal came before there was a machine to stop."""


def fault_problem(fault: Exception) -> Problem:
    """Return the problem of an internal fault, on one line; a computer without memory is none."""
    code = "session.no_memory" if isinstance(fault, MemoryError) else "session.fault"
    return Problem(code=code, value=" ".join(f"{type(fault).__name__}: {fault}".split()))


def refuse(*groups: Iterable[Problem]) -> None:
    """Raise a SessionError with all problems, if there is any."""
    problems = [problem for group in groups for problem in group]
    if problems:
        raise SessionError(*problems)


def require(holds: bool, code: str) -> None:
    """Refuse with a code unless something holds. Raises SessionError."""
    if not holds:
        raise SessionError(Problem(code=code))


def require_extra(module: str, extra: str) -> None:
    """Refuse where the library of an optional part is not installed: SessionError `extra.missing`."""
    if find_spec(module) is None:
        raise SessionError(Problem(code="extra.missing", value=module, limit=f"pip install 'trilobe[{extra}]'"))
