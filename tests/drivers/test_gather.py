"""What is gathered: sources, packing, listings, and the buffer by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor, inf, isfinite, nan

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC, TURBO, Dialect
from drivers.pmac.gathering.gather import (
    GatherError,
    decode_float,
    encode_float,
    gather_settings,
    is_due,
    listed_words,
    listing,
    long_words_of,
    pack_samples,
    padding_of,
    selected_sources,
    setting_of,
    shifts_of,
    source_of,
    unpack,
)
from drivers.pmac.gathering.gather_client import GatherChannel, GatheredData, motor_channel
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.memory import Pointer
from drivers.pmac.variables import VariableStore
from drivers.simulator.card.gather_buffer import GatherBuffer


def pack(sources: Sequence[Pointer], values: Sequence[float]) -> list[int]:
    """Make a sample as a controller stores it."""
    sample = padding_of(sources)
    for source, value, shift in zip(sources, values, shifts_of(sources), strict=True):
        mask = 2**24 - 1 if source.space in "XY" else 2**48 - 1
        sample |= (encode_float(value) if source.space == "L" else int(value) & mask) << shift
    return [sample >> 48 * place & 2**48 - 1 for place in range(long_words_of(sources))]


CYCLE_MS = 0.4427
FAMILIES = pytest.mark.parametrize("dialect", [PMAC, TURBO], ids=["pmac", "turbo"])

WHOLE = {"Y": 24, "X": 24, "D": 48}
spaces = st.sampled_from("YXDL")
# What a register of 36 bits of mantissa holds exactly.
reals = st.builds(math.ldexp, st.integers(-(2**35), 2**35 - 1).map(float), st.integers(-900, 900))


def word(space: str, address: int = 0x10) -> Pointer:
    return Pointer(space=space, address=address, signed=space in "XY")


def a_value(space: str) -> st.SearchStrategy[float]:
    if space == "L":
        return reals
    limit = 1 << (WHOLE[space] - 1)
    return st.integers(-limit, limit - 1)


@st.composite
def samples(draw: st.DrawFn) -> tuple[list[Pointer], list[list[float]]]:
    sources = [word(space) for space in draw(st.lists(spaces, min_size=1, max_size=48))]
    one = st.tuples(*(a_value(source.space) for source in sources)).map(list)
    return sources, draw(st.lists(one, min_size=1, max_size=3))


def as_a_client_reads(lines: list[str], widths: list[int]) -> list[list[int]]:
    """Every 24 bits by themselves, the lower half of a long word first; an odd sample has one to leave out."""
    halves = [half for text in " ".join(lines).split() for half in (text[6:], text[:6])]
    rows = []
    while halves:
        row = []
        for width in widths:
            text = halves.pop(0) if width == 24 else "".join(reversed([halves.pop(0), halves.pop(0)]))
            number = int(text, 16)
            row.append(number - (1 << width) if number >> (width - 1) else number)
        if sum(widths) // 24 % 2:
            halves.pop(0)
        rows.append(row)
    return rows


@FAMILIES
@pytest.mark.parametrize(
    ("setting", "space"), [(0x00008B, "Y"), (0x40008B, "X"), (0x80008B, "D"), (0xC0008B, "L")]
)
def test_the_first_digit_of_a_source_says_which_words(dialect: Dialect, setting: int, space: str) -> None:
    assert source_of(setting, dialect) == word(space, 0x8B)
    assert setting_of(word(space, 0x8B), dialect) == setting


def test_masks_and_settings_choose_the_sources() -> None:
    for source in (Pointer(space="X", address=0x10, width=8), Pointer(space="TWB", address=1), word("X", 0x10000)):
        with pytest.raises(GatherError, match="cannot be gathered"):
            setting_of(source, PMAC)
    assert setting_of(word("X", 0x10000), TURBO) == 0x410000
    settings = gather_settings([word("D", 0x88), word("D", 0x8B), word("X", 0x9D)], 2, TURBO)
    assert settings == {5049: 2, 5050: 7, 5051: 0, 5001: 0x800088, 5002: 0x80008B, 5003: 0x40009D}
    settings = {index: 0x800000 + index for index in range(21, 45)}
    chosen = selected_sources({**settings, 20: 0x300}, PMAC)
    assert chosen == (word("D", 29), word("D", 30))
    chosen = selected_sources({5050: 0x800000, 5051: 1, 5024: 0x18, 5025: 0x400019}, TURBO)
    assert chosen == (word("Y", 0x18), word("X", 0x19))


@FAMILIES
def test_what_is_set_is_what_is_selected_up_to_all_sources(dialect: Dialect) -> None:
    every = [word("YXDL"[place % 4], place) for place in range(dialect.gathering.source_count)]
    assert selected_sources(gather_settings(every, 1, dialect), dialect) == tuple(every)
    for wrong in ([*every, every[0]], []):
        with pytest.raises(GatherError, match=f"1 to {len(every)} sources"):
            gather_settings(wrong, 1, dialect)


def test_short_sources_share_a_long_word_and_an_odd_one_is_filled_up() -> None:
    assert listing(pack([word("Y"), word("X")], [0xABC, -1])) == ["FFFFFF000ABC"]
    sources = [word("X"), word("D")]
    assert long_words_of(sources) == 2
    assert listing(pack(sources, [1, 0x123456789ABC])) == ["789ABC000001 000000123456"]


@given(samples())
@example(([word(space) for space in "XXXDXLDX" * 6], [[1.0] * 48]))
def test_what_is_packed_is_what_comes_back(drawn: tuple[list[Pointer], list[list[float]]]) -> None:
    sources, rows = drawn
    size = long_words_of(sources)
    for row in rows:
        packed = pack(sources, row)
        assert len(packed) == size
        assert unpack(sources, packed) == row
    short = sum(source.space in "XY" for source in sources)
    assert size == len(sources) - short + math.ceil(short / 2)


@given(samples().filter(lambda drawn: all(source.space != "L" for source in drawn[0])))
def test_a_client_reads_what_is_listed(drawn: tuple[list[Pointer], list[list[float]]]) -> None:
    sources, rows = drawn
    lines = listing([each for row in rows for each in pack(sources, row)])
    assert as_a_client_reads(lines, [WHOLE[source.space] for source in sources]) == rows


@given(st.lists(st.integers(0, 2**48 - 1), max_size=100))
def test_a_listing_is_read_back_whatever_its_lines(long_words: list[int]) -> None:
    lines = listing(long_words)
    assert listed_words(lines) == long_words
    assert listed_words([" ".join(lines).lower()]) == long_words
    assert all(len(line) <= 255 for line in lines)


@pytest.mark.parametrize("damaged", ["00000000001", "0000000000001", "00000000000G", "000000 000001"])
def test_a_damaged_listing_is_not_read(damaged: str) -> None:
    with pytest.raises(GatherError, match="long word 1: twelve"):
        listed_words(["000000000000", damaged])


def test_what_is_no_listing_of_these_samples_is_refused() -> None:
    with pytest.raises(GatherError, match="a sample has 1"):
        unpack([word("X")], [0, 0])
    channels = [GatherChannel(name="flags", unit="", source=word("Y"))]
    data = GatheredData.from_listing([], channels, 1, CYCLE_MS)
    assert data.times_ms.shape == data.values["flags"].shape == (0,)
    channels = [motor_channel(name, 1, {108: 96}, PMAC) for name in ("commanded", "actual")]
    with pytest.raises(GatherError, match="3 long words listed, 2 in a sample"):
        GatheredData.from_listing(listing([1, 2, 3]), channels, 1, CYCLE_MS)


@pytest.mark.parametrize("period", [1, 2, 5])
def test_a_sample_is_taken_every_period(period: int) -> None:
    assert [cycle for cycle in range(11) if is_due(cycle, period)] == list(range(0, 11, period))


def test_a_period_of_0_takes_one_sample() -> None:
    assert [cycle for cycle in range(11) if is_due(cycle, 0)] == [0]


def reassembled(register: int) -> float:
    """As the manual's program for the host does it, from two words of 24 bits, the upper one with a sign."""
    first, second = register & 0xFFFFFF, register >> 24
    upper = second - (1 << 24) if second >> 23 else second
    mantissa = upper * 4096.0 + (first >> 12)
    return math.ldexp(mantissa, (first & 0xFFF) - 2047 - 35) if mantissa else 0.0


@pytest.mark.parametrize(
    ("value", "register"),
    [(0.0, 0), (1.0, 0x400000000800), (-1.0, 0x8000000007FF), (0.75, 0x6000000007FF), (-1.5, 0xA00000000800)],
)
def test_floating_point_registers_bit_by_bit(value: float, register: int) -> None:
    assert encode_float(value) == register
    assert decode_float(register) == value


@given(reals)
def test_a_number_of_36_bits_survives_and_the_manual_reads_it(value: float) -> None:
    register = encode_float(value)
    assert 0 <= register < 1 << 48
    assert decode_float(register) == reassembled(register) == value
    mantissa = math.ldexp(register >> 12, -35)
    assert value == 0 or 0.5 <= mantissa < 1.5  # 0.5 to 1, or as two's complement -1 to -0.5


@given(st.floats(1e-300, 1.7e308), st.sampled_from([1, -1]))
@example(math.nextafter(1.0, 0.0), 1)
@example(math.nextafter(1.0, 0.0), -1)
@example(math.nextafter(0.5, 1.0), -1)
def test_any_other_number_is_rounded_to_36_bits(size: float, sign: int) -> None:
    assert decode_float(encode_float(sign * size)) == pytest.approx(sign * size, rel=2.0**-35, abs=0.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_not_stored(value: float) -> None:
    with pytest.raises(ValueError, match="no number"):
        encode_float(value)


def test_a_listing_becomes_counts_and_counts_a_cycle_over_milliseconds() -> None:
    settings = {108: 96, 109: 96, 208: 96, 209: 48, 260: 1}
    channels = [
        motor_channel("commanded", 1, settings, TURBO),
        motor_channel("actual", 2, settings, TURBO),
        motor_channel("velocity", 2, settings, TURBO),
    ]
    assert [setting_of(channel.source, TURBO) for channel in channels] == [0x800088, 0x80010B, 0x40011D]
    sources = [channel.source for channel in channels]
    scales = (96 * 32, 96 * 32, 48 * 32 * 2)
    truth = [(1000.5, -0.25, 3.0), (1010.5, 2.75, -1.5), (1020.5, 5.75, 0.0)]
    rows = [[value * scale for value, scale in zip(row, scales, strict=True)] for row in truth]
    lines = listing([each for row in rows for each in pack(sources, row)])
    data = GatheredData.from_listing(lines, channels, period_cycles=2, cycle_ms=CYCLE_MS)
    assert data.times_ms.tolist() == [0.0, 2 * CYCLE_MS, 4 * CYCLE_MS]
    assert dict(data.units) == {"#1 commanded": "counts", "#2 actual": "counts", "#2 velocity": "counts/cycle"}
    assert np.allclose(np.array(list(data.values.values())).T, truth, rtol=0, atol=1e-12)


def test_samples_need_times_names_and_a_known_scale() -> None:
    channel = motor_channel("actual", 1, {108: 96}, PMAC)
    assert GatheredData.from_listing(listing([1]), [channel], 0, CYCLE_MS).times_ms.tolist() == [0.0]
    with pytest.raises(GatherError, match="nothing says when"):
        GatheredData.from_listing(listing([1, 2]), [channel], 0, CYCLE_MS)
    for channels in ([channel, channel], []):
        with pytest.raises(GatherError, match="a name of its own"):
            GatheredData.from_listing(listing([1, 2]), channels, 1, CYCLE_MS)
    with pytest.raises(GatherError, match="there are commanded, actual"):
        motor_channel("temperature", 1, {108: 96}, PMAC)
    with pytest.raises(GatherError, match=r"I208 is 0\.0"):
        motor_channel("actual", 2, {108: 96}, PMAC)


# The buffer of data gathering by itself: what is taken, when, and how much of it there is room for.

BITS = {"Y": 24, "X": 24, "D": 48}


@dataclass(kw_only=True)
class Words:
    """A memory that tells what it was given for a place."""

    values: dict[tuple[str, int], float] = field(default_factory=dict)

    def bits_of(self, _: Pointer) -> None:
        return None

    def passing(self, _: Pointer) -> None:
        return None

    def read(self, pointer: Pointer) -> float:
        return self.values.get((pointer.space, pointer.address), 0.0)

    def write(self, pointer: Pointer, value: float) -> None:
        self.values[pointer.space, pointer.address] = value


def card(
    sources: list[Pointer], dialect: Dialect = PMAC, period: int = 1, size: int = 1000
) -> tuple[GatherBuffer, Words, VariableStore]:
    """A buffer that is defined and set up, with its memory and variables."""
    variables = VariableStore(dict(gather_settings(sources, period, dialect)), dialect)
    memory = Words()
    variables.memory = memory
    gather = GatherBuffer(variables)
    gather.define(size)
    return gather, memory, variables


def run(gather: GatherBuffer, cycles: int) -> None:
    """Servo cycles, as the card has them."""
    for _ in range(cycles):
        if gather.running:
            gather.sample()


def value_in_buffer(space: str) -> st.SearchStrategy[float]:
    if space == "L":
        return st.floats(-1e9, 1e9)
    limit = 1 << (BITS[space] - 1)
    return st.integers(-limit, limit - 1).map(float)


@st.composite
def gatherings(draw: st.DrawFn) -> tuple[Dialect, list[Pointer], list[list[float]]]:
    dialect = draw(st.sampled_from([PMAC, TURBO]))
    spaces = draw(st.lists(st.sampled_from("YXDL"), min_size=1, max_size=dialect.gathering.source_count))
    sources = [word(space, 0x100 + place) for place, space in enumerate(spaces)]
    row = st.tuples(*(value_in_buffer(space) for space in spaces)).map(list)
    return dialect, sources, draw(st.lists(row, min_size=1, max_size=4))


@given(gatherings())
def test_what_is_kept_is_what_the_rules_of_packing_say(
    drawn: tuple[Dialect, list[Pointer], list[list[float]]],
) -> None:
    dialect, sources, rows = drawn
    gather, memory, _ = card(sources, dialect)
    gather.start()
    for row in rows:
        for source, value in zip(sources, row, strict=True):
            memory.write(source, value)
        gather.sample()
    assert gather.long_words() == [each for row in rows for each in pack(sources, row)]


@pytest.mark.parametrize("period", [1, 3, 7])
def test_the_first_cycle_is_gathered_and_then_every_period(period: int) -> None:
    gather, memory, _ = card([word("D")], period=period)
    gather.start()
    for cycle in range(20):
        memory.write(word("D"), cycle)
        gather.sample()
    assert gather.long_words() == list(range(0, 20, period))


def test_a_period_of_0_is_one_sample_for_each_command() -> None:
    gather, memory, _ = card([word("D")], period=0)
    for value in (5, 6):
        memory.write(word("D"), value)
        gather.start()
        run(gather, 10)
        assert not gather.running
    assert gather.long_words() == [5, 6]


@pytest.mark.parametrize(("size", "samples"), [(10, 5), (11, 5), (2, 1), (3, 1)])
def test_it_ends_by_itself_when_another_sample_has_no_room(size: int, samples: int) -> None:
    sources = [word("D"), word("X")]
    gather, _, _ = card(sources, size=size)
    gather.start()
    run(gather, samples - 1)
    before_the_last = gather.running
    run(gather, 100)
    assert (before_the_last, gather.running) == (True, False)
    assert len(gather.long_words()) == samples * long_words_of(sources)


def test_a_full_buffer_takes_no_more_until_it_is_defined_again() -> None:
    gather, _, _ = card([word("D")], size=4)
    gather.start()
    run(gather, 4)
    assert refusal(gather.start) == 6
    gather.define(4)
    gather.start()
    assert gather.running


def test_data_go_on_behind_those_that_are_there_and_define_begins_anew() -> None:
    """The manuals name DEFINE GATHER alone for putting the place of storage back to the beginning."""
    gather, memory, _ = card([word("D")])
    for value in (1, 2):
        memory.write(word("D"), value)
        gather.start()
        run(gather, 2)
        gather.running = False
    assert gather.long_words() == [1, 1, 2, 2]
    gather.define(100)
    gather.start()
    run(gather, 1)
    assert gather.long_words() == [2]


@FAMILIES
def test_what_is_gathered_is_read_once_when_it_starts(dialect: Dialect) -> None:
    gather, memory, variables = card([word("D", 0x20)], dialect)
    memory.write(word("D", 0x20), 1)
    memory.write(word("D", 0x21), 2)
    gather.start()
    for index, value in gather_settings([word("D", 0x21)], 5, dialect).items():
        variables.set(VariableKind.I, index, value)
    run(gather, 2)
    gather.start()  # it runs: this changes nothing
    run(gather, 1)
    assert gather.long_words() == [1, 1, 1]
    gather.running = False
    gather.start()
    run(gather, 5)
    assert gather.long_words() == [1, 1, 1, 2]


def refusal(act: object, *arguments: object) -> int:
    assert callable(act)
    with pytest.raises(PmacError) as refused:
        act(*arguments)
    return refused.value.code


def test_what_cannot_be_gathered_is_refused() -> None:
    gather, _, variables = card([word("D")])
    gather.delete()
    assert refusal(gather.start) == 3, "no buffer"
    assert refusal(gather.define, 0) == 3
    gather.define(1)
    variables.set(VariableKind.I, PMAC.gathering.masks[0], 0)
    assert refusal(gather.start) == 3, "no sources"
    variables.set(VariableKind.I, PMAC.gathering.masks[0], 3)
    variables.set(VariableKind.I, PMAC.gathering.first_source + 1, 0x800030)
    assert refusal(gather.start) == 6, "one long word, two in a sample"
    variables.memory = None
    assert refusal(gather.start) == 3, "no memory"
    assert not gather.running


@pytest.mark.parametrize(("period", "size", "before"), [(1, 10, 0), (1, 10, 4), (3, 10, 0), (3, 10, 4), (7, 4, 1)])
def test_the_cycles_left_are_those_until_it_is_full(period: int, size: int, before: int) -> None:
    gather, _, _ = card([word("D"), word("D", 0x11)], period=period, size=size)
    gather.start()
    run(gather, before)
    left = gather.cycles_left
    run(gather, left - 1)
    assert gather.running
    run(gather, 1)
    assert not gather.running


# Gathered numbers become the words of a register all at once, as one by one.


def test_registers_hold_integers_and_samples_their_sources_in_order() -> None:
    assert pack_samples([[2.5, -2.5, -0.2]], (3,), b"") == bytes.fromhex("030000 feffff 000000")
    assert pack_samples([[1.0, 2.0], [-1.0, 256.0]], (6, 3), b"\xab\xcd\xef") == bytes.fromhex(
        "010000000000 ffffff abcdef 020000000000 000100 abcdef"
    )


@pytest.mark.parametrize(("value", "word"), [(nan, "000000"), (inf, "000000"), (2.0**80 + 2.0**40, "000000")])
def test_what_no_register_holds_leaves_the_other_samples_alone(value: float, word: str) -> None:
    assert pack_samples([[1.0, value, -1.0]], (3,), b"") == bytes.fromhex(f"010000 {word} ffffff")


@given(st.lists(st.floats() | st.floats(-1e15, 1e15), min_size=1), st.sampled_from((3, 6)))
def test_many_are_packed_as_each_by_itself(values: list[float], width: int) -> None:
    whole = (floor(value + 0.5) if isfinite(value) else 0 for value in values)
    assert pack_samples([values], (width,), b"") == b"".join(
        (each % 256**width).to_bytes(width, "little") for each in whole
    )
