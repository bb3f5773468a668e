"""A machine without a gauge: parts are judged by files of a gauge elsewhere, each for one part."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.session.cut.recording import part_record
from console.session.data.history import last_results
from console.session.data.kept_files import newest_files
from console.session.data.measured_part import MadeWith
from console.session.data.records import RunRecord
from console.session.data.trace_folder import export_trace, trace_folder
from console.session.learning.evaluated_part import EvaluatedPart, read_gauge_file
from console.session.learning.part_learning import accept
from console.session.learning.provenance import of_this_part, taken_before
from console.session.stages import Stage
from console.session.station.commands import Arm, ConfirmClamping, DisableDrives, EnableDrives, Start, TakeTrace
from console.session.station.state import MeasuredPart, StationState
from console.text.catalogue import load
from drivers.cutting.strategy import Strategy
from profiles.compensations.learned_compensation import LearnedCompensation
from profiles.metrology.harmonics import Harmonic
from profiles.roundness import evaluate
from profiles.store import LoadedJob, LoadedMachine, load_job, load_machine
from profiles.traces import Trace, read_trace, trace_content, write_trace
from tests.console.commands import Console, JobFile
from tests.console.floor import Floor, open_floor
from tests.console.floor import known as given
from tests.record_clock import set_dates
from tests.system.lathe_sites import compact_text
from tests.tui.records_stage import described

SEED = 11
STATED = {"state": "free", "direction": "ccw", "start_mark": "jaw 1"}


class Outside:
    """A lathe without a gauge, its job, and a gauge in another room that writes what it is told to state."""

    def __init__(self, data: Path, job: LoadedJob, machine: LoadedMachine) -> None:
        self.data, self.job, self.machine = data, job, machine
        self.floor: Floor = open_floor(data, SEED, "steady", machine)
        self.floor.set_up(job.job)
        self.floor.context.shop = None
        self.floor.context.tell(simulated=False)

    def cut(self, compensation: LearnedCompensation | None = None) -> None:
        """Clamp a blank and cut it to its end."""
        floor = self.floor
        floor.do(DisableDrives())
        floor.sim.mount(self.job.job)
        floor.do(ConfirmClamping(job=self.job.job), EnableDrives())
        armed = floor.do(
            Arm(
                job=self.job.job,
                job_sha256=self.job.sha256,
                strategy=Strategy.CAM,
                loaded=self.job,
                compensation=compensation,
            )
        )
        assert armed.armed is not None, armed.refusals
        assert floor.do(Start()).cut_done, floor.state.refusals

    def gauge(self, name: str = "part.csv", **stated: str) -> Path:
        """Measure the part elsewhere: its angles counted from jaw 1, the other way round than the spindle."""
        trace = self.floor.sim.measure()
        jaw_1_deg = self.jaw_1_deg
        angle_deg = np.mod(jaw_1_deg - trace.angle_deg, 360.0)
        order = np.argsort(angle_deg)
        path = trace_folder(self.data) / name
        write_trace(
            path,
            Trace(angle_deg=angle_deg[order], deviation_um=trace.deviation_um[order], meta=dict(stated)),
            overwrite=True,
        )
        return path

    @property
    def jaw_1_deg(self) -> float:
        jaw = given(self.floor.state.alignment.jaw)
        return jaw.angle_deg

    def take(self, path: Path, **answers: str) -> StationState:
        return self.floor.do(self.order(path, **answers))

    def order(self, path: Path, **answers: str) -> TakeTrace:
        """What Enter asks for, of the file as it is now."""
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        return TakeTrace(path=path, sha256=sha256, job=self.job.job, loaded=self.job, answers=answers)

    def taken(self, path: Path, **answers: str) -> MeasuredPart:
        state = self.take(path, **answers)
        assert state.measured is not None, state.refusals
        return state.measured

    def refused(self, path: Path, **answers: str) -> list[str]:
        state = self.take(path, **answers)
        assert state.measured is None
        return [problem.code for problem in state.refusals]

    def events(self, kind: str) -> list[dict[str, object]]:
        database = sqlite3.connect(self.data / "records.sqlite3")
        rows = database.execute("SELECT data FROM events WHERE kind = ? ORDER BY rowid", (kind,)).fetchall()
        database.close()
        return [json.loads(data) for (data,) in rows]


def evaluated(trace: Trace) -> tuple[Harmonic, ...]:
    return evaluate(trace.angle_deg, trace.deviation_um, 50.0, state="free").harmonics


@pytest.fixture
def outside(tmp_path: Path, job_file: JobFile, data_folder: Path) -> Outside:
    lathe = tmp_path / "lathe.toml"
    lathe.write_text(compact_text("pmac"), encoding="utf-8")
    job = load_job(str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1")))
    return Outside(data_folder / "trilobe", job, load_machine(str(lathe)))


@pytest.mark.long
def test_what_the_gauge_says_of_one_part_makes_the_next_rounder(outside: Outside) -> None:
    outside.cut()
    path = outside.gauge(**STATED)
    first = outside.taken(path)
    inside = outside.floor.sim.measure()  # the same part, by the gauge of the simulator
    assert first.phase_known
    assert first.jaw_1_deg == pytest.approx(outside.jaw_1_deg)
    # At spindle angles again, whatever the gauge has counted from and in which direction.
    np.testing.assert_allclose(first.trace.angle_deg, inside.angle_deg, atol=1e-9)
    # Each chucking on the gauge is off centre in another way; the lobe is the part's own.
    lobe, known = (
        next(each for each in found if each.n == 3) for found in (evaluated(first.trace), evaluated(inside))
    )
    assert lobe.amplitude_um == pytest.approx(known.amplitude_um, abs=0.2)
    assert lobe.phase_deg == pytest.approx(known.phase_deg, abs=0.5)
    learning = given(first.learning)
    assert learning.taught is not None, learning
    assert not learning.reasons
    version = accept(learning, outside.data)
    assert (version.version, version.holds_for.simulated) == (1, False)
    state = outside.floor.state
    assert not state.cut_done
    assert state.alignment.clamping is None, "the part is out of the chuck"
    assert outside.events("measured")[-1]["trace"] == "part.csv"
    assert last_results(outside.data, simulated=False)[outside.job.job.name].ront_um == first.result.ront_um

    outside.cut(version)
    second = outside.taken(outside.gauge("second.csv", **STATED))
    assert second.result.amplitude_um(3) < 0.5 * first.result.amplitude_um(3)


def test_what_the_file_does_not_state_is_asked_and_the_answer_recorded(outside: Outside) -> None:
    outside.cut()
    path = outside.gauge()
    assert outside.refused(path) == ["trace.unanswered"]
    assert outside.floor.state.cut_done, "nothing is lost"
    assert outside.refused(path, state="clamped", direction="ccw", start_mark="jaw 1") == ["trace.not_released"]
    part = outside.taken(path, **STATED)
    assert part.learning is not None and not part.learning.reasons
    assert STATED.items() <= outside.events("measured")[-1].items()


@pytest.mark.long
def test_a_file_that_changed_is_not_taken_and_one_without_a_mark_teaches_nothing(outside: Outside) -> None:
    outside.cut()
    path = outside.gauge(**STATED)
    seen = outside.order(path)
    path.write_text(path.read_text(encoding="utf-8").replace("1", "2", 1), encoding="utf-8")
    state = outside.floor.do(seen)
    assert [problem.code for problem in state.refusals] == ["trace.changed"]
    assert state.cut_done and state.measured is None
    path.unlink()
    state = outside.floor.do(seen)
    assert [problem.code for problem in state.refusals] == ["trace.unreadable"]
    assert state.stop is None and state.alarms == (), "a bad file is nothing that stops a machine"
    part = outside.taken(outside.gauge(state="free"), start_mark="unknown")
    assert not part.phase_known and part.result.ront_um > 0.0
    assert part.learning is not None and part.learning.reasons


@pytest.mark.long
def test_a_part_cut_before_the_console_was_restarted_is_judged_by_the_record(outside: Outside) -> None:
    outside.cut()
    path = outside.gauge(**STATED)
    before = outside.taken(path)
    again = open_floor(outside.data, SEED, "steady", outside.machine)
    again.context.shop = None
    again.context.tell(simulated=False)
    state = again.do(outside.order(path))
    assert state.measured is not None, state.refusals
    now, then = state.measured.learning, before.learning
    assert now is not None and then is not None and now.taught is not None and then.taught is not None
    assert now.made == then.made
    assert now.taught.step.next.path == then.taught.step.next.path
    assert now.taught.evidence == then.taught.evidence
    assert state.measured.result.ront_um == pytest.approx(before.result.ront_um)
    assert len(outside.events("measured")) == 2


@pytest.mark.long
def test_the_file_of_the_part_before_is_not_that_of_the_next(outside: Outside) -> None:
    outside.cut()
    first = outside.gauge("good.csv", **STATED)
    outside.taken(first)
    outside.floor.context.tell(measured=None)
    outside.cut()
    assert outside.refused(first) == ["trace.taken"]
    assert outside.floor.state.cut_done, "the part in the chuck is still to be measured"
    early = outside.gauge("early.csv", **STATED)
    os.utime(early, ns=(10**18,) * 2)
    part = outside.taken(early)
    assert "trace.older" in [problem.code for problem in part.result.warnings]


def test_no_part_in_the_record_is_no_part(outside: Outside) -> None:
    path = trace_folder(outside.data) / "found.csv"
    write_trace(path, Trace(angle_deg=np.arange(360.0), deviation_um=np.cos(np.arange(360.0)), meta=STATED))
    assert outside.refused(path) == ["session.nothing_cut"]
    state = outside.floor.do(replace(outside.order(path), loaded=None))
    assert [problem.code for problem in state.refusals] == ["learned.edited_part"]


@pytest.mark.parametrize(
    ("stated", "cut_on", "codes"),
    [
        *(
            ({"simulated": "yes", "lathe": "steady, seed 11"}, cut_on, codes)
            for cut_on, codes in (
                ("steady, seed 11", []),
                ("", []),
                ("steady, seed 12", ["trace.other_lathe"]),
                (None, ["trace.simulated_part"]),
            )
        ),
        ({"method": "two_point"}, None, ["trace.two_point"]),
        ({"method": "v_block"}, None, ["trace.v_block_part"]),
        ({"state": "clamped"}, None, ["trace.not_released"]),
    ],
)
def test_a_trace_of_another_lathe_or_of_no_shape_of_this_part_is_refused(
    stated: dict[str, str], cut_on: str | None, codes: list[str], tmp_path: Path, outside_job: LoadedJob
) -> None:
    path = written(tmp_path, outside_job, **{**STATED, **stated}).path
    simulated: dict[str, Any] = (
        {"simulated": True, "lathe": cut_on} if cut_on is not None else {"simulated": False}
    )
    found = read_gauge_file(path, outside_job.job, {}, **simulated)
    assert [problem.code for problem in found.problems] == codes
    assert found.ready is (not codes)


@pytest.mark.long
def test_inspect_takes_a_trace_only_of_the_simulated_lathe_that_has_cut_the_part(outside: Outside) -> None:
    shop = outside.floor.sim
    outside.floor.context.shop = shop
    outside.floor.context.tell(simulated=True)
    outside.cut()
    lathe = str(shop.which)
    own = outside.gauge(**STATED, simulated="yes", lathe=lathe)
    other = outside.gauge("other.csv", **STATED, simulated="yes", lathe="steady, seed 12")
    assert outside.refused(other) == ["trace.other_lathe"]
    assert outside.floor.state.cut_done and not outside.events("measured"), "nothing is stored, nothing is lost"
    again = open_floor(outside.data, SEED + 1, "steady", outside.machine)
    assert [problem.code for problem in again.do(outside.order(other)).refusals] == ["trace.other_lathe"]
    state = again.do(outside.order(own))
    assert state.measured is not None, "the part that was cut before the restart, whatever lathe is here now"


@pytest.fixture(scope="session")
def outside_job() -> LoadedJob:
    return load_job("lee-2001-experiment-1")


def written(folder: Path, job: LoadedJob, **stated: str) -> EvaluatedPart:
    """A made-up part with its lobe 20 deg past jaw 1, in a file that states this."""
    angle_deg = np.arange(720) / 2.0
    path = folder / "made.csv"
    deviation_um = 5.0 * np.cos(3.0 * np.radians(angle_deg - 20.0))
    write_trace(path, Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta=stated), overwrite=True)
    return read_gauge_file(path, job.job, {}, simulated=False)


@pytest.mark.parametrize("direction", ["cw", "ccw", "spindle"])
@pytest.mark.parametrize(
    "mark", [{"start_mark": "jaw 1"}, {"start_mark": "spindle index"}, {"jaw_1_deg": "-33.5"}]
)
def test_an_angle_of_the_gauge_is_an_angle_of_the_spindle(
    direction: str, mark: dict[str, str], tmp_path: Path, outside_job: LoadedJob
) -> None:
    """By hand: the crest is 20 deg of the file past angle 0, and jaw 1 where the header says."""
    job = replace(outside_job.job, lobe_phase_deg=77.0, lobe_past_jaw_deg=0.0)
    found = written(tmp_path, replace(outside_job, job=job), state="free", direction=direction, **mark)
    way = -1.0 if direction == "ccw" else 1.0
    at_zero_deg = (
        0.0 if mark.get("start_mark") == "spindle index" else 77.0 + way * float(mark.get("jaw_1_deg", 0)) * -1.0
    )
    phase_deg = (at_zero_deg + way * 20.0) % 120.0
    assert found.judged is not None
    seen = np.radians(found.turn.angle_deg)
    phase = np.angle(np.sum(found.turn.deviation_um * np.exp(-3j * seen)))
    assert (-np.degrees(phase) / 3.0 - phase_deg + 60.0) % 120.0 - 60.0 == pytest.approx(0.0, abs=1e-6)
    assert np.all(np.diff(found.turn.angle_deg) > 0.0)


def test_the_folder_offers_the_newest_file_first_and_nothing_else(tmp_path: Path) -> None:
    folder = trace_folder(tmp_path / "data")
    assert newest_files(folder) == ()
    for age, name in enumerate(("new.csv", "old.x3p", ".hidden", "older.txt")):
        file = folder / name
        file.write_text("", encoding="utf-8")
        os.utime(file, ns=(10**18 - age * 10**9,) * 2)
    (folder / "folder").mkdir()
    (folder / "nowhere").symlink_to(folder / "gone")
    os.mkfifo(folder / "pipe")
    assert [path.name for path in newest_files(folder)] == ["new.csv", "old.x3p", "older.txt"]


def test_an_exported_trace_reads_as_it_was(tmp_path: Path, outside_job: LoadedJob) -> None:
    found = written(tmp_path, outside_job, **STATED)
    first, second = (export_trace(tmp_path / "data", found.turn, job="a/b.c") for _ in range(2))
    assert first != second and first.parent == second.parent
    again = read_trace(first)
    np.testing.assert_array_equal(again.deviation_um, found.turn.deviation_um)
    assert again.meta["start_mark"] == "spindle index"


JOB = load_job("lee-2001-experiment-1").job


def gauge_file(
    folder: Path, name: str = "good.csv", lobe_um: float = 3.0, stated: dict[str, str] | None = None
) -> Path:
    angle_deg = np.arange(720) / 2.0
    deviation_um = lobe_um * np.cos(3.0 * np.radians(angle_deg - 20.0))
    path = folder / name
    meta = {"state": "free", "direction": "cw", "start_mark": "jaw 1", **(stated or {})}
    path.write_bytes(trace_content(Trace(angle_deg=angle_deg, deviation_um=deviation_um, meta=meta)))
    return path


def cut(folder: Path, compensation: int | None = None, of: EvaluatedPart | None = None) -> str:
    """Record a part that was cut, and measured by a file."""
    written = RunRecord(folder, described(JOB))
    written.add("cut", {"strategy": "cam", "stage": "full", "inverted": "model", "compensation": compensation})
    if of is not None:
        assert of.result is not None
        file = (of.path.name, of.content)
        written.add("measured", {}, part_record(JOB, of.result, of.trace, Stage.FULL, file=file))
    written.close()
    return written.run_id


def seen(path: Path) -> EvaluatedPart:
    return read_gauge_file(path, JOB, {}, simulated=False)


def test_a_file_that_was_taken_for_a_part_is_not_that_of_the_next(tmp_path: Path) -> None:
    path, data = gauge_file(tmp_path), tmp_path / "data"
    assert of_this_part(seen(path), data, None).ready, "nothing is recorded yet"
    first = cut(data, of=seen(path))
    second = cut(data, compensation=1)
    assert of_this_part(seen(path), data, first).ready, "the same part may be looked at again"
    for run_id in (second, None):
        refused = of_this_part(seen(path), data, run_id)
        assert not refused.ready
        (problem,) = refused.problems
        assert problem.code == "trace.taken"
        for language in ("en", "ko"):
            assert problem.value in load(language).problem(problem)
    copied = gauge_file(tmp_path, "copy.csv")
    assert not of_this_part(seen(copied), data, second).ready, "another name does not make another part"
    assert of_this_part(seen(gauge_file(tmp_path, "new.csv", stated={"note": "of part 2"})), data, second).ready


def test_the_part_that_has_the_file_is_named_by_the_end_of_its_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, data = gauge_file(tmp_path), tmp_path / "data"
    at = datetime(2026, 3, 2, 16, 44, 12, tzinfo=UTC)
    set_dates(monkeypatch, lambda: at.isoformat().replace("+00:00", "Z"))
    cut(data, of=seen(path))
    (problem,) = of_this_part(seen(path), data, None).problems
    assert problem.value == at.astimezone().strftime("%Y-%m-%d %H:%M:%S")


@pytest.mark.parametrize(
    ("minutes", "stated", "told"),
    [(-2, None, True), (2, None, False), (2, -3, True), (None, None, False)],
    ids=["file before", "file after", "its own date before", "just copied"],
)
def test_a_file_from_before_is_told(
    minutes: float | None, stated: float | None, told: bool, tmp_path: Path
) -> None:
    data = tmp_path / "data"
    run_id, now = cut(data), datetime.now(UTC)

    def moved(by: float) -> datetime:
        return now + timedelta(minutes=by)

    path = gauge_file(tmp_path, stated={} if stated is None else {"date": moved(stated).isoformat()})
    if minutes is not None:
        os.utime(path, (moved(minutes).timestamp(),) * 2)
    found = of_this_part(seen(path), data, run_id)
    assert found.ready, "clocks differ: it is not refused"
    assert ["trace.older"] * told == [each.code for each in found.warnings]
    if told:
        (problem,) = found.warnings
        earlier = moved(stated if stated is not None else minutes or 0.0)
        assert problem.value == earlier.astimezone().strftime("%Y-%m-%d %H:%M:%S")
        for language in ("en", "ko"):
            words = load(language).problem(problem)
            assert problem.value in words and problem.limit in words


@pytest.mark.parametrize("date", ["yesterday", "", "0001-01-01", "9999-12-31T23:59:59-12:00"])
def test_a_date_that_is_none_says_nothing(date: str, tmp_path: Path) -> None:
    data = tmp_path / "data"
    run_id = cut(data)
    found = of_this_part(seen(gauge_file(tmp_path, stated={"date": date} if date else {})), data, run_id)
    assert found.ready and all(each.code == "trace.older" for each in found.warnings)


def test_learning_takes_a_file_only_for_a_part_that_was_cut_so(tmp_path: Path) -> None:
    path, data = gauge_file(tmp_path), tmp_path / "data"
    cut(data, of=seen(path))
    cut(data, compensation=1)
    plain = MadeWith(compensation="none", strategy="cam", stage="full", inverted="model")
    assert taken_before(data, seen(path).sha256, None, plain) == ()
    (problem,) = taken_before(data, seen(path).sha256, None, replace(plain, compensation="1"))
    assert problem.code == "trace.taken"


def test_a_file_teaches_only_once(console: Console, job_file: JobFile, tmp_path: Path) -> None:
    """Nothing is measured on Inspect here: what was learned is all that is kept of the first part."""
    index = {"start_mark": "spindle index"}
    path, job = gauge_file(tmp_path, stated=index), str(job_file(cut_length_mm="0.8", feed_mm_per_rev="0.1"))
    words = ("--job", job, "--strategy", "cam", "--stage", "full", "--keep")
    first = console("learn", str(path), *words, "--compensation", "none")
    assert first.code == 0 and "version 1" in first.out
    again = console("learn", str(path), *words, "--compensation", "1")
    assert again.code == 1 and "already taught version 1" in again.err
    other = gauge_file(tmp_path, "other.csv", 1.2, index)
    taken = console("learn", str(other), *words, "--compensation", "1")
    assert taken.code == 0 and "version 2" in taken.out
