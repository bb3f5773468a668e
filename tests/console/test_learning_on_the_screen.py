"""The operator's loop of cut, measure, accept, cut again; which response is cut with; why a part fails."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.cut.simulated_parts import next_part
from console.session.data.identified_responses import asked_response, kept_responses
from console.session.data.identified_responses import store as store_response
from console.session.data.learned_store import asked_for, store
from console.session.data.measured_part import CutPart, cuts_of, parts_made
from console.session.data.run_reader import measured_parts, runs, story
from console.session.errors import SessionError
from console.session.learning.part_learning import PartLearning, accept, learning_of, revert
from console.session.stages import Stage, nominal_path
from console.session.station.commands import (
    Arm,
    ConfirmClamping,
    DisableDrives,
    Disarm,
    EnableDrives,
    Forget,
    Jog,
    Measure,
    Start,
    TakeJaw,
    TakeTouchOff,
)
from console.session.station.progress import CutStage
from console.session.station.state import ArmedCut, MeasuredPart, StationState
from drivers.cutting.strategy import Strategy
from drivers.identification.nominal import nominal_response
from drivers.identification.result import IdentifiedPoint, IdentifiedResponse, ResponseOrigin
from drivers.lathe.snapshot import AxisName
from drivers.simulator.plant.which_lathe import WhichLathe
from profiles.compensations.certificate import OrderStatus
from profiles.compensations.learned_compensation import LearnedCompensation, model_again
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import LoadedJob, LoadedMachine, load_job, load_machine
from profiles.traces import Trace, write_trace
from tests.console.commands import Console, JobFile
from tests.console.floor import Floor, open_floor
from tests.system.lathe_sites import compact_text

SEED = 11


@dataclass(kw_only=True)
class Shop:
    """A lathe that is off its profile, and a job on it, with the folder of its operator."""

    floor: Floor
    job: LoadedJob
    machine: LoadedMachine
    data: Path

    def order(self, **more: Any) -> StationState:
        """Arm the job as it is filed, with `cam`."""
        known = {"job": self.job.job, "job_sha256": self.job.sha256, "strategy": Strategy.CAM, "loaded": self.job}
        return self.floor.do(Arm(**{**known, **more}))

    def armed(self, **more: Any) -> ArmedCut:
        state = self.order(**more)
        assert state.armed is not None, state.refusals
        return state.armed

    def part(self, **more: Any) -> MeasuredPart:
        """Cut and measure a fresh blank, with what is known of jaw 1 and touch-off."""
        self.clamp()
        self.armed(**more)
        self.floor.do(Start())
        measured = self.floor.do(Measure()).measured
        assert measured is not None, self.floor.state.refusals
        return measured

    def clamp(self) -> None:
        self.floor.do(DisableDrives(), ConfirmClamping(job=self.job.job), EnableDrives())

    def refused(self, **more: Any) -> list[str]:
        state = self.order(**more)
        assert state.armed is None
        return [problem.code for problem in state.refusals]


def opened_shop(data: Path, job: LoadedJob, machine: LoadedMachine, turned_deg: float = 0.0) -> Shop:
    floor = open_floor(data, SEED, "steady", machine, turned_deg)
    floor.set_up(job.job)
    return Shop(floor=floor, job=job, machine=machine, data=data)


@pytest.fixture
def shop(tmp_path: Path, job_file: JobFile, data_folder: Path) -> Shop:
    lathe = tmp_path / "lathe.toml"
    lathe.write_text(compact_text("pmac"), encoding="utf-8")
    job = load_job(str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1")))
    return opened_shop(data_folder / "trilobe", job, load_machine(str(lathe)))


def lobe_um_pp(part: MeasuredPart) -> float:
    return 2.0 * part.result.amplitude_um(3)


def lesson(part: MeasuredPart) -> PartLearning:
    assert part.learning is not None
    return part.learning


def learned(shop: Shop) -> LearnedCompensation:
    """A first version: the model itself."""
    asked = asked_for(shop.job, shop.machine, Strategy.CAM, simulated=True)
    path = nominal_path(shop.job.job, shop.machine.machine, Strategy.CAM)
    version = model_again(asked, path, 1, "2026-01-02T08:52:00.000Z")
    store(shop.data, version)
    return version


def test_a_command_on_the_same_lathe_cuts_the_part_after_those_of_the_screens(shop: Shop) -> None:
    lathe, names = WhichLathe(plant="steady", seed=SEED), (shop.job.job.name, shop.machine.machine.name)
    assert next_part(shop.data, *names, lathe) == 1
    shop.armed()
    assert next_part(shop.data, *names, lathe) == 2
    shop.floor.do(Disarm())
    shop.armed()
    assert next_part(shop.data, *names, lathe) == 2, "the same blank, armed once more"
    shop.floor.do(Disarm())
    shop.floor.sim.mount(shop.job.job)
    shop.armed()
    assert next_part(shop.data, *names, lathe) == 3
    assert next_part(shop.data, "another", names[1], lathe) == 1
    assert next_part(shop.data, None, names[1], lathe) == 3


@pytest.mark.long
def test_what_a_part_teaches_goes_with_jaw_1(shop: Shop, console: Console, tmp_path: Path) -> None:
    first = shop.part()
    # The table takes the carriage back to where it began; what was cut is cut.
    ended = shop.floor.state.cut
    assert ended is not None and (ended.turn, ended.z_mm) == (ended.turns, ended.length_mm)
    one = accept(lesson(first), shop.data)
    with pytest.raises(SessionError, match=r"learned\.accepted"):
        accept(lesson(first), shop.data)

    # The chuck comes to stand 25 deg further on: what was learned goes with it, and so does what is learned next.
    turned = opened_shop(shop.data, shop.job, shop.machine, turned_deg=25.0)
    second = turned.part(compensation=one)
    assert (second.jaw_1_deg - first.jaw_1_deg) % 360.0 == pytest.approx(25.0, abs=0.5)
    assert lobe_um_pp(second) < 3.5 < 7.0 < lobe_um_pp(first)
    two = accept(lesson(second), shop.data)
    assert (two.version, two.parent, two.gain < 0.7) == (2, 1, True)
    assert two.path.target.phase_deg == pytest.approx(one.path.target.phase_deg, abs=1.0)

    # The commands learn the same of it, by what the record says of a cut on the screen.
    trace = tmp_path / "second.csv"
    write_trace(trace, second.trace)
    of_job = ("--job", str(shop.job.path), "--machine", str(shop.machine.path))
    said = console("learn", str(trace), *of_job, "--json").json
    made = {"compensation": "1", "strategy": "cam", "stage": "full", "inverted": "model"}
    assert said["cut_with"] == {**made, "cut_jaw_1_deg": str(second.jaw_1_deg)}
    assert said["next"]["path"]["wanted"]["crest_deg"] == pytest.approx(two.path.target.phase_deg, abs=1e-3)

    # Back, step by step, as the commands go: to the first version, then to the model.
    three = revert(two, shop.job, shop.machine, shop.data, simulated=True)
    four = revert(three, shop.job, shop.machine, shop.data, simulated=True)
    with pytest.raises(SessionError, match=r"learned\.no_before"):
        revert(four, shop.job, shop.machine, shop.data, simulated=True)
    turned.clamp()
    by_model, by_one = (turned.armed(compensation=each).plan.text for each in (None, one))
    assert [turned.armed(compensation=each).plan.text for each in (four, three)] == [by_model, by_one]
    assert by_model != by_one
    known = console("learn", *of_job, "--list", "--sim", "--json").json["versions"]
    steps = [(each["version"], each["parent"], each["reverts"]) for each in known]
    assert steps == [(1, 0, None), (2, 1, None), (3, 0, 1), (4, 0, 0)]
    assert all(each["holds"] for each in known)


@pytest.mark.long
def test_a_part_with_jaw_1_elsewhere_is_not_offered(shop: Shop, console: Console, tmp_path: Path) -> None:
    """25 degrees of spindle are 75 of a lobe of three: 55 um become 61."""
    for order in (Forget(), Forget(), Jog(axis=AxisName.SPINDLE, distance=25.0), TakeJaw()):
        shop.floor.do(order)
    shop.floor.do(TakeTouchOff(radius_mm=shop.job.job.radius_mm))
    part = shop.part()
    assert lobe_um_pp(part) > shop.job.job.lobe_error_um_pp
    (problem,) = lesson(part).reasons
    assert problem.code == "learned.worse"
    step = part.learning.taught.step if part.learning and part.learning.taught else None
    assert step is not None and step.learned == ()
    assert {each.standing for each in step.certificate if (each.order, each.axial) == (3, 0)} == {
        OrderStatus.REFUSED
    }
    with pytest.raises(SessionError, match=r"learned\.worse"):
        accept(lesson(part), shop.data)
    trace = tmp_path / "aside.csv"
    write_trace(trace, part.trace)
    of_job = ("--job", str(shop.job.path), "--machine", str(shop.machine.path))
    said = console("learn", str(trace), *of_job, "--keep")
    assert said.code == 1 and "find jaw 1 again" in said.err
    assert console("learn", *of_job, "--list", "--sim", "--json").json["versions"] == []


def test_arming_judges_what_was_learned_once_more(shop: Shop) -> None:
    one = learned(shop)
    assert shop.armed(compensation=one).made.compensation == "1"
    shop.floor.do(Disarm())
    assert shop.refused(compensation=one, strategy=Strategy.TIMEBASE) == ["learned.strategy"]
    assert shop.refused(compensation=one, loaded=None) == ["learned.edited"]
    slower = replace(shop.job.job, depth_of_cut_mm=0.09)
    assert shop.refused(compensation=one, job=slower) == ["learned.edited"]
    finer = replace(shop.job.job, feed_mm_per_rev=0.04)
    changed = replace(shop.job, sha256="f" * 64, job=finer)
    assert shop.refused(compensation=one, job=finer, loaded=changed) == ["learned.settings_changed"]
    real = replace(one, holds_for=replace(one.holds_for, simulated=False))
    assert "learned.elsewhere" in shop.refused(compensation=real)
    other = replace(one, holds_for=replace(one.holds_for, lathe="steady, seed 12"))
    assert "learned.other_lathe" in shop.refused(compensation=other)
    assert shop.refused(stage=Stage.PARTIAL, strategy=Strategy.PAPER) == ["stage.strategy"]
    beyond = replace(one.path.target, amplitude_um=80.0)
    (file,) = shop.data.glob("learned/**/version-*.json")
    file.unlink()
    assert shop.refused(compensation=one) == ["learned.file_changed"]
    far = replace(one, path=replace(one.path, target=beyond))
    store(shop.data, far)
    assert shop.refused(compensation=one) == ["learned.file_changed"]
    assert "path.beyond" in shop.refused(compensation=far)
    file.write_text("{", encoding="utf-8")
    assert shop.refused(compensation=one) == ["learned.file"]
    assert shop.floor.state.stop is None


@pytest.mark.long
def test_a_cut_in_air_leaves_the_blank_as_it_was(shop: Shop) -> None:
    whole, half = (shop.armed(stage=stage).plan for stage in (Stage.FULL, Stage.PARTIAL))
    assert half.target.amplitude_um == pytest.approx(0.5 * whole.target.amplitude_um)
    air = shop.armed(stage=Stage.AIR).plan
    # 1 mm and the depth of cut.
    out_mm = (whole.setup.surface - air.setup.surface) / shop.machine.machine.tool.counts_per_mm
    assert out_mm == pytest.approx(1.1, abs=1e-9)
    state = shop.floor.do(Start())
    assert state.cut is not None and (state.cut.stage, state.cut.in_air) == (CutStage.DONE, True)
    assert (state.cut_done, state.marks_mm, state.stop) == (False, (), None)
    shop.floor.do(Measure())
    assert [problem.code for problem in shop.floor.state.refusals] == ["session.nothing_cut"]
    asked = asked_for(shop.job, shop.machine, Strategy.CAM, simulated=True)
    assert parts_made(cuts_of(shop.data, asked)) == []
    assert shop.armed(stage=Stage.PARTIAL).made.stage == "partial"


@pytest.mark.parametrize(
    ("change", "code"),
    [({"loaded": None}, "learned.edited_part"), ({"strategy": Strategy.NONE}, "learned.not_followed")],
)
def test_a_part_that_teaches_nothing_says_why(shop: Shop, change: dict[str, Any], code: str) -> None:
    angle_deg = np.arange(360.0)
    trace = Trace(angle_deg=angle_deg, deviation_um=np.cos(np.radians(3.0 * angle_deg)), meta={"simulated": "yes"})
    armed = shop.armed(**change)
    found = learning_of(armed.loaded, armed.job.name, CutPart(made=armed.made), trace, shop.machine, shop.data)
    assert found.taught is None and [problem.code for problem in found.problems] == [code]
    with pytest.raises(SessionError, match=code.replace(".", r"\.")):
        accept(found, shop.data)


EXPERIMENT = "lee-2001-experiment-1"
MACHINE = load_machine("lee-2001-lathe").machine
NEW = "2026-01-03T09:30:00.000Z"


def of_model(
    machine: MachineProfile, path: Strategy, date: str, factor: float = 1.0, **of: Any
) -> IdentifiedResponse:
    """The response of the model, or a fraction of it, as if it had been identified."""
    variables, motor = machine.controller.variables, machine.tool.motor
    gains = {name: variables[name] for number in range(30, 36) if (name := f"I{motor}{number}") in variables}
    kind = "TURBO PMAC2" if machine.controller.family == "turbo" else "PMAC1, X1"
    told = {"machine": machine.name, "simulated": True, "version": "1.17", "kind": kind, "gains": gains}
    points = []
    for hz in (10.0, 30.0, 50.0, 80.0):
        found = factor * nominal_response(path, machine, hz)
        points.append(
            IdentifiedPoint(
                frequency_hz=hz,
                gain=abs(found),
                phase_deg=math.degrees(cmath.phase(found)),
                gain_ci=0.002,
                phase_ci_deg=0.1,
                coherence=0.999,
                amplitude_um=30.0,
            )
        )
    period_ms = machine.controller.servo_period_ms
    return IdentifiedResponse(
        origin=ResponseOrigin(**{**told, "servo_period_ms": period_ms, **of}),
        path=path,
        how="measured",
        delay_cycles=0,
        date=date,
        points=tuple(points),
    )


def test_newest_a_name_and_a_file_are_the_same_response(tmp_path: Path) -> None:
    store_response(tmp_path, of_model(MACHINE, Strategy.PVT, "2026-01-01T00:00:00.000Z"))
    file = store_response(tmp_path, of_model(MACHINE, Strategy.PVT, NEW, 0.9))
    found = [asked_response(tmp_path, asked, MACHINE, Strategy.PVT) for asked in ("newest", file.name, str(file))]
    assert [each.identified for each in found] == [found[0].identified] * 3
    assert found[0].name == file.name and found[0].identified.date == NEW
    with pytest.raises(SessionError, match="is kept for strategy"):
        kept_responses(tmp_path, MACHINE, Strategy.CAM)
    outside = file.parent.parent / file.name
    file.rename(outside)
    with pytest.raises(ProfileError) as refused:
        asked_response(tmp_path, f"../{file.name}", MACHINE, Strategy.PVT)
    assert refused.value.problems[0].code == "file.unreadable"


def test_a_file_that_cannot_be_read_leaves_the_others(tmp_path: Path) -> None:
    good = store_response(tmp_path, of_model(MACHINE, Strategy.PVT, NEW))
    (good.parent / "pvt-99990101T000000000Z.json").write_text("{", encoding="ascii")
    assert [each.file for each in kept_responses(tmp_path, MACHINE, Strategy.PVT)] == [good]


def test_the_command_refuses_the_newest_of_a_strategy_that_has_none(console: Console, data_folder: Path) -> None:
    data = data_folder / "trilobe"
    store_response(data, of_model(MACHINE, Strategy.PVT, NEW))
    refused = console("preview", EXPERIMENT, "--strategy", "cam", "--identified", "newest")
    assert refused.code == 1 and "console identify" in refused.err


@pytest.mark.long
def test_the_cut_inverts_the_chosen_response_and_its_record_says_so(shop: Shop) -> None:
    """A response of 0.8 of the model commands another path, and the part teaches by that path."""
    machine = shop.machine.machine
    file = store_response(shop.data, of_model(machine, Strategy.CAM, NEW, 0.8))
    (kept,) = kept_responses(shop.data, machine, Strategy.CAM, simulated=True)
    assert shop.refused(inverts=kept, strategy=Strategy.PVT) == ["response.of_another"]
    by_model = shop.armed()
    armed = shop.armed(inverts=kept)
    assert armed.made.inverted == file.name and by_model.made.inverted == "model"
    assert armed.plan.text != by_model.plan.text
    content = file.read_text("utf-8")
    file.write_text(content.replace("0.999", "0.998"), encoding="utf-8")
    assert shop.refused(inverts=kept) == ["response.file_changed"]
    file.unlink()
    assert shop.refused(inverts=kept) == ["file.unreadable"]
    file.write_text(content, encoding="utf-8")

    part = shop.part(inverts=kept)
    assert part.learning is not None and part.learning.problems == (), "what it was cut with is found by its name"
    assert part.learning.made.inverted == file.name
    (row, *_) = runs(shop.data)
    assert story(shop.data, row.run_id).setup["inverted"] == file.name
    (point,) = measured_parts(shop.data, shop.job.job.name, machine.name, True)
    assert (row.inverted, point.inverted, row.compensation) == (file.name, file.name, "none")
    assert lobe_um_pp(part) > 0.0
