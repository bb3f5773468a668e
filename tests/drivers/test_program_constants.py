"""Everything that a program is downloaded with is read back: one wrong digit in any of it is refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import pytest

from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.errors import DriverError
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import DIALECTS
from drivers.pmac.program_constants import constants_of
from drivers.pmac.program_load import LoadedProgram, load_program, verify_loaded
from drivers.pmac.programs.setup import FINISHED, TURNS_CUT
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import load_job
from tests.system.lathe_sites import compact

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
