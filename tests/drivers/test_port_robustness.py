"""Whatever a host sends, the card goes on: no byte, no line and no setting brings it down."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile

COMMANDS = (
    "#1J/ #2J/ #3J/ #1J+ #2J- #1J=100 #2J=-1000 #3J^50 #1J= J+ J- J/ HM #1HM #2HM #3HM K #2K A Q &1R R "
    "&1B1R B1 B2 ? ?? ??? P V F # & #1 #2 #3 #4 #8 &2 &1 #4? #4->A #4->X &2#3->X #3->0 #3->Z #1-> #1->5X+3 "
    "#2->-Y #2->Y #1->X VERSION TYPE CLOSE CLEAR LISTPROG1 LISTPROG9 DELETEPROG1 DELETEGATHER $$$ $$$*** "
    "OPENPROG1CLEAR OPENPROG2 P1=1 P1..3 P1,5,100 M26=1 Q1=P1/0 P5=SQRT(-1) P1=EXP(900) P(P1)=3 P(-1)=1 P2000 "
    "I3 I65=5 UUU J: J:5 J= J:* J^* J=* J=5^3 HMZ O5 O-200 $ $* S H / \\ %50 %0 %1000 % PC PE PR LISTPC LISTPE,9 "
    "PMATCH X=5 Z=P1 Z UNDEFINE UNDEFINEALL ##1 @ @1 @@ M5->Y:$C0,8,1 M5-> M1..9->* M6->D:$28 M6 M6=1 RX:$28 "
    "RHD:$28,9 WY:$700,1,2 SAVE SIZE PASSWORD=a ENABLEPLC1..3 DELETEALL OPENPLC1 LISTPLC1 B1.5 I100..131=* 5 -3"
).split()
SETTINGS = (
    "I8 I10 I13 I15 I100 I108 I111 I115 I116 I117 I119 I120 I121 I122 I123 I125 I126 I128 I130 I131 I133 "
    "I134 I135 I169 I187 I188 I189 I190 I211 I215 I216 I217 I219 I220 I221 I222 I223"
).split()
VALUES = "0 1 -1 0.4 0.001 3713707 8388608 999999999999 EXP(700) EXP(-700) -EXP(709)".split()
STATEMENTS = (
    "INC ABS LINEAR TA10 TA0 TS0 TS5 TM10 TM0 TM-5 F1000 F0 F-1 PVT10 PVT0 X100 Y-50 Z1 X10Y20Z30 X50:100 "
    "Y10:0 X(P1) X(EXP(700)) X1:(EXP(700)) DWELL0 DWELL5 DELAY5 DELAY0 P1=P1+1 P1=1/P2 P(0-5)=1 WHILE(1=1) "
    "ENDWHILE WHILE(P1<3) IF(P1=0) ELSE ENDIF M26=1 I187=EXP(-700) I190=EXP(-700) RAPID SPLINE1 SPLINE2 CIRCLE1 "
    'HOME1 HOMEZ2 PSETX5 STOP WAIT N1 GOTO1 GOSUB1 CALL1 RETURN G4 M3==1 FRAX(X) SENDP1 CMD"#1J+" SEND"a" CMD^A'
).split()

LINES = (
    st.lists(st.sampled_from(COMMANDS), min_size=1, max_size=4).map("".join)
    | st.builds("{}={}".format, st.sampled_from(SETTINGS), st.sampled_from(VALUES))
    | st.lists(st.sampled_from(STATEMENTS), min_size=1, max_size=6).map(
        lambda words: "\r".join(["CLOSE", "OPENPROG1CLEAR", *words, "CLOSE", "#1J/#2J/#3J/&1B1R"])
    )
    | st.text("#&?JHMKBRQA$*PVFI=+-0123456789.(){}XYZ\"'; \t", max_size=20)
)
BYTES = (
    LINES.map(lambda line: line.encode() + b"\r") | st.binary(max_size=30) | st.sampled_from([b"\x01", b"\x0b"])
)


def segments(stream: bytes, sizes: list[int]) -> list[bytes]:
    parts = []
    for size in sizes:
        parts.append(stream[:size])
        stream = stream[size:]
    return [*parts, stream]


@given(pieces=st.lists(BYTES, max_size=12), sizes=st.lists(st.integers(0, 60), max_size=8))
def test_no_bytes_in_any_segmentation_bring_the_card_down(
    machine: MachineProfile, pieces: list[bytes], sizes: list[int]
) -> None:
    sim = SimulatedLathe(machine)
    port, other = sim.connect(), sim.connect()
    for part in segments(b"".join(pieces), sizes):
        port.receive(part)
        sim.wait(0.03)
    sim.wait(1.0)
    other.receive(b"\x18\rI3=2 I6=1\r")
    sim.wait(0.006)
    assert other.take_output().endswith(b"\x06")
    port.receive(b"\x18\r")
    sim.wait(0.006)
    assert port.take_output() == b"\x06"


@given(line=LINES, sizes=st.lists(st.integers(0, 5), max_size=10))
def test_the_segmentation_of_a_line_does_not_change_its_answer(
    machine: MachineProfile, line: str, sizes: list[int]
) -> None:
    answers = []
    for parts in (segments(line.encode() + b"\r", sizes), [line.encode() + b"\r"]):
        sim = SimulatedLathe(machine)
        port = sim.connect()
        for part in parts:
            port.receive(part)
        sim.wait(0.05)
        answers.append(port.take_output())
    assert answers[0] == answers[1]


GARBAGE = st.binary(max_size=60) | st.text(
    "JHMKBRQAPVF?#&%/\\0123456789.;\x01\x02\x03\x06\x07\x0b\x10\x16\x18\r", max_size=60
).map(str.encode)


@given(garbage=st.lists(GARBAGE, max_size=20))
def test_what_one_host_sends_does_not_disturb_the_replies_to_another(
    machine: MachineProfile, garbage: list[bytes]
) -> None:
    """Nothing of it can be an assignment. After a flush and an empty line its own port answers again, too."""
    sim = SimulatedLathe(machine)
    port, other = sim.connect(), sim.connect()
    other.receive(b"I3=2 I6=1 &5Q900=25 Q901=50\r")
    sim.wait(0.006)
    other.take_output()
    for part in garbage:
        port.receive(part)
        other.receive(b"Q900..9")
        sim.attend(port)
        other.receive(b"01\r")
        sim.wait(0.006)
        assert other.take_output() == b"25\r50\r\x06"
    port.receive(b"\x18\r")
    sim.attend(port)
    assert port.take_output() == b"\x06"
