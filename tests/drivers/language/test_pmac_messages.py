"""What a program says to others: on-line commands, messages, the display, PLC programs."""

from __future__ import annotations

import pytest

from drivers.pmac.language.errors import PmacError
from drivers.pmac.language.parser import parse_line
from tests.drivers.language.runs import Bench


def heard(text: str) -> list[tuple[object, ...]]:
    bench = Bench()
    bench.run(text)
    return bench.host.heard


def test_cmd_and_command_issue_an_on_line_command() -> None:
    assert heard('CMD"#1J/"\nCOMMAND "&2A"') == [("command", "#1J/", ""), ("command", "&2A", "")]


def test_control_characters_are_written_with_an_arrow() -> None:
    assert heard("CMD^A\nsend^m\nCMDP ^ K") == [
        ("command", "\x01", ""),
        ("send", "\r", ""),
        ("command", "\x0b", "P"),
    ]


@pytest.mark.parametrize("port", ["S", "P", "R", "A"])
def test_a_letter_says_to_which_port(port: str) -> None:
    assert heard(f'CMD{port}"V"\nCOMMAND{port}"V"\nSEND{port}"hi"') == [
        ("command", "V", port),
        ("command", "V", port),
        ("send", "hi", port),
    ]


def test_the_text_between_quotes_is_kept_as_it_is_typed() -> None:
    assert heard('SEND"Part  Done; x=5 (%)"') == [("send", "Part  Done; x=5 (%)", "")]


def test_display_writes_to_the_display_port() -> None:
    assert heard('DISPLAY"Ready"\nDISP 12"Go"\nDISPLAY ""') == [
        ("display", "Ready"),
        ("display", "Go"),
        ("display", ""),
    ]


def test_plc_programs_are_enabled_and_disabled() -> None:
    text = "ENABLE PLC 1..3,5\nDIS PLC 0\nENAPLC7\nDISABLEPLC31"
    assert heard(text) == [("enable", 1, 2, 3, 5), ("disable", 0), ("enable", 7), ("disable", 31)]


def test_they_act_when_their_line_is_calculated_in_the_order_of_the_program() -> None:
    bench = Bench()
    run = bench.start('SEND"1"\nX1\nSEND"2"\nX2')
    run.advance()
    assert bench.host.heard == [("send", "1", "")]
    run.advance()
    assert bench.host.heard == [("send", "1", ""), ("send", "2", "")]


def test_nobody_has_to_listen() -> None:
    from drivers.pmac.execution.move_times import Modes
    from drivers.pmac.execution.run import ProgramRun
    from drivers.pmac.requests import Finished
    from tests.drivers.language.runs import code_of

    text = 'CMD"A"\nSEND"x"\nDISPLAY"y"\nENABLE PLC 1'
    assert ProgramRun(code_of(text), Bench().store, Modes(), {}).advance() == Finished()


@pytest.mark.parametrize(
    "text",
    [
        "CMD",
        'CMD"A',
        "CMD^",
        "CMD^1",
        'CMD"A\x01"',
        'SEND"a\tb"',
        'CMDX"A"',
        "DISPLAY P1",
        'DISPS"A"',
        "ENABLE PLC",
        "ENABLE PLC 32",
        "ENABLE PLC 3..1",
        "DISABLE PLC 1,",
        "ENABLE 1",
    ],
)
def test_anything_else_is_a_data_error(text: str) -> None:
    with pytest.raises(PmacError) as refused:
        parse_line(text)
    assert refused.value.code == 3
