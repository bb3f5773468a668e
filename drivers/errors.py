"""Errors between the console and the machine, as values with facts."""

from __future__ import annotations

from profiles.problem import Problem, ProblemError


class DriverError(ProblemError):
    """A command to the machine failed."""


class LinkError(DriverError):
    """The link cannot be opened, broke, or delivered unexpected data."""


class LinkTimeoutError(LinkError):
    """No complete reply within the timeout; whether the request was executed is unknown."""


class ControllerError(DriverError):
    """The controller rejected a line with a BELL; `error_number` is its ERR number, 0 when it gave none."""

    def __init__(self, *args: object, error_number: int = 0) -> None:
        super().__init__(*args)  # type: ignore[arg-type]
        self.error_number = error_number


class RefusedError(DriverError):
    """Refused by the host before anything was sent: the machine is unchanged."""


def out_of_step(where: str, key: str, value: str) -> LinkError:
    """Return the error for an answer that does not match its query."""
    return LinkError(Problem(code="link.out_of_step", where=where, key=key, value=value))
