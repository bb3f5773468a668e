"""The data gathering buffer: samples of registers, taken at the end of servo cycles, until they are listed.

DEFINE GATHER reserves it, and only that resets the storage pointer to its beginning; GATHER continues from there.
The sources and the period are read once, by GATHER.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drivers.pmac.gathering.gather import (
    LONG_BITS,
    MOST_WAITING,
    encode_float,
    is_due,
    long_words_of,
    pack_samples,
    padding_of,
    selected_sources,
    shifts_of,
)
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.memory import WORD_BITS, Memory, PassingWord, Pointer
from drivers.pmac.variables import VariableStore

_LONG_BYTES, _WORD_BYTES = LONG_BITS // 8, WORD_BITS // 8
_Source = tuple[Callable[[], int], int]  # reads the bits of a register; its lowest bit in a sample


class GatherBuffer:
    """A block of memory of `size` long words, 0 before it is defined; `running` while it is being filled."""

    def __init__(self, variables: VariableStore) -> None:
        self._variables = variables
        self._memory: Memory | None = None
        self.running = False
        self.size = 0
        self._data = bytearray()
        self._listable = False
        self._sources: tuple[_Source, ...] = ()
        self.by_cycle = False  # an output is gathered: of a stretch of cycles only the last one is known
        self._passing: tuple[PassingWord, ...] = ()  # of all sources, or of none
        self.motors: frozenset[int] | None = None  # those that `sample_stretch` reads; None when it cannot
        self._widths: tuple[int, ...] = ()  # bytes of each source
        self._waiting: list[list[float]] = []  # values by source, of the samples after those in `_data`
        self._padding = 0
        self._sample_bytes = 0
        self._period = 0
        self._cycle = 0

    def define(self, long_words: int) -> None:
        """DEFINE GATHER: reserve long words; data begin at the first, earlier data can no longer be listed.

        Raises PmacError: 003, size 0; 007, it is being filled.
        """
        self._refuse_running("DEFINE GATHER")
        if long_words < 1:
            raise PmacError(ErrorCode.DATA_ERROR, f"a gather buffer of {long_words} long words; from 1")
        self.clear()
        self.size = long_words

    def start(self) -> None:
        """GATHER: start with the next servo cycle, after the data already there. No effect while it runs.

        Raises PmacError: 003, not defined, or no valid sources; 006, no room for one sample.
        """
        if self.running:
            return
        if not self.size:
            raise PmacError(ErrorCode.DATA_ERROR, "GATHER without a buffer; DEFINE GATHER first")
        self._memory = self._variables.memory
        settings, dialect = self._variables.settings(), self._variables.dialect
        chosen = selected_sources(settings, dialect)
        period = int(settings.get(dialect.gathering.period, 0))
        if self._memory is None or not chosen or period < 0:
            asked = f"{len(chosen)} sources every {period} servo cycles"
            raise PmacError(ErrorCode.DATA_ERROR, f"{asked}: nothing that could be gathered")
        self._pack()
        self._prepare(self._memory, chosen)
        if not self._has_room:
            raise PmacError(ErrorCode.NO_ROOM, f"{self.size} long words are full; DEFINE GATHER starts over")
        self._period, self._cycle = period, 0
        self._listable = self.running = True

    def _prepare(self, memory: Memory, chosen: Sequence[Pointer]) -> None:
        """Find out what a sample needs, once: thousands are taken per second."""
        places = zip(chosen, shifts_of(chosen), strict=True)
        self._sources = tuple((_bits(memory, source), shift) for source, shift in places)
        self._widths = tuple((1 if source.space in "XY" else 2) * _WORD_BYTES for source in chosen)
        passing = tuple(each for each in map(memory.passing, chosen) if each is not None)
        self._passing = passing if len(passing) == len(chosen) else ()
        self.motors = frozenset(each.motor for each in passing) if self._passing else None
        self._waiting = [[] for _ in self._passing]
        self._padding = padding_of(chosen)
        dialect = self._variables.dialect
        output = dialect.registers["output"]
        places_of_outputs = {output.address + number * output.stride for number in range(dialect.motor_count)}
        self.by_cycle = any(each.space == output.space and each.address in places_of_outputs for each in chosen)
        self._sample_bytes = long_words_of(chosen) * _LONG_BYTES

    def delete(self) -> None:
        """DELETE GATHER. Raises PmacError: 007, it is being filled."""
        self._refuse_running("DELETE GATHER")
        self.clear()

    def clear(self) -> None:
        """Remove the buffer, as after power-up."""
        self.running = self._listable = False
        self.size = 0
        self._data.clear()
        self._waiting.clear()

    @property
    def is_due(self) -> bool:
        """Whether the next call of `sample` takes one."""
        return is_due(self._cycle, self._period)

    @property
    def cycles_left(self) -> int:
        """Return after how many more servo cycles the buffer is full."""
        if not self._period:
            return 1
        samples = (self.size * _LONG_BYTES - self._filled_bytes) // self._sample_bytes
        return -self._cycle % self._period + (samples - 1) * self._period + 1

    def sample(self) -> None:
        """Take the sample of a servo cycle, if one is due; stop when the buffer is full."""
        cycle = self._cycle
        self._cycle = cycle + 1
        if self._memory is None or not is_due(cycle, self._period):
            return
        if self._passing:
            for column, each in zip(self._waiting, self._passing, strict=True):
                column.append(each.now())
        else:
            whole = self._padding
            for bits, shift in self._sources:
                whole |= bits() << shift
            self._data += whole.to_bytes(self._sample_bytes, "little")
        self._stop_when_full()

    def sample_stretch(self, cycles: int) -> None:
        """Take the samples that are due in a stretch of servo cycles, no more than `cycles_left`, all at once."""
        first, period = -self._cycle % self._period, self._period
        self._cycle += cycles
        if first >= cycles:
            return
        for column, each in zip(self._waiting, self._passing, strict=True):
            values = each.passed()
            column += values if period == 1 else values[first::period]
        self._stop_when_full()

    def long_words(self, first: int = 0, count: int | None = None) -> list[int]:
        """LIST GATHER: return `count` long words (all by default) from the one with the number `first`, from 0.

        Raises PmacError: 003, nothing was gathered since the buffer was defined.
        """
        if not self._listable:
            raise PmacError(ErrorCode.DATA_ERROR, "nothing is gathered")
        self._pack()
        begin = first * _LONG_BYTES
        end = len(self._data) if count is None else min(len(self._data), begin + count * _LONG_BYTES)
        places = range(begin, end, _LONG_BYTES)
        return [int.from_bytes(self._data[place : place + _LONG_BYTES], "little") for place in places]

    @property
    def _filled_bytes(self) -> int:
        """Bytes that are taken."""
        waiting = len(self._waiting[0]) if self._waiting else 0
        return len(self._data) + waiting * self._sample_bytes

    @property
    def _has_room(self) -> bool:
        return self._filled_bytes + self._sample_bytes <= self.size * _LONG_BYTES

    def _stop_when_full(self) -> None:
        if not self._has_room or not self._period:
            self.running = False
        if self._waiting and len(self._waiting[0]) >= MOST_WAITING:
            self._pack()

    def _pack(self) -> None:
        """Bring the waiting samples into their bytes."""
        if self._waiting and self._waiting[0]:
            tail = self._padding.to_bytes(self._sample_bytes, "little")[sum(self._widths) :]
            self._data += pack_samples(self._waiting, self._widths, tail)
            self._waiting = [[] for _ in self._waiting]

    def _refuse_running(self, what: str) -> None:
        if self.running:
            raise PmacError(ErrorCode.BUFFER_IN_USE, f"{what} while data are gathered; ENDGATHER first")


def _integer(bits: int) -> Callable[[float], int]:
    mask = (1 << bits) - 1
    return lambda value: int(value) & mask


_BITS = {"X": _integer(WORD_BITS), "Y": _integer(WORD_BITS), "D": _integer(LONG_BITS), "L": encode_float}
"""Encoders of values by memory space."""


def _bits(memory: Memory, pointer: Pointer) -> Callable[[], int]:
    encode = _BITS[pointer.space]
    return memory.bits_of(pointer) or (lambda: encode(memory.read(pointer)))
