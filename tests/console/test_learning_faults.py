"""Parts in a row of `console run --learn`: the limits of a real machine, and what goes wrong meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pytest import MonkeyPatch

from benchmarks.learning import OFF
from console.session.cut.engine import CutContext, PartStep
from console.session.cut.run import plan_run
from console.session.learning import learning
from console.session.learning.learning import learn
from console.text.catalogue import load
from drivers.cutting import planning
from drivers.cutting.cut_program import CutProgram
from drivers.cutting.planning import Strategy, plan_cut
from drivers.lathe.heartbeat import Heartbeat, cut_condition
from drivers.lathe.lathe import Lathe
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.stop import StopPath
from drivers.link.memory import MemoryLink
from drivers.pmac.client import PmacClient
from drivers.pmac.language.syntax import VariableKind
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.true_parameters import ideal
from profiles.problem import Problem, ProblemError
from profiles.store import load_job
from tests.compact import compact_machine
from tests.console.commands import Console, JobFile

pytestmark = [pytest.mark.timeout(300), pytest.mark.long]

HALF_MM, QUARTER_MM = "4.0", "2.0"
"""Half and a quarter of the cut of the paper's jobs: there is less to learn from, and the limits are the same."""


def lobe_um_pp(part: dict[str, Any]) -> float:
    return 2.0 * next(float(each["amplitude_um"]) for each in part["harmonics"] if each["n"] == 3)


def test_the_third_part_is_as_the_machine(console: Console, close: tuple[str, str], job_file: JobFile) -> None:
    words = (
        str(job_file(cut_length_mm=HALF_MM)),
        *close,
        "--sim",
        "--plant",
        "steady",
        "--seed",
        "11",
        "--strategy",
        "cam",
        "--learn",
        "3",
        "--json",
    )
    result = console("run", *words).json
    first, second, third = result["passes"]
    floor = result["floor"]
    assert result["before"]["RONt_um"] > 50.0
    assert first["RONt_um"] <= 5.0
    assert third["RONt_um"] <= min(3.0, floor["RONt_um"] + 1.0)
    assert lobe_um_pp(third) < 0.7
    assert result["after"] == {key: third[key] for key in result["after"]}
    # In air the tool was 10 um off and more, as friction makes it; it was learned away before the first part.
    air = first["learned"]["air_lobe_error_um_pp"]
    assert air[0] > 8.0 and air[-1] < 0.5
    # The cutting force makes a wave of its own on a soft servo, which the first part learns away while it is cut.
    assert 1.0 < first["learned"]["trim"][0]["amplitude_um"] < 4.0
    assert second["learned"]["trim"][0]["amplitude_um"] < 0.5
    assert [part["learned"]["frozen"] for part in result["passes"]] == [[], [], []]
    assert {3, 9} <= set(first["learned"]["learned_waves"])
    # The mean depth comes with the parts: the force holds the first one too large.
    assert abs(third["mean_deviation_um"]) < 2.0 < first["mean_deviation_um"]


def test_a_gain_is_learned(console: Console, close: tuple[str, str], tmp_path: Path, job_file: JobFile) -> None:
    job = str(job_file(lobe_error_um_pp="33.0", cut_length_mm=QUARTER_MM))
    plant = tmp_path / "weak.toml"
    plant.write_text(OFF, encoding="utf-8")
    words = (*close, "--sim", "--plant", str(plant), "--seed", "5", "--strategy", "cam", "--learn", "1", "--json")
    (first,) = console("run", job, *words).json["passes"]
    assert first["RONt_um"] <= 6.0
    assert lobe_um_pp(first) == pytest.approx(0.05 * 33.0, abs=0.7), "the wrench is what is left"


def test_learning_needs_a_table_and_a_gauge(console: Console) -> None:
    said = console("run", "lee-2001-experiment-1", "--sim", "--strategy", "pvt", "--learn", "3")
    assert said.code != 0
    assert "cam" in said.err
    there = ("--machine", "lee-2001-lathe", "--link", "sim:", "--strategy", "cam", "--learn", "3", "--yes")
    said = console("run", "lee-2001-experiment-1", *there)
    assert said.code != 0
    assert "not measured" in said.err
    assert console("run", "lee-2001-experiment-1", "--sim", "--strategy", "cam", "--learn", "0").code == 2


def test_a_low_process_gain(console: Console, close: tuple[str, str], job_file: JobFile, tmp_path: Path) -> None:
    """A fifth of 55 um stays on the first part, whatever was learned in air: the scale does not see it."""
    plant = tmp_path / "eight-tenths.toml"
    plant.write_text('like = "steady"\n[cut]\nprocess_gain = 0.8\n', encoding="utf-8")
    words = (*close, "--sim", "--plant", str(plant), "--seed", "11", "--strategy", "cam", "--learn", "3", "--json")
    result = console("run", str(job_file(cut_length_mm=QUARTER_MM)), *words).json
    first, second, third = (part["RONt_um"] for part in result["passes"])
    assert 0.2 * 55.0 - 2.0 < first < 0.2 * 55.0 + 3.0
    assert third < second < first
    assert third < result["floor"]["RONt_um"] + 2.0


def test_a_path_that_is_refused_ends_the_series_with_the_parts_so_far(
    console: Console,
) -> None:
    """The chuck of this lathe presses an oval of 56 um p-p beside a lobe of 33."""
    plant = ("--sim", "--plant", "realistic", "--seed", "7", "--strategy", "cam", "--learn", "3", "--json")
    said = console("run", "lee-2001-experiment-2", *plant)
    assert (said.code, len(said.json["passes"])) == (0, 1)
    assert said.json["after"]["RONt_um"] == said.json["passes"][0]["RONt_um"]
    ended, why = said.json["warnings"][-2:]
    assert "part 2 of 3 was not cut" in ended
    rows = said.json["passes"][0]["learned"]["certificate"]
    assert {"refused"} < {each["standing"] for each in rows} and "learned" not in {
        each["standing"] for each in rows
    }
    assert "2/rev" in why and "allowed <= 15.9 um" in why and "Check the chuck" in why


def test_a_strategy_that_cannot_be_learned_is_refused_before_the_job_is_planned(
    console: Console, job_file: JobFile
) -> None:
    too_fast = str(job_file(spindle_speed_rpm="9000.0"))
    said = console("run", too_fast, "--sim", "--strategy", "pvt", "--learn", "3", "--json")
    assert [each["code"] for each in said.json["errors"]] == ["learning.strategy"]


MACHINE = compact_machine().machine
JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=2.0)
IN_CUT_S = 4.75
"""Behind the start of the cut of a part: its way to the row of zeros takes 2.4 s, its run-up 0.8 s.

A batch of the cut is being fetched then."""


@dataclass
class Row:
    """A row of one part on an ideal lathe; `meanwhile` is called once, in the middle of the cut of the part."""

    meanwhile: Callable[[SimulatedLathe], None]
    sim: SimulatedLathe = field(default_factory=lambda: SimulatedLathe(MACHINE))
    due_s: float | None = None
    met: list[Snapshot] = field(default_factory=list)

    def shop(self) -> CutContext:
        link = MemoryLink(self.sim.connect(), self.sim)
        client = PmacClient(link, self.sim)
        heartbeat = Heartbeat(client, self.sim, MACHINE)
        lathe = Lathe(client, MACHINE, self.sim, StopPath(link), seen=self.see, heartbeat=heartbeat)
        return CutContext(lathe=lathe, workshop=self.sim)

    def tell(self, part: str, step: PartStep, _: str) -> None:
        if part == "part" and step is PartStep.CUT:
            self.due_s = self.sim.now_s() + IN_CUT_S

    def see(self, snapshot: Snapshot) -> None:
        self.met.append(snapshot)
        if self.due_s is not None and snapshot.at_s >= self.due_s:
            self.due_s = None
            self.meanwhile(self.sim)

    def learn(self, monkeypatch: MonkeyPatch) -> float:
        """Return the roundness of the part."""
        monkeypatch.setattr(learning, "MOST_AIR_PASSES", 0)
        plan = plan_run(JOB, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
        return learn(plan, self.shop, self.tell, 1).parts[0].roundness.ront_um


def stranger(sim: SimulatedLathe) -> None:
    sim.faults.inject("stranger-writes", line="DELETE GATHER")


def lost_reply(sim: SimulatedLathe) -> None:
    sim.faults.inject("dropped-ack", replies=1)


def test_who_deletes_the_gathering_ends_the_cut_with_the_tool_out(monkeypatch: MonkeyPatch) -> None:
    row = Row(stranger)
    with pytest.raises(ProblemError) as refused:
        row.learn(monkeypatch)
    assert [problem.code for problem in refused.value.problems] == ["gather.failed"]
    last = row.met[-1]
    assert last.at_rest and last.loops_closed
    tip_mm = MACHINE.tool.home_radius_mm - last.tool.position / MACHINE.tool.counts_per_mm
    assert tip_mm > JOB.radius_mm + 1.0
    # The table was left in its row of zeros, and is off.
    assert row.sim.controller.variables.get(VariableKind.I, 51) == 0.0


def test_what_a_blank_makes_is_trimmed_close_behind_the_face(monkeypatch: MonkeyPatch) -> None:
    """Within ten turns: one to be in the part, two that are measured, and the rest to transfer them."""
    row, behind_mm = Row(lambda _: None), list[float]()
    setup = plan_cut(JOB, MACHINE, Strategy.CAM).setup
    face = setup.carriage_face - 0.5 * MACHINE.tool.wiper_land_mm * MACHINE.carriage.counts_per_mm

    def trim(*_: object) -> None:
        behind_mm.append((row.met[-1].carriage.position - face) / MACHINE.carriage.counts_per_mm)

    monkeypatch.setattr(CutProgram, "trim", trim)
    row.learn(monkeypatch)
    assert 3.0 * JOB.feed_mm_per_rev < behind_mm[0] < 10.0 * JOB.feed_mm_per_rev
    assert all(later - earlier < 0.6 for earlier, later in pairwise(behind_mm))


def test_a_reply_that_is_lost_costs_a_batch_and_no_part(monkeypatch: MonkeyPatch) -> None:
    assert Row(lost_reply).learn(monkeypatch) < 0.3


def test_a_line_of_9600_baud_is_asked_for_shorter_pieces(monkeypatch: MonkeyPatch) -> None:
    row = Row(lambda _: None)
    slow = row.tell

    def tell(part: str, step: PartStep, detail: str) -> None:
        slow(part, step, detail)
        if part == "part" and step is PartStep.CUT:
            row.sim.faults.inject("9600-baud", baud=9600.0)

    monkeypatch.setattr(row, "tell", tell)
    assert row.learn(monkeypatch) < 0.3


STRONG = """\
schema = 1
source = "a drive that pushes twice as hard as its profile says"
[tool]
thrust_factor = 2.0
coulomb_friction_n = 3.0
encoder_noise_um = 0.3
"""
"""abs(1 - T'/T) is 0.45 at 50 Hz and 1.51 at 150 Hz: what is learned of 9/rev grows by half in each pass."""


def compare_with(ront_um: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the parts without compensation and without a lobe not cut, but known."""
    part = SimpleNamespace(ront_um=ront_um)
    monkeypatch.setattr(learning._Learner, "reference", lambda _: part)
    monkeypatch.setattr(learning._Learner, "floor", lambda _: (part, None))


def test_what_grows_in_air_is_learned_no_more_and_said(tmp_path: Path, monkeypatch: MonkeyPatch) -> None:
    plant = tmp_path / "strong.toml"
    plant.write_text(STRONG, encoding="utf-8")
    row = Row(lambda _: None, sim=SimulatedLathe(MACHINE, plant_named(str(plant), MACHINE, 3)))
    monkeypatch.setattr(learning, "MOST_AIR_PASSES", 3)
    compare_with(55.0, monkeypatch)
    plan = plan_run(replace(JOB, cut_length_mm=1.0), MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
    result = learn(plan, row.shop, row.tell, 1)
    (part,) = result.parts
    (grown,) = part.grown
    assert grown.order == 9 and grown.grown_um > 1.5 * grown.best_um
    assert next(w.amplitude_um for w in part.path.command.harmonics if w.lobes == 9) == pytest.approx(
        0.0, abs=1e-9
    )
    assert 3 in part.learned and 9 not in part.learned
    assert part.roundness.amplitude_um(9) < 1.0
    (problem,) = result.warnings
    assert "9/rev is not learned: it grew from" in load("en").problem(problem)


def test_a_part_that_its_compensation_makes_worse_ends_the_row(monkeypatch: MonkeyPatch) -> None:
    """2 sin(3 d / 2) of the lobe is left with jaw 1 d degrees off: 1.22 of 55 um at 25 degrees."""
    row = Row(lambda _: None, sim=SimulatedLathe(MACHINE, replace(ideal(MACHINE), jaw_offset_deg=25.0)))
    compare_with(55.0, monkeypatch)
    with pytest.raises(ProblemError) as refused:
        row.learn(monkeypatch)
    (problem,) = refused.value.problems
    assert (problem.code, problem.key, problem.limit) == ("learned.worse", "+25 deg", "55.0 um")
    assert "find jaw 1 again" in load("en").problem(problem)
    assert row.met[-1].at_rest


def test_an_axis_that_needs_more_than_friction_takes_is_named_in_air(monkeypatch: MonkeyPatch) -> None:
    def off(*_: object, **__: object) -> tuple[Problem, ...]:
        return (Problem(code="path.beyond", key="command", value="60.0 um", limit="<= 41.8 um"),)

    monkeypatch.setattr(planning, "path_problems", off)
    plan = plan_run(replace(JOB, cut_length_mm=0.5), MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
    with pytest.raises(ProblemError) as refused:
        learn(plan, Row(lambda _: None).shop, lambda *_: None, 1)
    said = load("en").problem(refused.value.problems[0])
    assert "guides" in said and "trace" not in said
