"""Lines of PLCs, their structure, and the forms in which lines are listed."""

from __future__ import annotations

import itertools
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.pmac.dialect import PMAC
from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.listing import stored_line, stored_plc_lines, with_end, without_end
from drivers.pmac.language.parser import parse_line
from drivers.pmac.language.plc_statements import MOST_CONDITION_LINES, parse_plc_line, stored_lines
from drivers.pmac.language.syntax import Line, PlcLine
from drivers.pmac.language.text import format_line, format_plc_line
from tests.drivers.language import trees
from tests.drivers.language.trees import plc_lines
from tests.drivers.plc_bench import PlcBench, code_of


@given(plc_lines)
def test_a_listed_line_is_read_back_as_the_same_line(line: PlcLine) -> None:
    assert parse_plc_line(format_plc_line(line)) == line


@given(plc_lines, st.randoms(use_true_random=False))
def test_case_and_white_space_change_nothing(line: PlcLine, random: object) -> None:
    choice = random.choice  # type: ignore[attr-defined]
    text = format_plc_line(line)
    loose, quoted_text = "", False
    for here, following in zip(text, f"{text} "[1:], strict=True):
        quoted_text ^= here == '"'
        loose += here if quoted_text else choice([here.upper(), here.lower()])
        if not quoted_text and not (here in string.digits + "." and following in string.digits + "."):
            loose += choice(["", "", " ", "\t"])
    assert parse_plc_line(loose + choice(["", " ; AND(", ";\xb0"])) == line


@given(plc_lines)
def test_what_is_stored_says_the_same_and_is_listed_line_by_line(line: PlcLine) -> None:
    kept = stored_lines(line)
    assert sum(kept, ()) == line
    for part in kept:
        assert stored_lines(parse_plc_line(format_plc_line(part))) == (part,)


def reads_or_refuses(text: str) -> None:
    try:
        line = parse_plc_line(text)
    except PmacError as refusal:
        assert refusal.code in (3, 4)
    else:
        assert parse_plc_line(format_plc_line(line)) == line


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(noise: bytes) -> None:
    reads_or_refuses(noise.decode("latin-1"))


fragments = "P1 = IF WHILE AND OR ( ) 1 ADR # & CMD ^ ELSE ENDI ENDW".split()
fragments += ["ENA", "PLC", "SEND", '"', "X", "I5", " ", "-", "ADDRESS", "9" * 30]


@given(st.lists(st.sampled_from(fragments), max_size=40).map("".join))
def test_any_jumble_of_words_is_read_or_refused(text: str) -> None:
    reads_or_refuses(text)


@pytest.mark.parametrize(
    "text",
    [
        "IF(M11=1 OR M12=1)",
        "AND(M13=1 OR M14=1)",
        "OR(P1!>5)",
        "WHILE(I5111>0)",
        "ENDWHILE",
        "ELSE",
        "ENDIF",
        "P(P1+1)=SIN(Q3)*2",
        "I5111=P1*8388608/I10",
        "ADDRESS#1",
        "ADDRESS&2",
        "ADDRESS#8&3",
        'CMD"#1J/" CMD^A SENDS"Lease lost" DISPLAY8"P 1"',
        "ENABLE PLC 1,2,3",
        "DISABLE PLC 3",
    ],
)
def test_plc_text_is_listed_as_it_was_written(text: str) -> None:
    assert format_plc_line(parse_plc_line(text)) == text


def test_the_short_words_are_listed_in_full() -> None:
    assert format_plc_line(parse_plc_line("adr & 2 # 4")) == "ADDRESS#4&2"
    assert format_plc_line(parse_plc_line("endi endw dis plc 2..4")) == "ENDIF ENDWHILE DISABLE PLC 2,3,4"


@pytest.mark.parametrize(
    "text",
    (
        "X10 | LINEAR | F100 | TA50 | DWELL10 | HOME1 | WAIT | STOP | N100 | GOTO100 | GOSUB100 | CALL500 | "
        "M3 | G1 | RETURN | READ(X) | S1000 | BLOCKSTART | M1==1 | M1&=1 | P1=2 X10 | IF(P1) | AND P1=1 | "
        "AND(P1=1 | ADDRESS | ADDRESS# | ADDRESS#0 | ADDRESS#33 | ADDRESS&17 | ADDRESS#1#2 | ENABLE PLC 32"
    ).split(" | "),
)
def test_anything_else_is_refused_as_err003(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_plc_line(text)
    assert refusal.value.code == 3


@pytest.mark.parametrize("text", ["AND(P1=1)", "OR(P1=1)", "ADDRESS#1", "ADR&2", "IF(P1=1) AND(P2=1)"])
def test_none_of_this_is_legal_in_a_motion_program(text: str) -> None:
    with pytest.raises(PmacError) as refusal:
        parse_line(text)
    assert refusal.value.code == 3


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("IF(P1=1) P2=3 P4=5", ["IF(P1=1)", "P2=3 P4=5"]),
        ("WHILE(P1=1) ENDWHILE", ["WHILE(P1=1)", "ENDWHILE"]),
        ("ENDIF ELSE P1=2", ["ENDIF ELSE", "P1=2"]),
        ("IF(P1=1) AND(P2=1) OR(P3=1) P4=1", ["IF(P1=1)", "AND(P2=1)", "OR(P3=1)", "P4=1"]),
        ("P1=1 P2=2", ["P1=1 P2=2"]),
        ("; nothing", []),
    ],
)
def test_what_stands_behind_a_condition_goes_to_the_next_line(text: str, kept: list[str]) -> None:
    """Software Reference, ELSE: a PLC puts it there and expects an ENDIF."""
    assert [format_plc_line(line) for line in stored_lines(parse_plc_line(text))] == kept


# The blocks of a PLC, and conditions that go on over several lines.

LINES = st.lists(st.tuples(st.sampled_from(["AND", "OR"]), st.booleans()), min_size=1, max_size=6)


def verdict(text: str, **variables: float) -> bool:
    bench = PlcBench(text, PMAC, **variables)
    assert bench.scan() is None
    return bench.value("P99") == 1


def test_the_example_of_the_manual_and_that_and_binds_tighter_than_or() -> None:
    """Turbo User Manual, Multiple-Line Conditions: each line is a unit of its own."""
    text = "IF(P11=1 OR P12=1)\nAND(P13=1 OR P14=1)\nP99=1\nENDIF"
    for p11, p12, p13, p14 in itertools.product((0, 1), repeat=4):
        expected = bool((p11 or p12) and (p13 or p14))
        assert verdict(text, P11=p11, P12=p12, P13=p13, P14=p14) is expected
    text = "IF(P1=1)\nOR(P2=1)\nAND(P3=1)\nP99=1\nENDIF"
    for p1, p2, p3 in itertools.product((0, 1), repeat=3):
        assert verdict(text, P1=p1, P2=p2, P3=p3) is bool(p1 or (p2 and p3))


@given(st.booleans(), LINES)
def test_any_chain_of_lines_is_what_python_makes_of_it(first: bool, further: list[tuple[str, bool]]) -> None:
    """The words and their precedence are Python's, too."""
    lines = [f"IF({int(first)}=1)", *(f"{word}({int(truth)}=1)" for word, truth in further), "P99=1", "ENDIF"]
    python = " ".join([str(first), *(f"{word.lower()} {truth}" for word, truth in further)])
    assert verdict("\n".join(lines)) is eval(python)


def test_a_while_goes_on_over_lines_and_a_false_one_spares_those_behind() -> None:
    bench = PlcBench("WHILE(P1<3)\n; and the lease\nAND(P2=0)\n\nP1=P1+1\nENDWHILE\nP99=1")
    assert [bench.scan() or bench.value("P99") for _ in range(4)] == [0, 0, 0, 1]
    # P9999 does not exist on a non-Turbo card: to look at it would be a run-time error.
    bench = PlcBench("IF(P1=1)\nAND(P9999=0)\nP2=1\nENDIF")
    assert bench.scan() is None
    bench.set("P1", 1)
    assert bench.scan() is not None


@pytest.mark.parametrize(
    ("text", "code", "line"),
    [
        ("ENDIF", 9, 1),
        ("P1=1\nENDWHILE", 9, 2),
        ("ELSE", 9, 1),
        ("WHILE(P1=1)\nELSE\nENDWHILE", 9, 2),
        ("IF(P1=1)\nELSE\nELSE\nENDIF", 9, 3),
        ("IF(P1=1)\nENDWHILE", 9, 2),
        ("AND(P1=1)", 9, 1),
        ("IF(P1=1)\nP2=1\nAND(P1=1)\nENDIF", 9, 3),
        ("IF(P1=1)\nELSE\nOR(P1=1)\nENDIF", 9, 3),
        ("IF(P1=1)\n" + "AND(P1=1)\n" * MOST_CONDITION_LINES, 9, MOST_CONDITION_LINES + 1),
        ("P1=1\nIF(P1=1)\nP2=1", 16, 2),
        ("WHILE(P1=1)\nIF(P1=1)\nENDIF", 16, 1),
        ("IF(P1=1) P2=1", 16, 1),
    ],
)
def test_a_block_that_does_not_fit_is_refused_with_its_line(text: str, code: int, line: int) -> None:
    with pytest.raises(PmacError) as refusal:
        code_of(text)
    assert refusal.value.code == code
    assert refusal.value.detail.startswith(f"line {line}:")


def test_the_longest_condition_can_be_run() -> None:
    long = " AND ".join(["1=1"] * 50)
    text = f"IF({long})\n" + f"AND({long})\n" * (MOST_CONDITION_LINES - 1) + "P99=1\nENDIF"
    assert verdict(text)


# Lines as the card lists them; the expected texts are those of listings of real cards.

PROGRAM = {
    "x(p1) y(p2)": "X(P1)Y(P2)",
    "ta10 ts0": "TA10TS0",
    "if (p1 = 1 and m2 = 0)": "IF(P1=1ANDM2=0)",
    'cmd "#1j+"': 'COMMAND"#1j+"',
    "CMD^A": "COMMAND^A",
    "dwe 20": "DWELL20",
    "dly(p1)": "DELAY(P1)",
    "end while": "ENDWHILE",
    "ENDW": "ENDWHILE",
    "hmz 25..27": "HOMEZ25..27",
    "home 1..3, 5": "HOME1..3,5",
    "enable plc 2": "ENABLEPLC2",
    "dis plc 2..31": "DISABLEPLC2..31",
    "P1=((P2+1))*(3)": "P1=((P2+1))*(3)",
    "X10 F5 Y20": "X10F5Y20",
    "X0.50 Y.5 Z10.": "X0.5Y0.5Z10",
    "P1=$F P2=007": "P1=15P2=7",
    "lin": "LINEAR",
    "cir2 X1 Y2 R5": "CIRCLE2X1Y2R5",
    'send "a b; C"': 'SEND"a b; C"',
    "ret": "RETURN",
    "O5 X1": "N5X1",
    "gos 100": "GOSUB100",
    "pau plc 3": "PAUSEPLC3",
}
SHORT = {
    # The manuals give both spellings, or use the short one in an example.
    'command"#1j+"': 'CMD"#1j+"',
    'commands"p1"': 'CMDS"p1"',
    "command^a": "CMD^A",
    "dwell 20": "DWE20",
    "end while": "ENDW",
    "linear": "LIN",
    "return": "RET",
    # Spellings that public readers of listings know.
    "delay(p1)": "DLY(P1)",
    "end if": "ENDI",
    "home 1..3, 5": "HM1..3,5",
    "homez 25..27": "HMZ25..27",
    "rapid x1": "RPDX1",
    "circle2 X1 Y2 R5": "CIR2X1Y2R5",
    "normal k-1": "NRMK-1",
    "blockstart": "BSTART",
    "enable plc 2": "ENAPLC2",
    "disable plc 2..31": "DISPLC2..31",
    "pause plc 3": "PAUPLC3",
    "resume plc 3": "RESPLC3",
    # Chosen to stay whole: no listing is known that shortens them.
    "gosub 100": "GOSUB100",
    'disp "x"': 'DISPLAY"x"',
    "if (p1=1) spline1": "IF(P1=1)SPLINE1",
    'send "linear"': 'SEND"linear"',
}
PLC = {
    "if (p1=1) adr&2#4": ("IF(P1=1)", "ADDRESS&2#4"),
    "disable plc 2..31": ("DISABLEPLC2..31",),
    "enaplc 2": ("ENABLEPLC2",),
    "return": (),
}


@pytest.mark.parametrize(("typed", "text"), PROGRAM.items())
def test_a_line_of_a_program(typed: str, text: str) -> None:
    assert stored_line(typed).text == text


@pytest.mark.parametrize(("typed", "text"), SHORT.items())
def test_a_line_in_short(typed: str, text: str) -> None:
    kept = stored_line(typed)
    assert kept.list_line(in_full=False) == text
    assert stored_line(text) == kept


@pytest.mark.parametrize(("typed", "texts"), PLC.items())
def test_a_line_of_a_plc(typed: str, texts: tuple[str, ...]) -> None:
    assert tuple(line.text for line in stored_plc_lines(typed)) == texts


@given(trees.lines)
def test_a_listed_line_is_the_line_that_was_typed(line: Line) -> None:
    kept = stored_line(format_line(line))
    assert kept.statements == line
    assert parse_line(kept.text) == line
    assert stored_line(kept.text).text == kept.text


@given(trees.lines)
def test_a_line_that_is_listed_in_short_is_read_back_as_the_same_line(line: Line) -> None:
    kept = stored_line(format_line(line))
    assert stored_line(kept.list_line(in_full=False)) == kept


@pytest.mark.parametrize(
    "typed", ["ENDIF F100", "ENDI", "LINEAR X1", "ENDIF ENDIF F(P1)", "RETURN N5", "ELSE ENDIF I5"]
)
def test_a_short_word_is_not_taken_for_the_beginning_of_a_longer_one(typed: str) -> None:
    kept = stored_line(typed)
    assert parse_line(kept.list_line(in_full=False)) == parse_line(kept.text) == kept.statements


@pytest.mark.parametrize("in_full", [True, False])
@pytest.mark.parametrize("typed", [(), ("X1",), ("X1", "RETURN"), ("X1", "ret")])
def test_a_listing_that_is_sent_back_is_listed_the_same(typed: tuple[str, ...], in_full: bool) -> None:
    def listed(texts: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(line.list_line(in_full=in_full) for line in with_end([stored_line(text) for text in texts]))

    once = listed(typed)
    assert once[-1] == ("RETURN" if in_full else "RET")
    assert listed(once) == listed(without_end(once)) == once
