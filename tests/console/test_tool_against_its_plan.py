"""The tool is judged against its plan, and by the witness that the controller runs in each cycle."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

from benchmarks.hostile_host import JOB as HOSTILE_JOB
from benchmarks.hostile_host import WitnessedLathe, lathe_at, make, plan_of
from console.session.cut.cut_verdict import BUDGET, CutJudgement, CutVerdict, ToolError, ToolPolls, fit_tool_error
from console.session.cut.engine import CutContext, PartStep
from console.session.cut.recording import TelemetryRows
from console.session.cut.run import cut_part
from drivers.cutting.planning import CutPlan, plan_cut
from drivers.cutting.strategy import Strategy
from drivers.lathe.lathe import Lathe
from drivers.lathe.polling import Poller
from drivers.lathe.snapshot import AxisState, Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.program_constants import find_assigned_variables
from drivers.pmac.witness import CONSTANTS, Witness, WitnessReport
from profiles.arrays import Floats, floats
from profiles.compensations.path import AlongCut
from profiles.problem import Problem, ProblemError
from profiles.store import load_job
from tests.console.floor import known
from tests.system.lathe_sites import compact

MACHINE = compact("pmac")
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=3.0)
POLL_S, TURN_S = 0.023, 0.06


def polls_of(count: int) -> tuple[Floats, Floats]:
    """Turns of the spindle and mm along the cut, at even times."""
    turns = floats(np.arange(count) * POLL_S / TURN_S)
    return turns, floats(0.05 * turns)


def known_error(noise_um: float, count: int = 160) -> ToolError:
    """Fit an error whose parts are written down here."""
    turns, past_mm = polls_of(count)
    z = (past_mm - past_mm.mean()) / np.ptp(past_mm)
    error_um = (
        -14.0 + 9.0 * z + 4.0 * np.cos(2.0 * np.pi * 3.0 * turns - 1.0) + 0.8 * np.sin(2.0 * np.pi * 7.0 * turns)
    )
    error_um += np.random.default_rng(5).normal(0.0, noise_um, count)
    found = known(fit_tool_error(turns, past_mm, error_um, 3))
    return found


def test_the_error_is_told_part_by_part() -> None:
    found = known_error(1e-6)
    assert found.mean_um == pytest.approx(-14.0, abs=1e-4)
    assert found.slope_um == pytest.approx(9.0, abs=1e-4)
    assert abs(found.orders[3]) == pytest.approx(4.0, abs=1e-4)
    assert np.angle(found.orders[3]) == pytest.approx(-1.0, abs=1e-4)
    assert abs(found.orders[7]) == pytest.approx(0.8, abs=1e-4)
    assert abs(found.orders[2]) < 1e-4
    assert found.size_um == pytest.approx(2.0 * (14.0 + 4.5), abs=1e-3), "the diameter, at the worse end"


def test_the_standard_errors_are_those_of_a_second_formulation() -> None:
    """The same model by `numpy.linalg.lstsq`, in columns written down anew, residual scatter over freedom."""
    turns, past_mm = polls_of(160)
    noise = np.random.default_rng(2).normal(0.0, 0.4, 160)
    found = known(fit_tool_error(turns, past_mm, noise, 3))
    z = (past_mm - past_mm.mean()) / np.ptp(past_mm)
    decays = [np.exp(-turns / over) for over in (3.0, 12.0)]
    waves = [wave(2.0 * np.pi * n * turns) for n in range(1, 16) for wave in (np.cos, np.sin)]
    lobe = [z * wave(6.0 * np.pi * turns) for wave in (np.cos, np.sin)]
    columns = np.stack([np.ones(160), z, *(each - each.mean() for each in decays), *waves, *lobe], axis=1)
    solved, squares, *_ = np.linalg.lstsq(columns, noise, rcond=None)
    covariance = np.linalg.inv(columns.T @ columns) * squares[0] / (160 - columns.shape[1])
    wider = np.sqrt(found.polls / found.independent)
    assert found.mean_um == pytest.approx(solved[0], abs=1e-9)
    assert found.mean_se_um == pytest.approx(wider * np.sqrt(covariance[0, 0]), rel=1e-6)
    assert found.slope_se_um == pytest.approx(wider * np.sqrt(covariance[1, 1]), rel=1e-6)
    assert found.orders[4] == pytest.approx(complex(solved[10], -solved[11]), abs=1e-9)


def test_an_error_of_the_lobe_that_changes_along_the_cut_is_no_scatter() -> None:
    """4 um mid-cut that are 3 at one end and 5 at the other: told at the worse end, and as sure as without."""
    turns, past_mm = polls_of(160)
    z = (past_mm - past_mm.mean()) / np.ptp(past_mm)
    noise = np.random.default_rng(4).normal(0.0, 0.3, 160)
    wave = np.cos(6.0 * np.pi * turns)
    found, even = (
        known(fit_tool_error(turns, past_mm, (4.0 + more * z) * wave + noise, 3)) for more in (2.0, 0.0)
    )
    assert abs(found.lobe_change_um) == pytest.approx(2.0, abs=0.3)
    assert found.roundness_um == pytest.approx(10.0, abs=0.6) and even.roundness_um == pytest.approx(8.0, abs=0.6)
    assert found.roundness_within_um == pytest.approx(even.roundness_within_um, rel=0.05)


def test_neighbours_that_are_alike_count_as_fewer_polls() -> None:
    turns, past_mm = polls_of(3000)
    white = np.random.default_rng(1).normal(0.0, 1.0, 3001)
    alone, alike = (fit_tool_error(turns, past_mm, each, 3) for each in (white[1:], white[1:] + white[:-1]))
    assert alone is not None
    assert alike is not None
    # r = 1/2 for the sum of neighbours: (1 - r) / (1 + r) = 1/3.
    assert alike.independent == pytest.approx(1000, rel=0.2)
    assert alone.independent > 2700


def test_what_is_only_scatter_is_no_roundness_and_too_few_polls_tell_nothing() -> None:
    """A poll a turn is always at the same angle: a mean and a lobe are the same there."""
    turns, past_mm = polls_of(160)
    found = known(fit_tool_error(turns, past_mm, np.zeros(160), 3))
    assert (found.roundness_um, found.size_um) == (0.0, 0.0)
    assert known_error(0.3).roundness_um == pytest.approx(9.5, abs=0.5), "4 and 0.8 um: 8 to 9.6 peak to peak"
    for count in (0, 1, 15):
        assert fit_tool_error(turns[:count], past_mm[:count], np.zeros(count), 3) is None
    turns = np.arange(100.0)
    assert fit_tool_error(turns, 0.05 * turns, np.zeros(100), 3) is None


@cache
def plan(strategy: Strategy = Strategy.PVT) -> CutPlan:
    return plan_cut(JOB, MACHINE, strategy)


def verdict(
    *,
    tool: complex = 0j,
    command: complex = 0j,
    order: int = 3,
    deeper_um: float = 0.0,
    scatter_um: float = 0.3,
    strategy: Strategy = Strategy.PVT,
    from_turn: int = 0,
    uneven_deg: float = 0.0,
    brief_um: float = 0.0,
    brief_turns: tuple[float, float] = (20.0, 21.0),
    late_um: float = 0.0,
    witness: WitnessReport | None = None,
    unheld: bool = True,
) -> CutVerdict:
    """A cut whose tool and command are off by a wave of an order, all along, and whose tool is so much deeper.

    A table reads the spindle one servo cycle late: its command is that of the angle before. The spindle is ahead
    of its command and behind it by `uneven_deg`, twice a turn. The command is `brief_um` off in `brief_turns`,
    which are three polls. One poll is interrupted for 40 ms, and its tool is read `late_um` too deep.
    """
    setup, chance, per_um = plan(strategy).setup, np.random.default_rng(1), 1.0 / MACHINE.tool.count_um
    late_turns = 0.0 if strategy is Strategy.PVT else 1e-3 * MACHINE.controller.servo_period_ms / TURN_S
    polls = ToolPolls(plan(strategy), MACHINE, JOB)
    for number in range(int(setup.whole_turns * TURN_S / POLL_S)):
        at_s = number * POLL_S
        turn = at_s / TURN_S
        z = setup.carriage_start + turn * setup.carriage_per_turn
        past_mm = (z - setup.carriage_middle) / MACHINE.carriage.counts_per_mm
        wave = np.exp(2j * np.pi * order * turn)
        commanded_um = plan(strategy).command.at_um(360.0 * (turn - late_turns), past_mm) + (command * wave).real
        commanded_um += brief_um * (brief_turns[0] < turn < brief_turns[1])
        late = bool(late_um) and number == 80
        off_um = (tool * wave).real + deeper_um + late * late_um + chance.normal(0.0, scatter_um)
        tool_um = plan(strategy).target.at_um(360.0 * turn, past_mm) + off_um
        at, asked = setup.surface + float(tool_um) * per_um, setup.surface + float(commanded_um) * per_um
        ahead = uneven_deg / 360.0 * np.sin(4.0 * np.pi * turn)
        spindle = ((from_turn + turn + ahead) * setup.counts_per_turn, -ahead * setup.counts_per_turn)
        places = ((at, asked - at), spindle, (z, 0.0))
        axes = [AxisState(position=float(p), following_error=float(e), flags=frozenset()) for p, e in places]
        polls.see(
            Snapshot(
                asked_s=at_s,
                at_s=at_s + (0.045 if late else 0.005),
                program_running=True,
                runtime_error=False,
                tool=axes[0],
                spindle=axes[1],
                carriage=axes[2],
            )
        )
    return polls.verdict(witness, unheld=unheld)


def test_the_polls_of_a_cut_without_a_hold_are_what_the_following_error_of_its_witness_is_judged_by() -> None:
    """A feed hold moves the tool out and in: what the witness has seen then, the polls of the cut have not."""
    extremes = {"bias": (0.0, 0.0), "compensation": (0.0, 0.0), "following_error": (-300.0, 300.0)}
    report = WitnessReport(before={}, first={}, extremes=extremes)
    found = verdict(witness=report)
    assert [each.code for each in found.changes] == ["cut.witness_following_error"]
    assert found.judgement is CutJudgement.DISTURBED
    assert verdict(witness=report, unheld=False).changes == ()


def test_a_tool_on_its_path_is_as_planned_however_far_its_spindle_has_turned_before() -> None:
    """At 1000 rpm a servo cycle is 2.7 degrees: counted from the wrong turn it would be a disturbance."""
    for found in (verdict(), *(verdict(strategy=Strategy.CAM, from_turn=turn) for turn in (0, 2000))):
        assert (found.judgement, found.problems) == (CutJudgement.AS_PLANNED, ())


def test_a_command_that_is_off_by_half_a_micrometre_is_a_disturbance() -> None:
    """All along every turn is like the others: only the plan tells. In a mean three polls of 160 are nothing."""
    for order in (2, 3, 9):
        found = verdict(command=0.7 + 0j, tool=0.7 + 0j, order=order)
        assert found.judgement is CutJudgement.DISTURBED and found.judgement.exit_code == 1
        assert [(each.code, each.where) for each in found.problems] == [("cut.command_off_plan", f"{order}/rev")]
    found = verdict(brief_um=0.8)
    assert found.judgement is CutJudgement.DISTURBED
    assert [each.code for each in found.problems] == ["cut.off_path"]
    for found, disturbed in (
        (verdict(command=0.45 + 0j), False),
        (verdict(command=0.55 + 0j), True),
        (verdict(brief_um=0.4), False),
    ):
        assert (found.judgement is CutJudgement.DISTURBED) is disturbed


@pytest.mark.parametrize(("brief_um", "disturbed"), [(8.0, False), (10.0, True)])
def test_one_poll_alone_is_a_disturbance_where_no_servo_cycle_makes_as_much(
    brief_um: float, disturbed: bool
) -> None:
    """4 um, and what a command of 33 um makes in a servo cycle, 33 x 3 x 0.046 rad: 4.6 um. One of 160 polls."""
    found = verdict(brief_um=brief_um, brief_turns=(20.2, 20.5))
    assert [each.code for each in found.problems] == (["cut.off_path"] if disturbed else [])
    assert (found.judgement is CutJudgement.DISTURBED) is disturbed


def test_a_spindle_of_uneven_speed_is_an_error_of_the_tool_and_no_disturbance() -> None:
    """5 % of ripple twice a turn are 0.05 / 2 rad of angle: 27.5 um x 3 x 0.025 / 2 at 1 and at 5 a turn."""
    found = verdict(uneven_deg=math.degrees(0.025))
    assert found.command_problem is None
    assert found.tool is not None
    assert [abs(found.tool.orders[n]) for n in (1, 5)] == pytest.approx([1.03, 1.03], abs=0.1)


def test_a_tool_that_does_not_follow_has_an_error_of_its_own() -> None:
    """2.5 um of amplitude are 5 um of roundness, and the tool may use 70 % of the 5 um of the job."""
    found = verdict(tool=2.5 + 0j)
    assert found.judgement is CutJudgement.TOOL_ERROR
    assert [each.code for each in found.problems] == ["cut.tool_not_round"]
    assert found.problems[0].limit == "3.5 um"
    assert found.judgement.exit_code == 0, "the measured part decides"


def test_the_mean_is_judged_by_the_tolerance_of_the_diameter_or_only_told() -> None:
    """The bundled job allows 60 um of diameter either way, 42 of them to the tool: 21 um of radius."""
    assert verdict(deeper_um=-19.0).judgement is CutJudgement.AS_PLANNED
    judged = verdict(deeper_um=-23.0)
    assert [each.code for each in judged.problems] == ["cut.tool_off_size"]
    told = replace(judged, size_limit_um=None)
    assert told.judgement is CutJudgement.AS_PLANNED
    assert told.tool is not None and told.tool.size_um == pytest.approx(46.0, abs=1.0)


def test_a_tool_at_its_limit_or_a_cut_without_polls_is_not_proven() -> None:
    found = verdict(tool=1.75 + 0j, scatter_um=1.0)
    assert found.judgement is CutJudgement.NOT_PROVEN and found.judgement.exit_code == 4
    found = ToolPolls(plan(), MACHINE, JOB).verdict()
    assert [each.code for each in found.problems] == ["cut.too_few_polls"]
    assert sum(BUDGET.values()) == pytest.approx(1.0), "the whole tolerance"


def test_the_event_is_plain_json_with_the_crest_of_a_wave_in_degrees_of_the_spindle() -> None:
    """A third of a turn is a lobe: 60 degrees of its phase are 20 of the spindle."""
    for turned, crest_deg in ((0.0, 0.0), (np.pi / 3.0, 20.0)):
        event = verdict(tool=2.5 * np.exp(-1j * turned)).event()
        said = json.loads(json.dumps(event, allow_nan=False))
        assert said["cut_verdict"] == "tool_error"
        wave = next(each for each in said["tool"]["orders"] if each["n"] == 3)
        assert wave["amplitude_um"] == pytest.approx(2.5, abs=0.2)
        assert wave["crest_deg"] == pytest.approx(crest_deg, abs=2.0)


def test_a_poll_that_was_interrupted_is_not_judged() -> None:
    """Its values are not of one instant."""
    found, usual = verdict(late_um=100.0), verdict()
    assert found.tool is not None and usual.tool is not None
    assert found.tool.polls == usual.tool.polls - 1
    assert found.judgement is CutJudgement.AS_PLANNED
    assert found.tool.roundness_um == pytest.approx(usual.tool.roundness_um, abs=0.05)


@pytest.mark.parametrize(
    ("mean_um", "mean_se_um", "where"),
    [
        (1.2, 0.2, "3/rev"),  # larger, and less than 0.5 um and six of its standard errors
        (5.0, 0.5, "Ø"),
    ],
)
def test_what_is_furthest_beyond_its_scatter_is_told(mean_um: float, mean_se_um: float, where: str) -> None:
    """At three a turn it is off by 0.9 um, known to 0.05: an uncertain figure hides it not."""
    command = replace(
        known_error(0.01),
        mean_um=mean_um,
        mean_se_um=mean_se_um,
        slope_um=0.0,
        slope_se_um=0.0,
        orders={3: 0.9 + 0j},
        orders_se_um={3: 0.05},
    )
    found = CutVerdict(command=command)
    assert found.judgement is CutJudgement.DISTURBED
    assert found.command_problem is not None and found.command_problem.where == where


def test_the_record_counts_time_and_turns_from_the_first_poll_and_has_the_speed_of_the_last_second() -> None:
    setup, per_turn = plan().setup, MACHINE.spindle.counts_per_rev
    polls = [
        (7.0 + 0.2 * k, setup.surface + 500.0, (40.0 + 3.0 * k) * per_turn, setup.carriage_middle, 0.0)
        for k in range(11)
    ]
    rows = TelemetryRows(plan(), JOB, MACHINE)(polls)
    assert rows[:, 0] == pytest.approx(0.2 * np.arange(11))
    assert rows[:, 1] == pytest.approx(3.0 * np.arange(11))
    assert np.isnan(rows[0, 3]) and rows[1:, 3] == pytest.approx(900.0), "3 turns in 0.2 s"


@pytest.mark.parametrize("past_mm", [-1.2, 0.0, 1.2])
def test_the_record_has_the_error_of_a_tool_whose_lobe_grows_along_the_part(past_mm: float) -> None:
    """A tenth a millimetre: on its path 1.2 mm behind the middle it is in by 12 % more of its lobe."""
    planned = plan(Strategy.CAM)
    grown = replace(planned, target=replace(planned.target, along=AlongCut(orders=((3, (0.1,)),))))
    mean_um, lobe_um = grown.target.mean_um, grown.target.amplitude_um
    crest_turns = max((k / 360.0 for k in range(120)), key=lambda each: planned.target.at_um(360.0 * each))
    infeed_um = mean_um + (1.0 + 0.1 * past_mm) * lobe_um + 2.5
    poll = (
        0.0,
        grown.setup.surface + infeed_um / MACHINE.tool.count_um,
        crest_turns * MACHINE.spindle.counts_per_rev,
        grown.setup.carriage_middle + past_mm * MACHINE.carriage.counts_per_mm,
        0.0,
    )
    (row,) = TelemetryRows(grown, JOB, MACHINE)([poll])
    assert row[4] == pytest.approx(2.5, abs=0.05)


BRIEF_S = 0.012  # two background cycles; polls are 29 ms apart


@dataclass(kw_only=True)
class Cut:
    """A cut of a family, in which another host sends lines at moments of the program."""

    family: str = "pmac"
    strategy: Strategy = Strategy.PVT
    deeds: list[tuple[float, str]] = field(default_factory=list)
    before: Callable[[WitnessedLathe], None] = lambda _: None

    def made(self) -> CutVerdict | tuple[Problem, ...]:
        machine, plan = compact(self.family), plan_of(self.family, self.strategy)
        sim = WitnessedLathe(machine)
        lathe = lathe_at(sim, machine)

        def tell(step: PartStep, _: str) -> None:
            if step is PartStep.ARM:
                self.before(sim)
            if step is PartStep.CUT:
                sim.due = [(sim.now_s() + after_s, f"{line}\r".encode()) for after_s, line in self.deeds]

        lathe.connect()
        try:
            return cut_part(CutContext(lathe=lathe, workshop=sim), HOSTILE_JOB, plan, tell).figures.verdict
        except ProblemError as error:
            return tuple(error.problems)


@pytest.mark.parametrize("strategy", list(Strategy))
def test_no_program_writes_a_constant_that_is_witnessed(strategy: Strategy) -> None:
    """Nor one that this console may trim while it cuts."""
    witnessed = {f"P{number}" for number in CONSTANTS}
    for trimmed in {False, strategy.traits.trims}:
        program = plan_cut(HOSTILE_JOB, compact("pmac"), strategy, trimmed=trimmed).program
        assert not witnessed & find_assigned_variables(program)


@pytest.fixture
def nobody_reads_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    """By chance a reading may fall into the moment."""
    monkeypatch.setattr(Poller, "read_beside", lambda _: None)


BRIEF = {
    "gain": ("I130=I130/2", "I130=I130*2", "cut.witness_changed", "I130"),
    "scale": ("I108=I108+1", "I108=I108-1", "cut.witness_changed", "I108"),
    "encoder": ("I103=I103+1", "I103=I103-1", "cut.witness_changed", "I103"),
    "servo period": ("I10=I10+37137", "I10=I10-37137", "cut.witness_changed", "I10"),
    "constant": ("P22=P22+1", "P22=P22-1", "cut.witness_constant", "P11 … P621"),
    "along Z": ("P89=P89+5", "P89=P89-5", "cut.witness_constant", "P11 … P621"),
    "bias": ("M500->{bias} M500=M500+9216", "M500=M500-9216", "cut.witness_bias", "tool"),  # 3 counts
    "correction": ("M500->{comp} M500=M500+9216", "M500=M500-9216", "cut.witness_compensation", "tool"),
}
REGISTERS = {"pmac": {"bias": "D:$813", "comp": "D:$46"}, "turbo": {"bias": "D:$CC", "comp": "D:$90"}}


@pytest.mark.parametrize("name", BRIEF)
@pytest.mark.parametrize("family", ["pmac", "turbo"])
@pytest.mark.usefixtures("nobody_reads_beside")
def test_what_lasts_for_two_cycles_is_seen(family: str, name: str) -> None:
    first, later, code, key = BRIEF[name]
    at_s = 0.5 * plan_of(family, Strategy.PVT).duration_s
    deeds = [(at_s, first.format(**REGISTERS[family])), (at_s + BRIEF_S, later)]
    found = Cut(family=family, deeds=deeds).made()
    assert isinstance(found, tuple), found
    assert (found[0].code, found[0].key) == (code, key)


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.parametrize("family", ["pmac", "turbo"])
def test_a_cut_that_nobody_disturbs_has_nothing_to_say(family: str, strategy: Strategy) -> None:
    found = Cut(family=family, strategy=strategy).made()
    assert isinstance(found, CutVerdict), found
    assert (found.changes, found.unwitnessed) == ((), None)
    if strategy.traits.inverts:
        assert found.judgement is CutJudgement.AS_PLANNED


@pytest.mark.parametrize("seed", [0, 7])
def test_a_part_whose_entry_the_tool_has_taken_up_only_after_its_second_turn_is_measured(seed: int) -> None:
    """It gives way by 5 um at first, and by none a third of a turn later."""
    made, _ = make("turbo", Strategy.PAPER, None, seed, "hard")
    assert made.outcome == CutJudgement.TOOL_ERROR


@pytest.mark.parametrize(
    "lines",
    [
        ("DISABLE PLC21", "ENABLE PLC21"),
        ("OPEN PLC21 CLEAR\rP971=P971+1\rCLOSE\rENABLE PLC21", "P972=2"),
        ("P972=0", "P1=P1"),
        ("P971=P971+50", "P1=P1"),
    ],
)
def test_a_witness_that_was_stopped_or_changed_proves_nothing(lines: tuple[str, str]) -> None:
    at_s = 0.5 * plan_of("pmac", Strategy.PVT).duration_s
    found = Cut(deeds=[(at_s, lines[0]), (at_s + 0.1, lines[1])]).made()
    assert isinstance(found, CutVerdict), found
    assert found.judgement is CutJudgement.NOT_PROVEN
    assert [each.code for each in found.problems] == ["cut.witness_gap"]


@pytest.mark.parametrize(("text", "stays"), [("P900=P900+1", True), ("P971=P971+1", False)])
def test_the_program_of_somebody_else_keeps_its_number(text: str, stays: bool) -> None:
    """An older witness of ours, which begins in the same way, is replaced."""
    machine = compact("pmac")
    sim = WitnessedLathe(machine)
    link = MemoryLink(sim.connect(), sim)
    client = PmacClient(link, sim)
    Lathe(client, machine, sim, StopPath(link)).connect()
    client.download(("CLOSE", "OPEN PLC21", "CLEAR", text, "CLOSE", "ENABLE PLC21"))
    Witness(client, machine).prepare()
    listing = client.question("LIST PLC21", 1.0)
    assert (listing[0], len(listing) < 4) == (text, stays)


def test_a_controller_without_it_cuts_and_says_so() -> None:
    def delete(sim: WitnessedLathe) -> None:
        sim.enemy.receive(b"DELETE PLC21\r")
        sim.enemy.take_output()

    found = Cut(before=delete).made()
    assert isinstance(found, CutVerdict), found
    assert found.judgement is CutJudgement.AS_PLANNED
    assert [each.code for each in found.problems] == ["cut.witness_missing"]


def report(**extremes: tuple[float, float]) -> WitnessReport:
    settings = {"I130": 400.0}
    quiet = {"bias": (3.0, 3.0), "compensation": (0.0, 0.0), "following_error": (-1.0, 1.0)}
    return WitnessReport(before=settings, first=settings, extremes={**quiet, **extremes})


def test_a_following_error_between_the_polls_is_judged_by_that_of_the_polls() -> None:
    """Polled are -2 to 2 um: beyond them by more than their 4 um of height is told; after a hold nothing is."""
    within = report(following_error=(-5.9, 5.9))
    beyond = report(following_error=(-2.0, 6.1))
    assert list(within.changes(None, (-2.0, 2.0))) == []
    found = list(beyond.changes(None, (-2.0, 2.0)))
    assert [(each.code, each.value, each.limit) for each in found] == [
        ("cut.witness_following_error", "4.10 um", "4.0 um")
    ]
    assert list(beyond.changes(None, None)) == []


def test_the_correction_of_a_table_is_judged_by_its_entries() -> None:
    inside, outside = report(compensation=(-28.0, 28.0)), report(compensation=(-28.0, 28.5))
    assert list(inside.changes((-28.0, 28.0), None)) == []
    assert [each.value for each in outside.changes((-28.0, 28.0), None)] == ["0.50 um"]
