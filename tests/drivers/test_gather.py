"""Data gathering: which registers, how a sample is packed and listed, and the arrays that come back."""

from __future__ import annotations

import math

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
    selected_sources,
    setting_of,
    source_of,
    unpack,
)
from drivers.pmac.gathering.gather_client import GatherChannel, GatheredData, motor_channel
from drivers.pmac.memory import Pointer
from tests.drivers.packed_samples import pack

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


def test_a_part_of_a_word_or_an_address_that_is_not_there_cannot_be_gathered() -> None:
    for source in (Pointer(space="X", address=0x10, width=8), Pointer(space="TWB", address=1), word("X", 0x10000)):
        with pytest.raises(GatherError, match="cannot be gathered"):
            setting_of(source, PMAC)
    assert setting_of(word("X", 0x10000), TURBO) == 0x410000


def test_the_settings_that_a_client_writes_to_a_turbo() -> None:
    settings = gather_settings([word("D", 0x88), word("D", 0x8B), word("X", 0x9D)], 2, TURBO)
    assert settings == {5049: 2, 5050: 7, 5051: 0, 5001: 0x800088, 5002: 0x80008B, 5003: 0x40009D}


def test_the_mask_of_the_manual_chooses_i29_and_i30() -> None:
    settings = {index: 0x800000 + index for index in range(21, 45)}
    chosen = selected_sources({**settings, 20: 0x300}, PMAC)
    assert chosen == (word("D", 29), word("D", 30))


def test_the_second_mask_of_a_turbo_goes_on_with_source_25() -> None:
    chosen = selected_sources({5050: 0x800000, 5051: 1, 5024: 0x18, 5025: 0x400019}, TURBO)
    assert chosen == (word("Y", 0x18), word("X", 0x19))


@FAMILIES
def test_what_is_set_is_what_is_selected_up_to_all_sources(dialect: Dialect) -> None:
    every = [word("YXDL"[place % 4], place) for place in range(dialect.gathering.source_count)]
    assert selected_sources(gather_settings(every, 1, dialect), dialect) == tuple(every)
    for wrong in ([*every, every[0]], []):
        with pytest.raises(GatherError, match=f"1 to {len(every)} sources"):
            gather_settings(wrong, 1, dialect)


def test_two_short_sources_share_a_long_word_the_first_in_its_lower_half() -> None:
    assert listing(pack([word("Y"), word("X")], [0xABC, -1])) == ["FFFFFF000ABC"]


def test_an_odd_sample_is_filled_up() -> None:
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


def test_a_sample_of_another_size_is_refused() -> None:
    with pytest.raises(GatherError, match="a sample has 1"):
        unpack([word("X")], [0, 0])


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


def test_an_empty_listing_is_no_samples() -> None:
    channels = [GatherChannel(name="flags", unit="", source=word("Y"))]
    data = GatheredData.from_listing([], channels, 1, CYCLE_MS)
    assert data.times_ms.shape == data.values["flags"].shape == (0,)


def test_a_listing_that_ends_inside_a_sample_is_refused() -> None:
    channels = [motor_channel(name, 1, {108: 96}, PMAC) for name in ("commanded", "actual")]
    with pytest.raises(GatherError, match="3 long words listed, 2 in a sample"):
        GatheredData.from_listing(listing([1, 2, 3]), channels, 1, CYCLE_MS)


def test_samples_need_a_time_between_them_and_channels_a_name() -> None:
    channel = motor_channel("actual", 1, {108: 96}, PMAC)
    assert GatheredData.from_listing(listing([1]), [channel], 0, CYCLE_MS).times_ms.tolist() == [0.0]
    with pytest.raises(GatherError, match="nothing says when"):
        GatheredData.from_listing(listing([1, 2]), [channel], 0, CYCLE_MS)
    for channels in ([channel, channel], []):
        with pytest.raises(GatherError, match="a name of its own"):
            GatheredData.from_listing(listing([1, 2]), channels, 1, CYCLE_MS)


def test_a_register_without_a_known_scale_is_refused() -> None:
    with pytest.raises(GatherError, match="there are commanded, actual"):
        motor_channel("temperature", 1, {108: 96}, PMAC)
    with pytest.raises(GatherError, match=r"I208 is 0\.0"):
        motor_channel("actual", 2, {108: 96}, PMAC)
