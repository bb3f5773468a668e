"""Data gathering: which registers are sampled, how often, and how a sample is packed and listed.

A mask selects among the sources. The two highest bits of a source select the part of the address: 0 the Y word, 1
(a first digit of 4) the X word, 2 (8) both as a 48-bit integer, 3 (C) both as a floating-point number. A sample is
the words of its sources in the order of the mask, a long source with its Y word first; two words make a long word,
the first one in its lower half, and an odd sample is padded with one more. LIST GATHER reports long words, twelve
hexadecimal digits each. Sources: PMAC Software Reference, I19 to I44; Turbo Software Reference, I5001 to I5051,
DEFINE GATHER; existing clients, for the order inside a long word.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from drivers.pmac.dialect import Dialect
from drivers.pmac.memory import WORD_BITS, Pointer

WORDS_PER_LINE = 16  # Long words in a line of LIST GATHER

LONG_BITS = 2 * WORD_BITS
PADDING = 0
"""Padding of a sample with an odd number of words; a real controller leaves old memory contents there."""

_SPACES = ("Y", "X", "D", "L")
_SPACE_SHIFT = 22
_ADDRESS = (1 << 20) - 1
_WORD = (1 << WORD_BITS) - 1
_LONG_WORD = re.compile(r"[0-9A-Fa-f]{12}")

_EXPONENT_BITS = 12
_EXPONENT_OFFSET = 2047
_FRACTION_BITS = 35
_SIGN = 1 << _FRACTION_BITS
_MANTISSA = 2 * _SIGN - 1
MOST_WAITING = 1000
"""Samples; they are then packed without being asked for, so that memory does not grow."""

_EXACT = 2.0**62  # counts of this size and more do not fit in the integers of numpy
_MASK = (1 << 48) - 1  # no register is wider
_BYTES = 8


class GatherError(ValueError):
    """An invalid set-up, sample or listing."""


def source_of(setting: int, dialect: Dialect) -> Pointer:
    """Return the register that a source setting names; the bits between its two parts have no effect."""
    space = _SPACES[setting >> _SPACE_SHIFT & 3]
    address = setting & _ADDRESS & dialect.highest_address
    return Pointer(space=space, address=address, signed=space in "XY")


def setting_of(source: Pointer, dialect: Dialect) -> int:
    """Return the source setting that names a register; only whole words can be gathered.

    Raises GatherError: part of a word, or an address that the family does not have.
    """
    whole = source.space in _SPACES and source.width == WORD_BITS
    if not whole or source.address > _ADDRESS & dialect.highest_address:
        raise GatherError(
            f"{source} cannot be gathered; X, Y, D or L, whole words, up to ${dialect.highest_address:X}"
        )
    return _SPACES.index(source.space) << _SPACE_SHIFT | source.address


def selected_sources(settings: Mapping[int, float], dialect: Dialect) -> tuple[Pointer, ...]:
    """Return the registers that the masks select, in order; `settings` are I-variables by index."""
    places = dialect.gathering
    mask = sum(int(settings.get(index, 0)) << WORD_BITS * place for place, index in enumerate(places.masks))
    chosen = (places.first_source + bit for bit in range(places.source_count) if mask >> bit & 1)
    return tuple(source_of(int(settings.get(index, 0)), dialect) for index in chosen)


def gather_settings(sources: Sequence[Pointer], period_cycles: int, dialect: Dialect) -> dict[int, int]:
    """Return the I-variables, by index, that gather these registers every so many servo cycles.

    Raises GatherError: more sources than the family has, or none, or one that cannot be gathered.
    """
    places = dialect.gathering
    if not 1 <= len(sources) <= places.source_count or period_cycles < 0:
        detail = f"{len(sources)} sources every {period_cycles} servo cycles"
        raise GatherError(f"{detail}; 1 to {places.source_count} sources, a period from 0")
    mask = (1 << len(sources)) - 1
    masks = {index: mask >> WORD_BITS * place & _WORD for place, index in enumerate(places.masks)}
    addresses = enumerate((setting_of(source, dialect) for source in sources), places.first_source)
    return {places.period: period_cycles, **masks, **dict(addresses)}


def is_due(cycles_since_start: int, period_cycles: int) -> bool:
    """Whether a sample is taken in this servo cycle, 0 the first; a period of 0 takes a single sample."""
    return cycles_since_start % period_cycles == 0 if period_cycles else cycles_since_start == 0


def long_words_of(sources: Sequence[Pointer]) -> int:
    """Return the number of long words in a sample."""
    return (sum(_words_in(source) for source in sources) + 1) // 2


def shifts_of(sources: Sequence[Pointer]) -> tuple[int, ...]:
    """Return how many bits above its first word each source of a sample begins.

    As a single number, a sample has its first long word lowest.
    """
    ends = accumulate(WORD_BITS * _words_in(source) for source in sources)
    return tuple(end - WORD_BITS * _words_in(source) for end, source in zip(ends, sources, strict=True))


def padding_of(sources: Sequence[Pointer]) -> int:
    """Return the padding of a sample, in its place."""
    words = sum(_words_in(source) for source in sources)
    return PADDING << WORD_BITS * words if words % 2 else 0


def unpack(sources: Sequence[Pointer], long_words: Sequence[int]) -> list[float]:
    """Return the values of a sample: signed integers, except floating-point registers.

    Raises GatherError: the wrong number of long words for a sample.
    """
    if len(long_words) != long_words_of(sources):
        raise GatherError(f"{len(long_words)} long words; a sample has {long_words_of(sources)}")
    sample = sum(word << LONG_BITS * place for place, word in enumerate(long_words))
    values: list[float] = []
    for source, shift in zip(sources, shifts_of(sources), strict=True):
        bits = WORD_BITS * _words_in(source)
        held = sample >> shift & ((1 << bits) - 1)
        values.append(decode_float(held) if source.space == "L" else _sign_value(held, bits))
    return values


def listing(long_words: Sequence[int]) -> list[str]:
    """Return the lines that LIST GATHER returns."""
    starts = range(0, len(long_words), WORDS_PER_LINE)
    return [" ".join(f"{word:012X}" for word in long_words[start : start + WORDS_PER_LINE]) for start in starts]


def listed_words(lines: Iterable[str]) -> list[int]:
    """Return the long words of a listing.

    Raises GatherError: something that is not a long word; a listing with a gap is useless.
    """
    found = [text for line in lines for text in line.split()]
    for place, text in enumerate(found):
        if _LONG_WORD.fullmatch(text) is None:
            raise GatherError(f"long word {place}: twelve hexadecimal digits, found {text!r}; list once more")
    return [int(text, 16) for text in found]


def _words_in(source: Pointer) -> int:
    return 1 if source.space in "XY" else 2


def _sign_value(held: int, bits: int) -> int:
    sign = 1 << (bits - 1)
    return (held ^ sign) - sign


def encode_float(value: float) -> int:
    """Return the register value of a number, rounded to 36 bits of mantissa, half to even.

    The signed mantissa is from 0.5 up to 1, or from -1 up to -0.5; it is in the X word and the upper half of the Y
    word, the exponent plus 2047 in the lower half. Zero has no bit set. Sources: Turbo PMAC User Manual,
    computational features; PMAC User Manual, writing a host communications program.

    Raises ValueError: not a finite number.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no number that a register holds")
    fraction, exponent = math.frexp(value)
    mantissa = round(math.ldexp(fraction, _FRACTION_BITS))
    if mantissa == 0:
        return 0
    if mantissa == _SIGN:
        mantissa, exponent = _SIGN // 2, exponent + 1
    elif mantissa == -_SIGN // 2:  # -0.5 is written as -1 of the exponent below
        mantissa, exponent = -_SIGN, exponent - 1
    return (mantissa & _MANTISSA) << _EXPONENT_BITS | exponent + _EXPONENT_OFFSET


def decode_float(register: int) -> float:
    """Return the number in an unsigned 48-bit register value.

    Raises OverflowError: beyond the range of a Python float.
    """
    exponent = register & ((1 << _EXPONENT_BITS) - 1)
    mantissa = register >> _EXPONENT_BITS
    return math.ldexp(_sign_value(mantissa, _FRACTION_BITS + 1), exponent - _EXPONENT_OFFSET - _FRACTION_BITS)


def pack_samples(columns: Sequence[Sequence[float]], widths: Sequence[int], tail: bytes) -> bytes:
    """Return samples as bytes, little-endian: of each source its register in so many bytes, then `tail`.

    A register holds the nearest integer, halves up, 0 for what is not finite.
    """
    samples = np.empty((len(columns[0]), sum(widths) + len(tail)), np.uint8)
    at = 0
    for column, width in zip(columns, widths, strict=True):
        samples[:, at : at + width] = _registers(column)[:, :width]
        at += width
    samples[:, at:] = np.frombuffer(tail, np.uint8)
    return samples.tobytes()


def _registers(values: Sequence[float]) -> NDArray[np.uint8]:
    whole = np.floor(np.array(values, np.float64) + 0.5)
    if (np.abs(whole) < _EXACT).all():
        words = whole.astype("<i8")
    else:  # too large, or not finite
        words = np.array([math.floor(v + 0.5) & _MASK if math.isfinite(v) else 0 for v in values], "<i8")
    return words.view(np.uint8).reshape(-1, _BYTES)
