"""Who controls the machine. Apart from `ownership`, so that the first page needs no line to a controller."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum, auto

NOBODY = 0  # the console number that means no console
MOST_OF_A_HOST = 15  # bytes of a name, or of a computer, in a signature
BY_SSH = "SSH"  # in place of a computer: a terminal that is not there, from an address too long to be signed


class ConsoleRole(StrEnum):
    """The role of this console towards the machine."""

    OBSERVER = auto()
    OWNER = auto()
    OUSTED = auto()
    """It was the owner until another console wrote its number: what is armed or moving is no longer ours."""
    CHANGING = auto()
    """A claim, take-control or release is in progress; only its reply shows who owns the machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Signature:
    """The console `number` is worked by `name` at the computer `host`, since `minute` (UTC, of the epoch).

    Where the terminal is not at that computer, `host` is the address that it comes from, or `BY_SSH`.
    """

    number: int
    name: str
    host: str
    minute: int

    @property
    def shown_host(self) -> str:
        """Where that is, as it is shown; `?` where it is not known."""
        return "?" if self.host in ("", BY_SSH) else self.host
