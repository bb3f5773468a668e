"""A digital indicator on a serial line: its documented replies, every other one, and a real line."""

from __future__ import annotations

import os
import re

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.errors import LinkError
from drivers.link.indicator import FORMATS, parse_indicator, parse_reply, read_indicator
from tests.played_indicator import Instrument, instrument

__all__ = ["instrument"]

DOCUMENTED = [
    ("mux10-mm", b"01A-001.2340\r", -1234.0, 0.1),
    ("mux10-mm", b"01A+00012.34\r", 12_340.0, 10.0),
    ("mux10-mm", b"01A+0000.1234\r", 123.4, 0.1),
    ("mux10-inch", b"01A+000.0100\r", 254.0, 2.54),
    ("opto-mm", b"+12.345\r", 12_345.0, 1.0),
    ("opto-mm", b" 0.0012\r\n", 1.2, 0.1),
    ("opto-inch", b"-0.00100\r", -25.4, 0.254),
    ("millimar", b"1 +000.12 um >\r", 0.12, 0.01),
    ("millimar", b"1 -012.345 mm = =\r", -12_345.0, 1.0),
    ("mux4", b"V1: mm       -00001.250000\r\n", -1250.0, 0.001),
    ("mux4", b"V1: inch ABS +00000.010000\r\n", 254.0, 0.0254),
]
NO_READINGS = [
    ("mux10-mm", b"911\r", "indicator.error"),
    ("mux10-mm", b"02A-001.2340\r", "indicator.no_reading"),  # another channel
    ("mux10-mm", b"01A-001.234\r", "indicator.no_reading"),  # a character was lost
    ("mux10-mm", b"01A-001.2340", "indicator.no_reading"),  # its end did not come
    ("opto-mm", b"ERR0\r", "indicator.error"),
    ("opto-mm", b"2.345\r", "indicator.no_reading"),  # its beginning did not come
    ("opto-mm", b"+2.345\r+2.346\r", "indicator.no_reading"),  # two: which one was asked for?
    ("opto-mm", b"+2.\x0045\r", "indicator.no_reading"),  # a wrong parity
    ("millimar", b"1 ERR6\r", "indicator.error"),
    ("millimar", b"1 +10:20:30 dms\r", "indicator.no_reading"),
    ("mux4", b"N01:E3\r\n", "indicator.error"),
    ("mux4", b"V1:          -00001.250000\r\n", "indicator.unit"),
    ("mux4", b"V1: mm   MAX -00001.250000\r\n", "indicator.no_reading"),  # of another time
    ("mux4", b"", "indicator.silent"),
    ("opto-mm", b"\x1b[2J\r", "indicator.no_reading"),
]


@pytest.mark.parametrize(("name", "data", "um", "last_digit_um"), DOCUMENTED)
def test_a_documented_reply_is_its_reading_in_um(name: str, data: bytes, um: float, last_digit_um: float) -> None:
    read = parse_reply(data, FORMATS[name])
    assert read.value_um == pytest.approx(um) and read.resolution_um == pytest.approx(last_digit_um)


@pytest.mark.parametrize(("name", "data", "code"), NO_READINGS)
def test_a_reply_that_is_no_reading_says_why(name: str, data: bytes, code: str) -> None:
    with pytest.raises(LinkError) as error:
        parse_reply(data, FORMATS[name])
    assert [each.code for each in error.value.problems] == [code]
    assert error.value.problems[0].value.isprintable()


REPLIES = st.one_of(
    st.binary(max_size=40),
    st.text(" 0123456789+-.AVERmuinch:\r\n", max_size=30).map(lambda text: text.encode("ascii")),
    st.tuples(
        st.sampled_from([each for _, each, _, _ in DOCUMENTED]), st.integers(0, 28), st.binary(max_size=2)
    ).map(lambda made: made[0][: made[1]] + made[2] + made[0][made[1] + len(made[2]) :]),
)


@given(name=st.sampled_from(sorted(FORMATS)), data=REPLIES)
@example(name="opto-mm", data=b"+1.2\xb2\r")
def test_whatever_comes_is_an_error_or_the_one_number_that_a_person_reads_there(name: str, data: bytes) -> None:
    """Read by hand: sign, digits and point, alone on a line with its end, times the unit."""
    try:
        read = parse_reply(data, FORMATS[name])
    except LinkError:
        return
    line = data.rstrip(b"\r\n")
    assert line.isascii() and b"\r" not in line and b"\n" not in line and data != line
    (number,) = re.findall(rb"[+ -]\d+\.\d+", line)
    inch = b"in" in line.lower() or name.endswith("inch")
    per_unit = 25_400.0 if inch else 1.0 if b"um" in line else 1000.0
    assert read.value_um == pytest.approx(float(number) * per_unit)


@pytest.mark.parametrize(
    ("name", "request_", "reply", "um"),
    [
        ("mux10-mm", b"1\r", b"01A+000.0421\r", 42.1),
        ("opto-inch", b"?\r", b"-0.00100\r", -25.4),
        ("millimar", b"M1?\r", b"1 +000.12 um\r", 0.12),
        ("mux4", b"1", b"V1: mm       -00000.003000\r\n", -3.0),
    ],
)
def test_an_indicator_is_asked_in_its_own_words_and_its_reading_taken(
    instrument: Instrument, name: str, request_: bytes, reply: bytes, um: float
) -> None:
    instrument.replies[request_] = reply
    asked = parse_indicator(f"{instrument.device}:{name}")
    assert read_indicator(asked).value_um == pytest.approx(um)
    assert instrument.asked == [request_]


def test_what_was_on_the_line_before_the_request_is_no_reading(instrument: Instrument) -> None:
    instrument.replies[b"?\r"] = b"+0.005\r"
    os.write(instrument.near, b"+9.999\r")
    assert read_indicator(parse_indicator(f"{instrument.device}:opto-mm")).value_um == pytest.approx(5.0)


def test_an_indicator_that_does_not_answer_is_an_error_with_its_line(instrument: Instrument) -> None:
    with pytest.raises(LinkError) as error:
        read_indicator(parse_indicator(f"{instrument.device}:opto-mm"))
    (problem,) = error.value.problems
    assert problem.code == "indicator.silent" and instrument.device in problem.where


@pytest.mark.parametrize(
    "text", ["/dev/ttyUSB0", "/dev/ttyUSB0:no-such", "ttyUSB0:opto-mm", "/dev/x?baud=0:opto-mm"]
)
def test_an_address_without_line_or_format_is_refused_with_the_formats(text: str) -> None:
    with pytest.raises(LinkError) as error:
        parse_indicator(text)
    (problem,) = error.value.problems
    assert problem.code == "indicator.bad_address" and "mux10-mm | " in problem.limit


def test_the_rate_is_that_of_the_format_unless_one_is_given() -> None:
    assert parse_indicator("/dev/ttyUSB0:opto-mm").line.baud_rate == 4800
    assert parse_indicator("/dev/ttyUSB0?baud=2400:mux10-mm").line.baud_rate == 2400
