"""The scanner: loose spelling, numbers, comments and refusals."""

from __future__ import annotations

import pytest

from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.lexer import Scanner

ONLINE = ("I", "P", "V", "F", "M", "?", "??", "???", "#", "&", "%")


def test_a_poll_without_any_space_is_taken_word_by_word() -> None:
    scanner = Scanner("i65???&1??%#1?PVFm190p99")
    taken: list[str | int] = []
    while not scanner.at_end:
        word = scanner.take_word(ONLINE)
        assert word is not None
        taken.append(word)
        number = scanner.take_integer()
        if number is not None:
            taken.append(number)
    expected = ["I", 65, "???", "&", 1, "??", "%", "#", 1, "?", "P", "V", "F", "M", 190, "P", 99]
    assert taken == expected


@pytest.mark.parametrize("text", ["ENDWHILE", "End While", "e n d\tw h i l e", " EndWhile ; End"])
def test_case_and_white_space_do_not_matter_inside_a_word(text: str) -> None:
    scanner = Scanner(text)
    assert scanner.accept("ENDWHILE")
    assert scanner.at_end


@pytest.mark.parametrize(
    ("text", "value"),
    [("12", 12.0), ("12.5", 12.5), (".5", 0.5), ("10.", 10.0), ("$1F", 31.0), ("$ff", 255.0), ("007", 7.0)],
)
def test_a_number_is_decimal_or_hexadecimal(text: str, value: float) -> None:
    scanner = Scanner(text)
    assert scanner.take_number() == value
    assert scanner.at_end


@pytest.mark.parametrize("text", ["-1", "+1", "$", ".", "E5", "", "$G"])
def test_a_number_has_no_sign_and_at_least_one_digit(text: str) -> None:
    scanner = Scanner(text)
    assert scanner.take_number() is None
    assert scanner.rest == text


def test_a_number_has_no_exponent() -> None:
    scanner = Scanner("1E5")
    assert scanner.take_number() == 1.0
    assert scanner.rest == "E5"


def test_a_range_does_not_end_up_in_the_number_before_it() -> None:
    scanner = Scanner("1..3")
    assert scanner.take_number() == 1.0
    assert scanner.accept("..")
    assert scanner.take_number() == 3.0


def test_white_space_ends_a_number() -> None:
    scanner = Scanner("$1 F100")
    assert scanner.take_number() == 1.0
    assert scanner.accept("F")
    assert scanner.take_number() == 100.0


def test_a_constant_beyond_every_number_is_refused() -> None:
    for digits in ("9" * 400, "$" + "F" * 400):
        with pytest.raises(PmacError) as refusal:
            Scanner(digits).take_number()
        assert refusal.value.code == ErrorCode.DATA_ERROR


def test_the_longest_word_wins() -> None:
    assert Scanner("ATAN2(1)").take_word(("ATAN", "ATAN2")) == "ATAN2"
    assert Scanner("ATAN(2)").take_word(("ATAN", "ATAN2")) == "ATAN"
    assert Scanner("X1").take_word(("ATAN", "ATAN2")) is None


def test_a_string_keeps_its_spaces_its_case_and_its_semicolon() -> None:
    scanner = Scanner('send "Ready; go" ; comment')
    assert scanner.accept("SEND")
    assert scanner.take_string() == "Ready; go"
    assert scanner.at_end


def test_an_unfinished_string_is_refused() -> None:
    scanner = Scanner('"Ready')
    with pytest.raises(PmacError) as refusal:
        scanner.take_string()
    assert refusal.value.code == ErrorCode.DATA_ERROR


def test_a_comment_may_hold_anything() -> None:
    korean = "X1 ;공구이송축\x00\x07\x0b\x85".encode().decode("latin-1")
    scanner = Scanner(korean)
    assert scanner.rest == "X1"


@pytest.mark.parametrize("text", ["X1 공", "µ", "X\x80", '"é"', "\xa0X1"])
def test_a_high_character_outside_a_comment_is_illegal(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        Scanner(text)
    assert refusal.value.code == 4


def test_the_position_is_the_column_as_it_was_typed() -> None:
    scanner = Scanner("  X 1 0 ; end")
    assert scanner.position == 2
    assert scanner.accept("X")
    assert scanner.position == 4
    mark = scanner.mark()
    scanner.take_number()
    assert scanner.position == 6
    scanner.reset(mark)
    assert scanner.position == 4


def test_a_refusal_names_the_column() -> None:
    error = Scanner("  X1").refusal("no")
    assert str(error) == "ERR003: column 3: no, found X1"
    assert str(PmacError(5)) == "ERR005"
