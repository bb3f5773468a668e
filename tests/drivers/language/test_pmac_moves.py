"""What a line asks for: moves, modes and messages; and the directives that are carried out before."""

from __future__ import annotations

from typing import TypeVar

import pytest

from drivers.pmac.dialect import TURBO
from drivers.pmac.language.errors import ErrorCode, PmacError
from drivers.pmac.language.parser import parse_line
from drivers.pmac.preprocessor import MOST_CHARACTERS, MOST_LINES, LineNumber, preprocess
from drivers.pmac.program_text import RefusedLine, read_program
from drivers.pmac.requests import (
    CircleRequest,
    DeferredValue,
    DwellRequest,
    HomeRequest,
    LinearRequest,
    PresetRequest,
    PvtRequest,
    RapidRequest,
    Request,
    SplineRequest,
)
from tests.drivers.language.trees import Bench, targets

Kind = TypeVar("Kind")


def last(requests: list[Request], kind: type[Kind]) -> Kind:
    request = requests[-1]
    assert isinstance(request, kind)
    return request


def refusal(text: str, bench: Bench | None = None) -> str:
    with pytest.raises(PmacError) as refused:
        (bench or Bench()).run(text)
    assert refused.value.code == 3
    return refused.value.detail


def test_axes_of_a_line_move_together_and_linear_is_the_first_mode() -> None:
    for text in ("X1", "RAPID\nLIN\nX1", "SPLINE1 LINEAR X1"):
        assert isinstance(Bench().run(text)[-1], LinearRequest)
    first, second = Bench().run("X1000 Y(P1+5)\nX-2")
    assert isinstance(first, LinearRequest) and isinstance(second, LinearRequest)
    assert first.targets == {"X": 1000, "Y": 5, "Z": 0}
    assert second.targets == {"X": -2, "Y": 5, "Z": 0}


def test_the_last_of_f_and_tm_counts_and_modes_outlive_the_program() -> None:
    """Ix89 = 1000 units in Ix90 = 1000 ms: 50 units take 50 ms."""
    times = [
        r.tm_ms for r in Bench().run("X30 Y40\nTM20\nX0\nF100 X10\nF5 TM47.635 X0") if isinstance(r, LinearRequest)
    ]
    assert times == [50, 20, 100, 47.635]
    bench = Bench()
    bench.run("INC TM100 TA20 TS0")
    move = last(bench.run("X5"), LinearRequest)
    assert (move.targets["X"], move.tm_ms, move.ta_ms) == (5, 100, 20)


def test_a_feedrate_counts_along_the_feedrate_axes() -> None:
    """INC X30 Y40 Z10 F100 with FRAX(X,Y) takes 0.5 s (Software Reference, FRAX)."""
    assert last(Bench().run("FRAX(X,Y)\nINC\nX30 Y40 Z10 F100"), LinearRequest).tm_ms == 500
    assert last(Bench().run("FRAX(X,Y,Z)\nINC\nX-30 Y-40 Z120 F65"), LinearRequest).tm_ms == 2000
    assert last(Bench(I190=60_000).run("X10 F60"), LinearRequest).tm_ms == 10_000
    assert last(Bench().run("FRAX(X,Y)\nZ20 F100"), LinearRequest).tm_ms == 0
    assert last(Bench().run("NOFRAX\nX20 F100"), LinearRequest).tm_ms == 0
    requests = Bench().run("FRAX\nINC\nX3 C4 F10", {"X": 0, "C": 0})
    assert last(requests, LinearRequest).tm_ms == 500


def test_turbo_moves_other_axes_at_isx86_or_at_f_if_that_is_0() -> None:
    """Z20 with Isx86 = 50 takes 0.4 s, also when X and Y would be there before (Turbo Software Reference)."""
    turbo = Bench(TURBO, I5186=50)
    assert last(turbo.run("FRAX(X,Y)\nINC\nZ20 F100"), LinearRequest).tm_ms == 400
    assert last(turbo.run("INC\nX3 Y4 Z20 F100"), LinearRequest).tm_ms == 400
    assert last(turbo.run("INC\nX30 Y40 Z20 F100"), LinearRequest).tm_ms == 500
    assert last(Bench(TURBO).run("FRAX(X,Y)\nZ-20 F100"), LinearRequest).tm_ms == 200


@pytest.mark.parametrize("feedrate", ["0", "-100"])
def test_a_feedrate_of_0_or_less_is_an_error(feedrate: str) -> None:
    assert "above 0" in refusal(f"F{feedrate} X10")


def test_times_are_rounded_and_read_back_in_ix87_to_ix89() -> None:
    move = last(Bench().run("TA10.5 TS4.4 TM585.9375 X1"), LinearRequest)
    assert (move.ta_ms, move.ts_ms, move.tm_ms) == (11, 4, 585.9375)
    bench = Bench(system=2)
    bench.run("TA10.5 TS5 F33.5")
    assert [bench.value(name) for name in ("I287", "I288", "I289")] == [11, 5, 33.5]


def test_abs_and_inc_are_modal_and_an_axis_without_a_motor_has_no_effect() -> None:
    start = {"X": 100.0, "Y": 100.0}
    requests = Bench().run("X1 Y1\nINC(Y)\nX2 Y2\nINC\nX3 Y3\nABS(X)\nX4 Y4\nABS\nX5 Y5", start)
    assert targets(requests, "X") == [1, 2, 5, 4, 5]
    assert targets(requests, "Y") == [1, 3, 6, 10, 5]
    requests = Bench().run("X1 Y1\nINC(Y)\nX2 Y2\nINC\nX3\nDELAY5")
    found = ["".join(sorted(r.absolute)) for r in requests if isinstance(r, LinearRequest)]
    assert found == ["XY", "X", "", ""]
    assert last(Bench().run("X5 A7"), LinearRequest).targets == {"X": 5, "Y": 0, "Z": 0}


def test_rapid_moves_the_axes_of_the_line() -> None:
    move = last(Bench().run("RPD\nX5 Z1 A3"), RapidRequest)
    assert move.moving == frozenset("XZ")
    assert move.targets == {"X": 5, "Y": 0, "Z": 1}
    assert Bench().run("RAPID A3") == []


def test_a_spline_segment_takes_ta_and_on_a_turbo_tm_as_i42_says() -> None:
    move = last(Bench().run("SPLINE1 TA12 X5"), SplineRequest)
    assert (move.duration_ms, move.uniform) == (12, True)
    assert not last(Bench().run("SPLINE2 TA12 X5"), SplineRequest).uniform
    assert "no time" in refusal("TA0 SPLINE1 X5")
    bench = Bench(TURBO)
    assert last(bench.run("SPLINE1 TA12 TM20.5 X5"), SplineRequest).duration_ms == 20.5
    assert last(Bench(TURBO, I42=1).run("SPLINE1 TA12 TM20.5 X5"), SplineRequest).duration_ms == 12
    assert "TM" in refusal("SPLINE1 F100 X5", Bench(TURBO))
    assert "4096" in refusal("SPLINE1 TM4097 X5", Bench(TURBO))


def test_the_time_of_pvt_keeps_fractions_on_turbo_and_its_velocities_have_a_sign() -> None:
    move = last(Bench(I190=500).run("PVT200 X9000:-150 Y5"), PvtRequest)
    assert (move.targets["X"], move.velocities, move.duration_ms) == (9000, {"X": -0.3}, 200)
    bench = Bench()
    durations = [
        r.duration_ms for r in bench.run("PVT19.6 X1\nTA7.5 X2\nTM5 X3\nPVT4 X4") if isinstance(r, PvtRequest)
    ]
    assert durations == [20, 8, 8, 4]
    assert "no time" in refusal("PVT0.4 X1")
    assert "PVT" in refusal("X10:5")
    # 12 bits of fraction: 1/4096 ms.
    text = "PVT19.6 X1\nTA7 X2\nTM5.25 X3"
    durations = [r.duration_ms for r in Bench(TURBO).run(text) if isinstance(r, PvtRequest)]
    assert durations == [round(19.6 * 4096) / 4096, round(19.6 * 4096) / 4096, 5.25]
    whole = [r.duration_ms for r in Bench(TURBO, I42=1).run(text) if isinstance(r, PvtRequest)]
    assert whole == [20, 7, 7]
    assert "4096" in refusal("PVT4097 X1", Bench(TURBO))


def test_circles_go_either_way_about_a_centre_by_a_radius_or_whole() -> None:
    assert last(Bench().run("CIRCLE1 TM10 X10 I5"), CircleRequest).clockwise
    assert not last(Bench().run("CIR2 TM10 X10 I5"), CircleRequest).clockwise
    move = last(Bench().run("CIRCLE1 TM10 X10 R-20"), CircleRequest)
    assert (move.center, move.radius) == (None, -20)
    move = last(Bench().run("CIRCLE1 TM10 K33.333", {"X": 4.0, "Z": 5.0}), CircleRequest)
    assert move.targets == {"X": 4, "Z": 5}
    assert move.center == {"X": 0, "Y": 0, "Z": 33.333}


def test_the_centre_is_incremental_in_the_plane_of_normal_unless_abs_r_says_otherwise() -> None:
    start = {"X": 1.0, "Y": 2.0}
    move = last(Bench().run("CIRCLE1 TM10 ABS X10 Y2 I5", start), CircleRequest)
    assert (move.center, move.radius) == ({"X": 5, "Y": 0, "Z": 0}, None)
    move = last(Bench().run("CIRCLE1 TM10 INC ABS(R) X10 I5 J7", start), CircleRequest)
    assert move.center == {"X": 4, "Y": 5, "Z": 0}
    bench = Bench()
    bench.run("ABS(R)\nABS(R) INC(R)", start)
    assert last(bench.run("CIRCLE2 TM10 X10 K5", start), CircleRequest).center == {"X": 0, "Y": 0, "Z": 5}
    assert last(Bench().run("CIRCLE1 TM10 X10 I5"), CircleRequest).normal == (0, 0, -1)
    assert last(Bench().run("NORMAL J-1\nCIRCLE1 TM10 X10 I5"), CircleRequest).normal == (0, -1, 0)
    assert last(Bench().run("NRM I(P1+1)K2\nCIRCLE1 TM10 X10 I5"), CircleRequest).normal == (1, 0, 2)
    assert "direction" in refusal("NORMAL I0")


def test_the_time_of_a_circle_is_tm_or_its_length_over_f_and_without_a_centre_it_is_linear() -> None:
    move = last(Bench().run("CIRCLE1 TM300 TA20 TS5 X10 I5"), CircleRequest)
    assert (move.tm_ms, move.ta_ms, move.ts_ms) == (300, 20, 5)
    move = last(Bench(I190=60_000).run("CIRCLE1 F600 X10 I5"), CircleRequest)
    assert (move.tm_ms, move.speed_per_ms) == (None, 0.01)
    assert "above 0" in refusal("CIRCLE1 F0 X10 I5")
    assert isinstance(Bench().run("CIRCLE1 TM10 X10")[-1], LinearRequest)
    assert last(Bench().run("X10 I5 R3"), LinearRequest).targets["X"] == 10
    assert Bench().run("I100") == []


def test_home_names_its_motors_and_homez_does_not_move() -> None:
    requests = Bench().run("HOME1..3,5\nHM8\nHOMEZ2\nHMZ1,2")
    assert [(r.motors, r.zero) for r in requests if isinstance(r, HomeRequest)] == [
        ((1, 2, 3, 5), False),
        ((8,), False),
        ((2,), True),
        ((1, 2), True),
    ]
    assert "1 to 8" in refusal("HOME9")
    assert isinstance(Bench(TURBO).run("HOME32")[0], HomeRequest)


def test_where_a_program_goes_on_after_a_home_or_a_preset_is_what_it_is_told() -> None:
    run = Bench().start("HOME1\nINC X5", {"X": 100.0, "Y": 7.0})
    assert isinstance(run.advance(), HomeRequest)
    run.relocate({"X": 0.0})
    move = run.advance()
    assert isinstance(move, LinearRequest) and move.targets == {"X": 5, "Y": 7}
    preset, move = Bench().run("PSET X10 Y(P1) A5\nINC X1", {"X": 3.0, "Y": 4.0})
    assert isinstance(preset, PresetRequest) and preset.positions == {"X": 10, "Y": 0}
    assert isinstance(move, LinearRequest) and move.targets == {"X": 11, "Y": 0}


def test_synchronous_assignments_wait_for_a_move_and_combine() -> None:
    bench = Bench(M2=6)
    requests = bench.run("M1==P1+1 X1\nM1==2\nM1==3\nM(P1+2)&=3\nX2\nM1==4\nDWELL10\nX3")
    deferred = [r.deferred for r in requests if isinstance(r, LinearRequest | DwellRequest)]
    m1 = [DeferredValue(kind=d.kind, index=1, value=v) for (d, *_), v in zip(deferred[:3], (1, 3, 4), strict=True)]
    assert deferred == [(m1[0],), (m1[1], DeferredValue(kind=m1[0].kind, index=2, value=2)), (m1[2],), ()]
    assert bench.value("M1") == 0
    bench = Bench()
    bench.run("X1\nM1==1")
    assert bench.value("M1") == 0
    (move,) = Bench(M1=12).run("M1&=4\nM1|=1\nM1^=3\nX1")
    assert isinstance(move, LinearRequest)
    assert [d.value for d in move.deferred] == [(12 & 4 | 1) ^ 3]


def test_q_variables_belong_to_the_system_and_p_variables_to_all() -> None:
    first, second = Bench(), Bench(system=2)
    second.store = first.store
    first.run("Q1=1 P1=1")
    second.run("Q1=2 P2=Q1")
    assert [first.value("Q1"), second.value("Q1"), first.value("P2"), second.value("P1")] == [1, 2, 2, 1]


# What a program says to others: on-line commands, messages, the display, PLC programs.


def heard(text: str) -> list[tuple[object, ...]]:
    bench = Bench()
    bench.run(text)
    return bench.host.heard


def test_commands_and_control_characters_are_issued_as_typed() -> None:
    assert heard('CMD"#1J/"\nCOMMAND "&2A"') == [("command", "#1J/", ""), ("command", "&2A", "")]
    assert heard("CMD^A\nsend^m\nCMDP ^ K") == [
        ("command", "\x01", ""),
        ("send", "\r", ""),
        ("command", "\x0b", "P"),
    ]
    assert heard('SEND"Part  Done; x=5 (%)"') == [("send", "Part  Done; x=5 (%)", "")]


@pytest.mark.parametrize("port", ["S", "P", "R", "A"])
def test_a_letter_says_to_which_port(port: str) -> None:
    assert heard(f'CMD{port}"V"\nCOMMAND{port}"V"\nSEND{port}"hi"') == [
        ("command", "V", port),
        ("command", "V", port),
        ("send", "hi", port),
    ]


def test_display_and_plc_switches_reach_their_host() -> None:
    assert heard('DISPLAY"Ready"\nDISP 12"Go"\nDISPLAY ""') == [
        ("display", "Ready"),
        ("display", "Go"),
        ("display", ""),
    ]
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
    from drivers.pmac.requests import EndOfProgram
    from tests.drivers.language.trees import code_of

    text = 'CMD"A"\nSEND"x"\nDISPLAY"y"\nENABLE PLC 1'
    assert ProgramRun(code_of(text), Bench().store, Modes(), {}).advance() == EndOfProgram()


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


# #define, #include and #ifdef, with the line of the source in what is said of it.

FILES = {
    "speeds.h": "#define FAST 20\n\nX(FAST) ; here\nX10 bad\n",
    "again.h": '#include "again.h"\nX1\n',
    "twice.h": '#include "twice.h"\n' * 20,
}


def include(name: str) -> str:
    if name not in FILES:
        raise PmacError(ErrorCode.DATA_ERROR, f"#include {name}: no file that can be read")
    return FILES[name]


def lines(text: str) -> list[tuple[int, str]]:
    found = list(preprocess(text, include))
    assert [line.error for line in found if line.error] == []
    return [(line.place, line.text) for line in found]


def errors(text: str) -> list[tuple[int, str]]:
    return [(line.place, line.error.detail) for line in preprocess(text, include) if line.error is not None]


def test_names_are_whole_words_and_those_in_quotes_are_of_commands() -> None:
    text = "#define FAST 20\n#define AT P(FAST+1)\nF(FAST) AT=FASTER fast ; FAST\nXFAST"
    assert lines(text) == [(3, "F(20) P(20+1)=FASTER fast"), (4, "XFAST")]
    text = '#define TOOL #1\n#define GO J+\nCMD"TOOL GO" SEND"TOOL GO"\ncommandS"TOOL"'
    assert lines(text) == [(3, 'CMD"#1 J+" SEND"TOOL GO"'), (4, 'commandS"#1"')]


def test_conditions() -> None:
    text = "#define A\n#ifdef A\nX1\n#ifdef B\nX2\n#else\nX3\n#endif\n#else\nX4\n#endif\n#ifndef B\nX5\n#endif"
    assert lines(text) == [(3, "X1"), (7, "X3"), (13, "X5")]
    assert lines('#define A 1\n#undef A\n#ifdef A\n#include "gone.h"\n#endif\nX1') == [(6, "X1")]


def test_an_included_line_names_its_own_file_and_the_line_that_includes_it() -> None:
    found = list(preprocess('X1\n#include "speeds.h"\nX(FAST)', include))
    assert [(int(line.place), line.place.source, line.text) for line in found] == [
        (1, "", "X1"),
        (2, "speeds.h:3", "X(20)"),
        (2, "speeds.h:4", "X10 bad"),
        (3, "", "X(20)"),
    ]


@pytest.mark.parametrize(
    ("text", "place", "detail"),
    [
        ("X1\n#if 1\nX2", 2, "#if is not carried out"),
        ("#define F(x) x", 1, "with arguments"),
        ("X1\n#endif", 2, "without #ifdef"),
        ("#ifdef A\nX1", 1, "without #endif"),
        ("#ifdef A\n#else\n#else\n#endif", 3, "without #ifdef"),
        ('#include "gone.h"', 1, "no file"),
        ("#include", 1, "a file as in"),
        ("#define 5", 1, "a name as in"),
        ("#define A B\n#define B A\nA", 3, "defined by itself"),
    ],
)
def test_what_cannot_be_carried_out_is_said_with_its_line(text: str, place: int, detail: str) -> None:
    ((where, said),) = errors(text)
    assert where == place
    assert detail in said


def test_texts_that_grow_without_end_are_refused() -> None:
    assert errors('#include "again.h"')
    assert len(list(preprocess('#include "twice.h"', include))) <= MOST_LINES
    doubling = "\n".join(f"#define A{n} A{n + 1} A{n + 1}" for n in range(40)) + "\nA0"
    found = list(preprocess(doubling, include))
    assert all(len(line.text) <= MOST_CHARACTERS for line in found)
    assert found[-1].error is not None


def test_a_program_is_read_with_its_directives_carried_out() -> None:
    text = '#define SPEED 20\nP1=SPEED\nOPEN PROG 5 CLEAR\n#include "speeds.h"\nF(SPEED)\nCLOSE'
    refused: list[RefusedLine] = []
    read = read_program(text, refused, include=include)
    assert read.lines == ("P1=20", "OPEN PROG 5 CLEAR", "X(20)", "X10 bad", "F(20)", "CLOSE")
    assert read.places == {5: (LineNumber(4, "speeds.h:3"), 5)}
    assert [(line.place, line.where, line.text) for line in refused] == [
        (LineNumber(4, "speeds.h:4"), "4, speeds.h:4", "X10 bad")
    ]
    with pytest.raises(PmacError, match=r"line 4, speeds\.h:4"):
        read_program(text, include=include)


def test_a_number_is_the_line_of_the_text_itself_and_of_no_included_file() -> None:
    places = [3, LineNumber(3), LineNumber(3, "a.h:1"), LineNumber(3, "a.h:2"), LineNumber(4, "a.h:1")]
    same = [[one == other for other in places] for one in places]
    of_the_text = [True, True, False, False, False]
    assert same[0] == same[1] == of_the_text
    assert [row.count(True) for row in same[2:5]] == [1, 1, 1]
    assert all((one != other) is not (one == other) for one in places for other in places)
    assert len(set(places)) == 4 and LineNumber(3) + 1 == 4


def test_a_file_that_includes_itself_or_leaves_nothing_is_told_once() -> None:
    with pytest.raises(PmacError, match=r"line 1, speeds\.h:3: .*; no OPEN PROG in the text"):
        read_program('#include "speeds.h"', [], include=include)
    with pytest.raises(PmacError, match="line 1: #include: other files are not read here"):
        read_program('#include "speeds.h"\nOPEN PROG 1 CLEAR\nCLOSE')
    lines = list(preprocess('#include "a.h"\nX1', lambda name: f'P1=1\n#include "{name}"'))
    assert [line.text for line in lines if line.error is None] == ["P1=1", "X1"]
    (refused,) = [line for line in lines if line.error is not None]
    assert "a.h: it includes itself" in str(refused.error)
    with pytest.raises(PmacError, match="line 1: #ifdef without #endif"):
        read_program("#ifdef TURBO\nOPEN PROG 1 CLEAR\nX1\nCLOSE\n", [])
