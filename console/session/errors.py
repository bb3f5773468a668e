"""What the session itself refuses, beside what the profiles and the drivers refuse."""

from __future__ import annotations

from profiles.problem import ProblemError


class SessionError(ProblemError):
    """The job does not go on; nothing is moving."""


class Interrupted(KeyboardInterrupt):
    """A signal came before any machine was there to be stopped."""
