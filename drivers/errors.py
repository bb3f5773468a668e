"""What can go wrong between the console and the machine, as values with facts."""

from __future__ import annotations

from profiles.problem import ProblemError


class DriverError(ProblemError):
    """A command to the machine that did not do what was asked."""


class LinkError(DriverError):
    """The link cannot be opened, broke, or brought something that nobody asked for."""


class LinkTimeoutError(LinkError):
    """No complete reply within the time allowed; the fate of the request is unknown."""


class ControllerError(DriverError):
    """The controller refused a line with a BELL; `error_number` is its ERR number, 0 when it gave none."""

    def __init__(self, *args: object, error_number: int = 0) -> None:
        super().__init__(*args)  # type: ignore[arg-type]
        self.error_number = error_number


class RefusedError(DriverError):
    """Refused here, before anything was sent: the machine is as it was."""
