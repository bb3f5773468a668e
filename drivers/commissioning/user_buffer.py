"""The user buffer, memory that DEFINE UBUFFER reserves: where it is, its words as read, and as lines of a backup.

A controller reports only where it begins; it ends where the memory for buffers ends. Its words are data of the
programs: they are restored word by word, zeros too, before any program is sent.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from drivers.controller import Controller
from drivers.errors import ControllerError, RefusedError, out_of_step
from drivers.pmac.dialect import Dialect
from drivers.pmac.expected_replies import number_of
from drivers.pmac.language.errors import ErrorCode
from profiles.problem import Problem

SPACES = ("X", "Y")
WORDS_A_LINE = 16  # a line that is sent has 121 characters at most: a controller accepts 255
BYTES_A_WORD = 7  # six digits and what separates them
HIGHEST_WORD = (1 << 24) - 1
TIMEOUT_S = 10.0

_TITLE = re.compile(r"; user buffer: (\d{1,6}) words from \$([0-9A-F]{1,6})")
_WORDS = re.compile(r"W([XY]):\$([0-9A-F]{1,6}),(\$[0-9A-F]{1,6}(?:,\$[0-9A-F]{1,6})*)")

Seen = Callable[[int, int], None]
"""Takes the number of words that were read, and of all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UserWords:
    """The words of X and of Y, from the beginning of the buffer on."""

    x: tuple[int, ...] = ()
    y: tuple[int, ...] = ()

    def name_words(self, start: int) -> dict[str, str]:
        """Return the words by names such as `X:$10600`, in the order of the addresses."""
        both = zip(self.x, self.y, strict=True)
        return {
            f"{space}:${start + place:X}": f"${word:X}"
            for place, pair in enumerate(both)
            for space, word in zip(SPACES, pair, strict=True)
        }


def is_place(place: range, dialect: Dialect) -> bool:
    """Whether a user buffer can be there: in the memory of the family, up to one of its ends."""
    memory = dialect.user_buffer
    return memory is not None and place.start >= memory.start and place.stop in memory.ends


def read_place(client: Controller, dialect: Dialect) -> range | None:
    """Return the addresses of the user buffer, none where it has no words; None: the controller does not tell.

    Raises:
        RefusedError: `controller.user_buffer`, it is reported to be where it cannot be.
        DriverError: the link broke, or the answer is no number.
    """
    memory, where = dialect.user_buffer, client.link.address
    if memory is None:
        return None
    line = f"RHX:${memory.x_address:X}" if memory.setting is None else f"I{memory.setting}"
    try:
        (text,) = client.question(line, TIMEOUT_S, lines=1)
    except ControllerError as error:
        if error.error_number != ErrorCode.DATA_ERROR:
            raise
        return None
    try:
        start = float(int(text, 16)) if memory.setting is None else number_of(text)
    except ValueError as error:
        raise out_of_step(where, line, text[:40]) from error
    if memory.setting is None and not start:
        return range(memory.ends[0], memory.ends[0])  # never defined
    end = next((end for end in memory.ends if start <= end), None)
    if end is None or start < memory.start or start != int(start):
        code, limit = "controller.user_buffer", f"${memory.start:X} - ${memory.ends[-1]:X}"
        raise RefusedError(Problem(code=code, where=where, key=line, value=text.strip()[:40], limit=limit))
    return range(int(start), end)


def read_words(client: Controller, place: range, seen: Seen = lambda done, of: None) -> UserWords:
    """Return all words of a user buffer. Raises DriverError: the link broke, or the answer is something else."""
    whole, words = 2 * len(place), dict[str, list[int]](X=[], Y=[])
    seen(0, whole)
    for start in range(place.start, place.stop, WORDS_A_LINE):
        for space in SPACES:
            words[space] += _part(client, space, start, min(WORDS_A_LINE, place.stop - start))
            seen(sum(map(len, words.values())), whole)
    return UserWords(x=tuple(words["X"]), y=tuple(words["Y"]))


def _part(client: Controller, space: str, start: int, count: int) -> list[int]:
    line = f"RH{space}:${start:X},{count}"
    (text,) = client.query(line, again=True)
    try:
        found = [int(word, 16) for word in text.split()]
    except ValueError as error:
        raise out_of_step(client.link.address, line, text[:40]) from error
    if len(found) != count or not all(0 <= word <= HIGHEST_WORD for word in found):
        raise out_of_step(client.link.address, line, text[:40])
    return found


def title(place: range) -> str:
    """Return the comment of a backup that says where the user buffer is."""
    return f"; user buffer: {len(place)} words from ${place.start:X}"


def definition(size: int) -> str:
    """Return the line that makes a user buffer of this size; 0 is none."""
    return f"DEFINE UBUFFER {size}"


def word_lines(place: range, words: UserWords) -> Iterator[str]:
    """Yield the lines that write every word, X and Y in turn."""
    for start in range(0, len(place), WORDS_A_LINE):
        for space, every in zip(SPACES, (words.x, words.y), strict=True):
            part = ",".join(f"${word:X}" for word in every[start : start + WORDS_A_LINE])
            yield f"W{space}:${place.start + start:X},{part}"


class UserBufferLines:
    """Collects the lines of a backup that are about the user buffer: each word once, in order of address."""

    def __init__(self, dialect: Dialect) -> None:
        self._dialect = dialect
        self._defined = False
        self._words: dict[str, list[int]] = {space: [] for space in SPACES}
        self.place: range | None = None

    @property
    def words(self) -> UserWords | None:
        """The words, None where the backup has none."""
        return UserWords(x=tuple(self._words["X"]), y=tuple(self._words["Y"])) if self._defined else None

    @property
    def is_complete(self) -> bool:
        """Whether every word is there, or none."""
        size = len(self.place) if self._defined and self.place is not None else 0
        return all(len(each) == size for each in self._words.values())

    def take(self, line: str) -> bool:
        """Return whether a line is about the user buffer. Raises ValueError: it does not fit those before it."""
        if found := _TITLE.fullmatch(line):
            start = int(found[2], 16)
            place = range(start, start + int(found[1]))
            if self.place is not None or not is_place(place, self._dialect):
                raise ValueError(line)
            self.place = place
        elif self.place and line == definition(len(self.place)) and not self._defined:
            self._defined = True
        elif self._defined and self.place and (found := _WORDS.fullmatch(line)):
            words, every = self._words[found[1]], found[3].split(",")
            if int(found[2], 16) != self.place.start + len(words) or len(words) + len(every) > len(self.place):
                raise ValueError(line)
            words += [int(word[1:], 16) for word in every]
        else:
            return False
        return True
