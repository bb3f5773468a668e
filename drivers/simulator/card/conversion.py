"""The encoder conversion table of the controller: its set-up words, and the converted positions.

The encoder at channel n is that of motor n. Entries that are neither an encoder nor a time base convert nothing.
"""

from __future__ import annotations

from collections.abc import Mapping

from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.master.following import parts_of
from drivers.pmac.master.time_base import METHOD_SHIFT, TIME_BASE_METHOD, TimeBaseEntry, entry_of
from drivers.pmac.memory import WORD_BITS
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.motor import Motor

_WORD = (1 << WORD_BITS) - 1
_ENCODER_METHOD = 0x0
_TWO_LINES = (TIME_BASE_METHOD, 0x9, 0xA, 0xB)  # methods of the entries that have two lines


class Conversion:
    """Set-up words by line; in a family that has I-variables for them, those are the words.

    `revision` counts the changes of words that are not I-variables. `results` are the time bases of the cycle that
    has just ended, 2^-23 ms, by the line of their result.
    """

    def __init__(self, variables: VariableStore, motors: Mapping[int, Motor]) -> None:
        self.revision = 0
        self.results: dict[int, int] = {}
        self._table = variables.dialect.conversion_table
        self._variables = variables
        self._motors = motors
        self._words: dict[int, int] = {}
        self.reset()

    @property
    def changed_words(self) -> dict[int, int]:
        """The words by line that differ from the factory's, in a family that has no settings for them."""
        factory = dict(enumerate(self._table.setup))
        return {line: word for line, word in sorted(self._words.items()) if word != factory.get(line, 0)}

    def reset(self, changed: Mapping[int, int] | None = None) -> None:
        """Restore the factory words, except those in `changed`, by line."""
        if self._table.first_setting is None:
            self._words = {**dict(enumerate(self._table.setup)), **(changed or {})}
        self.results.clear()
        self.revision += 1

    def line_at(self, address: int) -> int | None:
        """Return the line at an address, 0 the first."""
        line = address - self._table.first_address
        return line if 0 <= line < self._table.lines else None

    def word(self, line: int) -> int:
        """Return the unsigned set-up word of a line."""
        first = self._table.first_setting
        return self._words.get(line, 0) if first is None else int(self._variables.i(first + line)) & _WORD

    def set_word(self, line: int, word: int) -> None:
        """Change a set-up word."""
        first = self._table.first_setting
        if first is None:
            self._words[line] = word & _WORD
            self.revision += 1
        else:
            self._variables.set(VariableKind.I, first + line, float(word & _WORD))

    def result(self, line: int) -> int:
        """Return the result of a line: a position in 1/32 count, which rolls over, or a time base."""
        if line in self.results:
            return self.results[line] & _WORD
        master = self.encoder(self._table.first_address + line)
        return 0 if master is None else parts_of(master.counter) & _WORD

    def encoder(self, address: int) -> Motor | None:
        """Return the motor whose encoder the line at an address converts."""
        line = self.line_at(address)
        if line is None or self.word(line) >> METHOD_SHIFT != _ENCODER_METHOD:
            return None
        # The second line of an entry holds the scale factor of the first one.
        second = line > 0 and self.word(line - 1) >> METHOD_SHIFT in _TWO_LINES
        return None if second else self.channel(self.word(line))

    def channel(self, address: int) -> Motor | None:
        """Return the motor whose encoder has its registers at an address."""
        channels = self._table.channels
        return self._motors.get(channels.index(address) + 1) if address in channels else None

    def time_base(self, address: int) -> TimeBaseEntry | None:
        """Return the entry whose time base is at an address: its second line."""
        line = self.line_at(address)
        return None if not line else entry_of(line - 1, self.word(line - 1), self.word(line))
