"""Who controls the machine: one console at a time writes its number into the controller, the others look on.

The number is drawn anew by each console, so that one that died and came back is not taken for the one before.
An observer may stop the machine, and nothing else.

Consoles on different computers may claim at the same moment, so that reading and then writing is no claim:
somebody may write in between. The controller compares and writes by itself, in one line, which it carries out
whole before the next one of any host: the number is exchanged only where it still is what it was taken for.
"""

from __future__ import annotations

from random import Random, SystemRandom

from drivers.controller import Controller
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.control_state import NOBODY, Standing
from drivers.link.base import GONE
from drivers.pmac.language.text import format_number
from drivers.pmac.reserved import OWNER
from profiles.problem import Problem

OWNER_ITEM = f"P{OWNER}"
"""What to ask the controller for."""

HIGHEST = 2**31 - 1
"""A P-variable holds it exactly in every family."""


def exchange_line(before: float, after: int) -> str:
    """Return the line that puts `after` in the place of `before` alone, and asks what is there then.

    There is no IF on line. INT(1.5/(|difference|+1)) is 1 where there is no difference, and 0 where there is one
    of 1 or more; 1.5, so that no rounding of the division matters.
    """
    sought = f"{'-' if before >= 0.0 else '+'}{format_number(abs(before))}"
    same = f"INT(1.5/(ABS({OWNER_ITEM}{sought})+1))"
    return f"{OWNER_ITEM}={OWNER_ITEM}*(1-{same})+{after}*{same} {OWNER_ITEM}"


class Ownership:
    """The number of this console and what the controller said last."""

    def __init__(self, client: Controller, random: Random | None = None) -> None:
        self.standing = Standing.OBSERVER
        self.holder = NOBODY
        self._client = client
        self._number = (random or SystemRandom()).randint(1, HIGHEST)
        self._unanswered = False

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
            RefusedError: `owner.held`, somebody else does, perhaps since this very moment.
            LinkError: `owner.not_kept`, what was written did not stay, or the link broke.
        """
        self.see(self._read())
        if self.holder not in (NOBODY, self._number):
            raise self._held()
        self._become_owner(NOBODY)

    def take_control(self, *, at_rest: bool) -> int:
        """Become the owner whoever it was; return the number of that one, for the record.

        Raises:
            RefusedError: `owner.moving`, the machine does not rest: nothing was written. `owner.held`, a third
                console was quicker.
            LinkError: as for `claim`.
        """
        if not at_rest:
            raise RefusedError(Problem(code="owner.moving", where=self._client.link.address))
        before = self._read()
        self._become_owner(before)
        return int(before)

    def release(self) -> None:
        """Give the machine back, if it is still ours; so is one whose claim was never answered.

        Raises:
            LinkError: the link broke.
        """
        given = self.standing is Standing.OWNER or self._unanswered
        self.standing = Standing.CHANGING if given else Standing.OBSERVER
        try:
            if given:
                self._client.request(exchange_line(self._number, NOBODY), lines=1)
        finally:
            self.standing, self.holder, self._unanswered = Standing.OBSERVER, NOBODY, False

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
        (held,) = self._client.numbers(OWNER_ITEM, again=True)
        return held

    def _become_owner(self, before: float) -> None:
        """Put the number of this console in the place of `before`, and find out whether it is there.

        Raises:
            RefusedError: `owner.held`, there was another one by then.
            LinkError: `owner.not_kept`; the link broke, and what became of it is unknown.
        """
        self.standing, self._unanswered = Standing.CHANGING, True
        held = None
        try:
            held = self._exchanged(before)
            if held == NOBODY != before:  # given back in this very moment
                held = self._exchanged(NOBODY)
        finally:
            self.standing = Standing.OWNER if held == self._number else Standing.OBSERVER
        self.holder, self._unanswered = int(held), False
        if held in (NOBODY, before) and held != self._number:
            value, limit = f"{held:.0f}", str(self._number)
            raise LinkError(
                Problem(code="owner.not_kept", where=self._client.link.address, value=value, limit=limit)
            )
        if held != self._number:
            raise self._held()

    def _exchanged(self, before: float) -> float:
        """Send the exchange, once; return who holds the machine then. An answer that is lost is asked for."""
        try:
            (answer,) = self._client.request(exchange_line(before, self._number), lines=1)
        except LinkError as error:
            if any(problem.code in GONE for problem in error.problems):
                raise
            return self._read()
        return self._client.number(answer)

    def _held(self) -> RefusedError:
        value = str(self.holder)
        return RefusedError(Problem(code="owner.held", where=self._client.link.address, value=value))
