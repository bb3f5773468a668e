"""Who controls the machine: one console at a time writes its number into the controller, the others look on.

The number is drawn anew by each console, so that one that died and came back is not taken for the one before.
An observer may stop the machine, and nothing else.
"""

from __future__ import annotations

from enum import StrEnum, auto
from random import Random, SystemRandom

from drivers.errors import DriverError, LinkError, RefusedError
from drivers.pmac.client import PmacClient
from drivers.pmac.language.text import format_number
from drivers.pmac.reserved import OWNER
from profiles.problem import Problem

NOBODY = 0
OWNER_ITEM = f"P{OWNER}"
"""What to ask the controller for."""

HIGHEST = 2**31 - 1
"""A P-variable holds it exactly in every family."""


class Standing(StrEnum):
    """What this console is to the machine."""

    OBSERVER = auto()
    OWNER = auto()
    OUSTED = auto()
    """It was the owner, and somebody else has written another number: whatever was armed or moves is not ours."""


class Ownership:
    """The number of this console and what the controller said last."""

    def __init__(self, client: PmacClient, random: Random | None = None) -> None:
        self.standing = Standing.OBSERVER
        self.holder = NOBODY
        self._client = client
        self._number = (random or SystemRandom()).randint(1, HIGHEST)

    @property
    def number(self) -> int:
        """What this console writes."""
        return self._number

    def see(self, held: float) -> None:
        """Take in what a look at the machine has read."""
        self.holder = int(held)
        if self.standing is Standing.OWNER and self.holder != self._number:
            self.standing = Standing.OUSTED

    def claim(self) -> None:
        """Become the owner of a machine that nobody owns.

        Raises:
            RefusedError: `owner.held`, somebody else does.
            LinkError: `owner.not_kept`, what was written did not stay, or the link broke.
        """
        self.see(self._read())
        if self.holder not in (NOBODY, self._number):
            raise self._held()
        self._write()

    def take_over(self, *, at_rest: bool) -> int:
        """Become the owner whoever it was; return the number of that one, for the record.

        Raises:
            RefusedError: `owner.moving`, the machine does not rest: nothing was written.
            LinkError: as for `claim`.
        """
        if not at_rest:
            raise RefusedError(Problem(code="owner.moving", where=self._client.link.address))
        before = int(self._read())
        self._write()
        return before

    def release(self) -> None:
        """Give the machine back, if it is still ours.

        Raises:
            LinkError: the link broke.
        """
        if self.standing is Standing.OWNER and int(self._read()) == self._number:
            self._client.request(f"{OWNER_ITEM}={NOBODY}")
        self.standing, self.holder = Standing.OBSERVER, NOBODY

    def refuse_ousted(self) -> None:
        """Make sure that what moves is still ours.

        Raises:
            DriverError: `owner.ousted`, another console has written its number over ours.
        """
        if self.standing is Standing.OUSTED:
            value, limit = str(self.holder), str(self._number)
            raise DriverError(
                Problem(code="owner.ousted", where=self._client.link.address, value=value, limit=limit)
            )

    def refuse_unless_owner(self) -> None:
        """Make sure that this console may command.

        Raises:
            RefusedError: `owner.held`, or `owner.observer` when it has not asked to.
        """
        if self.standing is Standing.OWNER:
            return
        if self.holder not in (NOBODY, self._number):
            raise self._held()
        raise RefusedError(Problem(code="owner.observer", where=self._client.link.address))

    def _read(self) -> float:
        (held,) = self._client.numbers(OWNER_ITEM)
        return held

    def _write(self) -> None:
        self._client.request(f"{OWNER_ITEM}={format_number(self._number)}")
        held = int(self._read())
        if held != self._number:
            value, limit = str(held), str(self._number)
            raise LinkError(
                Problem(code="owner.not_kept", where=self._client.link.address, value=value, limit=limit)
            )
        self.standing, self.holder = Standing.OWNER, held

    def _held(self) -> RefusedError:
        value = str(self.holder)
        return RefusedError(Problem(code="owner.held", where=self._client.link.address, value=value))
