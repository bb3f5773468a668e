"""Ownership of the machine: one console writes its number into the controller, all others are observers.

Each console draws a new number, so that a restarted console is not taken for the previous one.
An observer may stop the machine, and nothing else.

Consoles on different computers may claim simultaneously, so read-then-write would race. The controller compares
and writes in one line (compare-and-swap), which it executes completely before the next line of any host: the
number changes only if it still is the expected one.

The number alone has control; the signature beside it explains it in words: a name, a computer, and since when. It
is written by the console that has just claimed the machine, and belongs to its number: with any other number in
control it means nothing. A P-variable holds integers of three bytes exactly in every family, so each takes three
bytes of UTF-8.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random, SystemRandom

from drivers.controller import Controller
from drivers.errors import DriverError, LinkError, RefusedError
from drivers.lathe.console_role import MOST_OF_A_HOST, NOBODY, ConsoleRole, Signature
from drivers.link.base import is_gone
from drivers.pmac.language.text import format_number
from drivers.pmac.reserved import OWNER, SIGNATURE
from profiles.problem import Problem

OWNER_ITEM = f"P{OWNER}"  # the variable with the owner's number
HIGHEST = 2**31 - 1  # a P-variable holds it exactly in every family
BYTES = MOST_OF_A_HOST  # of the name, and of the computer; what is longer is cut at a character
_PER_VARIABLE = 3
_EACH = BYTES // _PER_VARIABLE
ITEMS = tuple(f"P{SIGNATURE + place}" for place in range(2 + 2 * _EACH))
"""Number, minute, name, computer."""


def exchange_line(before: float, after: int) -> str:
    """Return the line that replaces `before`, and only that, by `after`, and reads back the result.

    There is no IF in on-line commands. INT(1.5/(|difference|+1)) is 1 where there is no difference, and 0 where
    there is one of 1 or more; 1.5, so that no rounding of the division matters.
    """
    sought = f"{'-' if before >= 0.0 else '+'}{format_number(abs(before))}"
    same = f"INT(1.5/(ABS({OWNER_ITEM}{sought})+1))"
    return f"{OWNER_ITEM}={OWNER_ITEM}*(1-{same})+{after}*{same} {OWNER_ITEM}"


class Ownership:
    """The `number` that this console writes, and the `holder`, the owner last reported by the controller.

    Every method that queries or sends raises `LinkError` when the link breaks.
    """

    def __init__(self, client: Controller, random: Random | None = None) -> None:
        self.standing, self.holder = ConsoleRole.OBSERVER, NOBODY
        self.number = (random or SystemRandom()).randint(1, HIGHEST)
        self._client, self._unanswered = client, False

    def see(self, held: float) -> None:
        """Process the owner read by a poll."""
        self.holder = int(held)
        if self.standing is ConsoleRole.OWNER and self.holder != self.number:
            self.standing = ConsoleRole.OUSTED

    def claim(self) -> None:
        """Claim a machine that has no owner.

        Raises:
            RefusedError: `owner.held`, another console has control, perhaps only just now.
            LinkError: `owner.not_kept`, the written value did not stay.
        """
        self.see(self._read())
        if self.holder not in (NOBODY, self.number):
            raise self._held_error()
        self._become_owner(NOBODY)

    def take_control(self, *, at_rest: bool) -> int:
        """Take control, whoever has it; return the previous owner's number, for the record.

        Raises:
            RefusedError: `owner.moving`, the machine is moving: nothing was written. `owner.held`, a third
                console was quicker.
            LinkError: as for `claim`.
        """
        if not at_rest:
            raise RefusedError(self._problem("owner.moving"))
        before = self._read()
        self._become_owner(before)
        return int(before)

    def release(self) -> None:
        """Release control if it is still ours, also after a claim that was never answered."""
        given = self.standing is ConsoleRole.OWNER or self._unanswered
        self.standing = ConsoleRole.CHANGING if given else ConsoleRole.OBSERVER
        try:
            if given:
                self._client.request(exchange_line(self.number, NOBODY), lines=1)
        finally:
            self.standing, self.holder, self._unanswered = ConsoleRole.OBSERVER, NOBODY, False

    def refuse_ousted(self) -> None:
        """Make sure that this console still controls the motion. Raises DriverError: `owner.ousted`."""
        if self.standing is ConsoleRole.OUSTED:
            raise DriverError(self._problem("owner.ousted", str(self.holder), str(self.number)))

    def refuse_unless_owner(self) -> None:
        """Make sure that this console may command.

        Raises RefusedError: `owner.held`, or `owner.observer` when it has not claimed control.
        """
        if self.standing is ConsoleRole.OWNER:
            return
        if self.holder not in (NOBODY, self.number):
            raise self._held_error()
        raise RefusedError(self._problem("owner.observer"))

    def _read(self) -> float:
        (held,) = self._client.numbers(OWNER_ITEM, again=True)
        return held

    def _become_owner(self, before: float) -> None:
        """Replace `before` by this console's number, and verify that it is there."""
        self.standing, self._unanswered = ConsoleRole.CHANGING, True
        held = None
        try:
            held = self._exchange_owner(before)
            if held == NOBODY != before:  # released at this very moment
                held = self._exchange_owner(NOBODY)
        finally:
            self.standing = ConsoleRole.OWNER if held == self.number else ConsoleRole.OBSERVER
        self.holder, self._unanswered = int(held), False
        if held in (NOBODY, before) and held != self.number:
            raise LinkError(self._problem("owner.not_kept", f"{held:.0f}", str(self.number)))
        if held != self.number:
            raise self._held_error()

    def _exchange_owner(self, before: float) -> float:
        """Send the exchange once; return the owner after it. A lost answer is queried."""
        try:
            (answer,) = self._client.request(exchange_line(before, self.number), lines=1)
        except LinkError as error:
            if is_gone(error):
                raise
            return self._read()
        return self._client.number(answer)

    def _held_error(self) -> RefusedError:
        return RefusedError(self._problem("owner.held", str(self.holder)))

    def _problem(self, code: str, value: str = "", limit: str = "") -> Problem:
        return Problem(code=code, where=self._client.link.address, value=value, limit=limit)


def sign(client: Controller, signature: Signature) -> None:
    """Write it, in one line. Nothing depends on it. Errors as for `request`."""
    client.request(signing_line(signature), lines=0)


def signing_line(signature: Signature) -> str:
    """Return the line that writes a signature."""
    values = (signature.number, signature.minute, *_pack_text(signature.name), *_pack_text(signature.host))
    return " ".join(f"{item}={value}" for item, value in zip(ITEMS, values, strict=True))


def read_signature(client: Controller, holder: int) -> Signature | None:
    """Return the signature of the console `holder`, None if it has written none. Errors as for `numbers`."""
    number, minute, *text = client.numbers(*ITEMS, again=True)
    if int(number) != holder or not 0 <= minute < 2**31:
        return None
    name, host = _unpack_text(text[:_EACH]), _unpack_text(text[_EACH:])
    return Signature(number=holder, name=name, host=host, minute=int(minute)) if name else None


def _pack_text(text: str) -> tuple[int, ...]:
    data = text.encode("utf-8", "replace")[:BYTES].decode("utf-8", "ignore").encode("utf-8").ljust(BYTES, b"\0")
    return tuple(int.from_bytes(data[at : at + _PER_VARIABLE], "big") for at in range(0, BYTES, _PER_VARIABLE))


def _unpack_text(values: Sequence[float]) -> str:
    """Return the text of these variables; "" if they hold anything else."""
    if not all(0 <= value < 2 ** (8 * _PER_VARIABLE) and value == int(value) for value in values):
        return ""
    data = b"".join(int(value).to_bytes(_PER_VARIABLE, "big") for value in values)
    return data.rstrip(b"\0").decode("utf-8", "replace")
