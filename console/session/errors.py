"""Errors that the session raises, besides those of the profiles and the drivers."""

from __future__ import annotations

from profiles.problem import ProblemError


class SessionError(ProblemError):
    """The job does not continue; nothing is moving."""


class Interrupted(KeyboardInterrupt):
    """A signal came before there was a machine to stop."""
