"""Programs that are loaded, with the constants around them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache

import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.errors import ControllerError, DriverError, LinkError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import REPLY_TIMEOUT_S, PmacClient
from drivers.pmac.dialect import DIALECTS, PMAC, TURBO, Dialect
from drivers.pmac.program_constants import constants_of
from drivers.pmac.program_load import LoadedProgram, load_program, verify_loaded, verify_program
from drivers.pmac.program_text import read_program
from drivers.pmac.programs.setup import FINISHED, TURNS_CUT
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.drivers.commissioned import Recorded, recorded
from tests.system.lathe_sites import compact

TEXT = """
P7=1000
OPEN PROG 501 CLEAR
P3=P3*2
RETURN
CLOSE
OPEN PROG 1007
CLEAR
INC
LINEAR TA100 TS0 TM1000
WHILE(P1<3)
X10 Y-20
P1=P1+1
ENDWHILE
CALL501
CLOSE
"""
FAULTS: dict[str, dict[str, float]] = {
    "dropped-ack": {"replies": 1},
    "late-reply": {"replies": 1, "delay_ms": 1000 * REPLY_TIMEOUT_S + 500},
    "extra-line": {"replies": 1},
    "nul": {"replies": 1},
    "bare-bel": {"replies": 1},
    "hang": {"for_s": REPLY_TIMEOUT_S + 0.5},
}


@pytest.fixture(params=[PMAC, TURBO], ids=lambda dialect: dialect.name)
def bench(machine: MachineProfile, request: pytest.FixtureRequest) -> Recorded:
    dialect: Dialect = request.param
    return recorded(machine, dialect)


def codes(error: DriverError) -> list[str]:
    return [problem.code for problem in error.problems]


def stored(bench: Recorded) -> dict[int, int]:
    """The programs on the card, and how many lines each has."""
    return {number: len(buffer) for number, buffer in bench.sim.controller.programs.items()}


def test_a_program_is_loaded_with_its_subprogram_and_listed(bench: Recorded) -> None:
    load_program(bench.client, read_program(TEXT), bench.client.dialect)
    assert stored(bench) == {501: 2, 1007: 7}
    assert bench.times_sent("LIST PROG1007") == bench.times_sent("LIST PROG501") == 1
    assert not bench.client.buffer_may_be_open
    assert bench.client.faults.total == 0


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(
    ("dialect", "places"), [(PMAC, range(15)), (TURBO, (0, 8))], ids=lambda each: getattr(each, "name", "")
)
@pytest.mark.first(3)
def test_a_fault_at_any_line_leaves_no_buffer_open_and_no_line_is_sent_twice(
    machine: MachineProfile, dialect: Dialect, places: Iterable[int], fault: str
) -> None:
    for place in places:
        fault_at(place, fault, recorded(machine, dialect))


def fault_at(place: int, fault: str, bench: Recorded) -> None:
    """Load a program on a line with a fault in one place, and once more where the fault has passed."""
    program = read_program(TEXT)

    def lines() -> Iterator[str]:
        for number, line in enumerate(program.lines):
            if number == place:
                bench.inject(fault, **FAULTS[fault])
            yield line

    with pytest.raises(LinkError) as told:
        bench.client.download(lines())
    assert told.value.problems[0].key == program.lines[place]
    assert codes(told.value)[1] == "link.outcome_unknown"
    assert "controller.buffer_may_be_open" not in codes(told.value)
    for line in {*program.lines} - {"CLOSE"}:
        assert bench.times_sent(line) == program.lines[: place + 1].count(line)
    before = stored(bench)
    assert bench.client.query("P2", "P3") == ("50", "75")
    bench.client.request("P2=51")
    assert bench.sim.controller.open_buffer is None
    assert (stored(bench), bench.value(2)) == (before, 51), "it is carried out, and not stored"
    load_program(bench.client, program, bench.client.dialect)
    assert stored(bench) == {501: 2, 1007: 7}


def test_a_line_that_is_refused_is_named_and_the_buffer_is_closed(bench: Recorded) -> None:
    with pytest.raises(ControllerError) as refused:
        bench.client.download(["OPEN PROG 3 CLEAR", "INC", "X10 <=", "X20"])
    assert (refused.value.error_number, refused.value.problems[0].value) == (3, "X10 <=")
    assert bench.sim.controller.open_buffer is None
    assert not bench.client.buffer_may_be_open
    assert bench.times_sent("X20") == 0


def test_the_buffer_of_somebody_else_is_not_closed_by_a_download_that_is_refused(bench: Recorded) -> None:
    other = bench.sim.connect()
    other.receive(b"OPEN PROG 9 CLEAR\r")
    bench.sim.wait(0.02)
    with pytest.raises(ControllerError) as refused:
        bench.client.download(["OPEN PROG 3 CLEAR", "INC", "CLOSE"])
    assert refused.value.error_number == 7
    opened = bench.sim.controller.open_buffer
    assert opened is not None
    assert opened.number == 9


def test_a_line_that_does_not_come_at_all_closes_the_buffer_as_well(bench: Recorded) -> None:
    def lines() -> Iterator[str]:
        yield "OPEN PROG 3 CLEAR"
        yield "INC"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bench.client.download(lines())
    assert bench.sim.controller.open_buffer is None


def test_a_buffer_that_cannot_be_closed_is_told_and_connecting_again_closes_it(bench: Recorded) -> None:
    def lines() -> Iterator[str]:
        yield "OPEN PROG 3 CLEAR"
        bench.sim.faults.inject("hang", for_s=20.0)
        yield "INC"

    with pytest.raises(LinkError) as told:
        bench.client.download(lines())
    expected = ["link.silent", "link.outcome_unknown", "link.not_in_step", "controller.buffer_may_be_open"]
    assert codes(told.value) == expected
    assert (bench.client.buffer_may_be_open, bench.sim.controller.open_buffer is None) == (True, False)
    bench.sim.wait(20.0)
    bench.client.connect()
    assert (bench.client.buffer_may_be_open, bench.sim.controller.open_buffer is None) == (False, True)
    assert bench.client.query("P2", "P3") == ("50", "75")


@pytest.mark.parametrize("line", ["I3=0 I6=0", "I3=1 I6=3", "I3=0", "I6=2"])
def test_a_line_set_otherwise_in_a_download_is_set_again_and_closed(bench: Recorded, line: str) -> None:
    """The CLOSE is then answered in words that are not known here, or not at all."""

    def lines() -> Iterator[str]:
        yield "OPEN PROG 3 CLEAR"
        yield "INC"
        bench.sim.faults.inject("stranger-writes", line=line)
        bench.sim.wait(0.02)
        yield "X10"
        yield "X10 <="

    with pytest.raises(DriverError) as told:
        bench.client.download(lines())
    assert "controller.buffer_may_be_open" not in codes(told.value)
    assert (bench.client.buffer_may_be_open, bench.sim.controller.open_buffer) == (False, None)
    assert stored(bench)[3] <= 2
    assert bench.client.query("I3", "I6", "P2") == ("2", "1", "50")


def test_a_card_that_is_switched_off_and_on_in_a_download_is_spoken_to_again(bench: Recorded) -> None:
    def lines() -> Iterator[str]:
        yield "OPEN PROG 3 CLEAR"
        bench.sim.power_cycle()
        yield "INC"

    with pytest.raises(DriverError):
        bench.client.download(lines())
    assert bench.client.query("I3", "I6") == ("2", "1")
    assert not bench.client.buffer_may_be_open


def test_a_line_of_a_program_that_is_no_line_for_it_is_not_carried_out_unnoticed(bench: Recorded) -> None:
    """`P1` alone answers its value where no buffer is open: it was sent to be stored."""
    with pytest.raises(DriverError):
        bench.client.download(["CLOSE", "OPEN PROG 3 CLEAR", "P1", "CLOSE"])
    assert bench.sim.controller.open_buffer is None


@pytest.mark.parametrize(
    ("stranger", "where", "line", "met", "sent"),
    [
        (["OPEN PROG 1007", "X1", "CLOSE"], "PROG 1007", "line 8", "X1", ""),
        (["OPEN PROG 1007 CLEAR", "INC", "CLOSE"], "PROG 1007", "line 2", "", "LINEAR TA100 TS0 TM1000"),
        (["OPEN PROG 501 CLEAR", "P3=P3*3", "RETURN", "CLOSE"], "PROG 501", "line 1", "P3=P3*3", "P3=P3*2"),
    ],
)
def test_what_the_card_holds_otherwise_is_named_with_its_line(
    bench: Recorded, stranger: list[str], where: str, line: str, met: str, sent: str
) -> None:
    program = read_program(TEXT)
    load_program(bench.client, program, bench.client.dialect)
    bench.client.download(stranger)
    with pytest.raises(DriverError) as differs:
        verify_program(bench.client, program)
    problem = differs.value.problems[0]
    assert problem.code == "controller.program_differs"
    assert (problem.where, problem.key, problem.value, problem.limit) == (where, line, met, sent)


def test_a_program_that_is_not_there_is_refused(bench: Recorded) -> None:
    with pytest.raises(ControllerError) as refused:
        verify_program(bench.client, read_program(TEXT))
    assert refused.value.error_number == 3


@pytest.mark.parametrize("form", range(4))
def test_a_listing_in_another_form_or_spelling_is_the_same_program(bench: Recorded, form: int) -> None:
    """I9 chooses between LIN and LINEAR, ENDW and ENDWHILE; spaces and case are free."""
    program = read_program(TEXT)
    load_program(bench.client, program, bench.client.dialect)
    bench.client.request(f"I9={form}")
    verify_program(bench.client, program)
    ask, met = bench.client.question, list[str]()

    def question(line: str, timeout_s: float) -> tuple[str, ...]:
        met.extend(spelled := tuple(each.lower().replace("(", " ( ") for each in ask(line, timeout_s)))
        return spelled

    bench.client.question = question  # type: ignore[assignment, method-assign]
    verify_program(bench.client, program)
    assert ("endwhile" if form % 2 else "endw") in met
    assert "while ( p1<3)" in met


def test_a_long_program_is_read_back_over_a_slow_line(bench: Recorded) -> None:
    """600 lines of 18 characters are 11 kB: 11 s at 9600 baud, far more than a reply may take."""
    lines = "\n".join(f"X{1000 + n}.125 Y{2000 + n}.25" for n in range(600))
    program = read_program(f"OPEN PROG 4 CLEAR\n{lines}\nCLOSE\n")
    load_program(bench.client, program, bench.client.dialect)
    bench.sim.faults.inject("9600-baud")
    before_s = bench.sim.now_s()
    verify_program(bench.client, program)
    assert 10.0 < bench.sim.now_s() - before_s < 14.0


@pytest.mark.parametrize("fault", FAULTS)
def test_a_listing_that_a_fault_spoils_is_asked_for_once_more(bench: Recorded, fault: str) -> None:
    program = read_program(TEXT)
    load_program(bench.client, program, bench.client.dialect)
    bench.line.sent.clear()
    bench.inject(fault, **FAULTS[fault])
    verify_program(bench.client, program)
    assert bench.times_sent("LIST PROG501") == 2
    assert bench.times_sent("LIST PROG1007") == 1


def test_a_refused_line_is_told_with_its_place_in_the_source(bench: Recorded) -> None:
    """The reader of a text does not know which motors the card has; the line may be of an included file."""
    head = '#define FAST 20\n; a remark\n#include "axes.h"\nOPEN PROG 5 CLEAR\nF(FAST)\nX10\nCLOSE\n'
    refused = read_program(head, include=lambda _: "P1=1\n#define MOTOR 99\n#MOTOR J/")
    with pytest.raises(ControllerError) as error:
        load_program(bench.client, refused, bench.client.dialect)
    assert codes(error.value) == ["controller.err003", "program.refused_source"]
    assert error.value.problems[1].key == "3, axes.h:3"
    assert error.value.problems[0].value == "#99 J/"
    good = read_program(head, include=lambda _: "P1=1")
    load_program(bench.client, good, bench.client.dialect)
    assert bench.client.question("LIST PROG5")[:2] == ("F(20)", "X10")


# Everything that a program is downloaded with is read back: one wrong digit in any of it is refused.

FAMILIES = ("pmac", "turbo")
every_strategy = pytest.mark.parametrize("strategy", list(Strategy))
every_family = pytest.mark.parametrize("family", FAMILIES)


@cache
def machine_of(family: str) -> MachineProfile:
    return compact(family)


@cache
def plan_of(family: str, strategy: Strategy) -> CutPlan:
    job = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.5)
    return plan_cut(job, machine_of(family), strategy)


class Line(MemoryLink):
    """A line on which one sent line arrives otherwise."""

    def __init__(self, sim: SimulatedLathe, sent: str = "", arrives: str = "") -> None:
        super().__init__(sim.connect(), sim)
        self.sent, self.arrives = sent.encode("ascii"), arrives.encode("ascii")

    def send(self, data: bytes) -> None:
        if self.sent and data.rstrip(b"\r") == self.sent:
            data = self.arrives + b"\r"
        super().send(data)


def loaded(family: str, strategy: Strategy, sent: str = "", arrives: str = "") -> tuple[PmacClient, LoadedProgram]:
    sim = SimulatedLathe(machine_of(family))
    client = PmacClient(Line(sim, sent, arrives), sim)
    client.connect()
    return client, load_program(client, plan_of(family, strategy).program, DIALECTS[family])


def settings_sent(family: str, strategy: Strategy) -> list[str]:
    """The lines in front of the program that set something."""
    lines = plan_of(family, strategy).program.lines
    before = lines[: next(place for place, line in enumerate(lines) if line.startswith("OPEN"))]
    return [line for line in before if re.match(r"[PIM]\d+(=|->)|W[XY]:", line)]


def another_digit(line: str) -> str:
    """The line with one digit of its last number changed, as a bad line makes it."""
    start = re.search(r"[0-9.]+(?=\)?$)", line)
    assert start is not None, line
    place = next((at for at in range(start.start(), len(line)) if line[at] in "123456789"), start.start())
    return f"{line[:place]}{(int(line[place]) + 1) % 10}{line[place + 1 :]}"


@every_family
@every_strategy
def test_a_program_with_all_that_stands_before_it_is_found_as_it_was_sent(family: str, strategy: Strategy) -> None:
    client, program = loaded(family, strategy)
    verify_loaded(client, program)


@every_family
@every_strategy
@pytest.mark.first(2)
def test_one_wrong_digit_in_any_setting_is_refused_by_name(family: str, strategy: Strategy) -> None:
    """In the Turbo in those that it words in its own way: the others are the same lines."""
    known = settings_sent("pmac", strategy) if family == "turbo" else []
    for line in settings_sent(family, strategy):
        if line in known:
            continue
        if line.startswith(("P40=I", "P41=I")):
            continue  # of another variable, which may not be there
        with pytest.raises(DriverError) as refused:
            loaded(family, strategy, line, another_digit(line))
        told = {problem.code for problem in refused.value.problems}
        assert told & {"controller.constant_differs", "controller.err003"}, (line, another_digit(line))


@every_family
def test_one_wrong_entry_of_the_table_is_named_with_its_place(family: str) -> None:
    lines = plan_of(family, Strategy.CAM).program.lines
    entries = next(line for line in lines if re.fullmatch(r"[-\d ]+", line) and not line.startswith("0 "))
    first, rest = entries.split(" ", 1)
    with pytest.raises(DriverError) as refused:
        loaded(family, Strategy.CAM, entries, f"{int(first) * 10} {rest}")
    (problem,) = refused.value.problems
    assert (problem.code, problem.value, problem.limit) == (
        "controller.table_differs",
        str(int(first) * 10),
        first,
    )


@every_family
@pytest.mark.parametrize(
    ("strategy", "line", "code"),
    [
        (Strategy.PVT, "P11=P11+500", "controller.constant_differs"),
        (Strategy.PVT, "P12=P12*4 P15=P15*4", "controller.constant_differs"),
        (Strategy.NONE, "P23=5", "controller.constant_differs"),
        (Strategy.CAM, "P35=P35+1", "controller.constant_differs"),
        (Strategy.CAM, "M169->D:$20", "controller.constant_differs"),
        (Strategy.CAM, "#1DELETE COMP", "controller.err003"),
        (Strategy.TIMEBASE, "P40=P40+1", "controller.constant_differs"),
        (Strategy.TIMEBASE, "P18=P18*2", "controller.constant_differs"),
        (Strategy.PAPER, "P500=P500*2", "controller.constant_differs"),
        (Strategy.PVT, f"{FINISHED}=1", "controller.constant_differs"),
    ],
)
def test_what_another_host_writes_is_found(family: str, strategy: Strategy, line: str, code: str) -> None:
    client, program = loaded(family, strategy)
    client.request(line)
    with pytest.raises(DriverError) as refused:
        verify_loaded(client, program)
    assert refused.value.problems[0].code == code


def test_what_a_program_sets_itself_is_left_out_once_it_has_ended() -> None:
    client, program = loaded("pmac", Strategy.PVT)
    client.request(f"{TURNS_CUT}=34 {FINISHED}=1 P25=7")
    verify_loaded(client, program, ended=True)
    with pytest.raises(DriverError):
        verify_loaded(client, program)


@every_family
@every_strategy
def test_rounding_behind_the_eighth_digit_is_no_difference(family: str, strategy: Strategy) -> None:
    """Controllers report some ten digits; nine of them say the same."""
    plan = plan_of(family, strategy)
    constants = [each for each in constants_of(plan.program, DIALECTS[family]) if each.value]
    sim = SimulatedLathe(machine_of(family))
    client = PmacClient(MemoryLink(sim.connect(), sim), sim)
    client.connect()
    program = load_program(client, plan.program, DIALECTS[family])
    for each in constants:
        if each.name.startswith("P"):
            client.request(f"{each.name}={each.value:.9g}")
    verify_loaded(client, program)
