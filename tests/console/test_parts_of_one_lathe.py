"""Single commands on the simulated lathe are parts in a row, and what they teach holds for that lathe alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from console.cli.commands import build
from console.cli.machine.run_request import plan_request
from console.session.cut.compensated_cut import chosen_problems, using, with_accepted
from console.session.cut.simulated_parts import next_part
from console.session.data.learned_store import asked_for, find_newest_version, store
from console.session.data.run_reader import story
from console.session.errors import SessionError
from console.session.stages import nominal_path
from console.session.station.commands import Arm, Disarm
from console.session.station.machine_connection import reach
from console.session.work import open_work
from console.text.catalogue import load
from drivers.cutting.strategy import Strategy
from drivers.link.address import SimulatedAddress
from drivers.link.tracing import Tracing
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.compensations.learned_compensation import MODEL, model_again
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.console.floor import floor_at, known
from tests.system.lathe_sites import compact_text

SIX = ("--sim", "--plant", "realistic", "--seed", "6")


@pytest.fixture
def ring(job_file: JobFile) -> str:
    """Experiment 1 over a few turns."""
    return str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1"))


@pytest.fixture
def machine(tmp_path: Path) -> str:
    """A lathe with short ways, so that most of the time is the cut."""
    path = tmp_path / "lathe.toml"
    path.write_text(compact_text("pmac"), encoding="utf-8")
    return str(path)


@pytest.fixture
def cut(console: Console, ring: str, machine: str) -> Callable[..., tuple[int, float]]:
    """Cut a part without compensation; return its number and its roundness."""

    def one(*words: str) -> tuple[int, float]:
        found = console("run", ring, "--machine", machine, *SIX, "--strategy", "none", "--json", *words).json
        assert (found["lathe"]["plant"], found["lathe"]["seed"], found["lathe"]["parts"]) == ("realistic", 6, 1)
        return found["lathe"]["part"], found["before"]["RONt_um"]

    return one


@pytest.mark.long
def test_the_first_can_be_had_again_and_what_was_refused_has_taken_none(
    console: Console,
    ring: str,
    job_file: JobFile,
    machine: str,
    tmp_path: Path,
    data_folder: Path,
    cut: Callable[..., tuple[int, float]],
) -> None:
    job_file(cut_length_mm="0.3", feed_mm_per_rev="0.1")
    assert console("run", ring, "--machine", machine, *SIX).code == 1, "too short: no blank was clamped for it"
    job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1")
    one, first_um = cut()
    assert one == 1
    assert cut("--lathe-part", "1") == (1, first_um)
    assert cut("--data", str(tmp_path / "fresh")) == (1, first_um), "of another data folder: its own history"
    data, there = data_folder / "trilobe", SimulatedAddress(plant="realistic", seed=6, goes_on=True)
    for address, parts in ((there, 1), (replace(there, goes_on=False), 0), (replace(there, seed=7), 0)):
        reached = reach(load_machine(machine), address, data, Tracing(None, ""))
        try:
            assert reached.shop is not None and (reached.shop.parts, reached.shop.which.plant) == (
                parts,
                "realistic",
            )
        finally:
            reached.close()
    said = console("run", ring, "--machine", machine, *SIX, "--strategy", "none")
    assert "realistic, seed 6: part 2 of this job" in said.out and "--lathe-part 1" in said.out


def test_each_command_cuts_the_next_part_of_a_lathe_that_can_be_had_again(
    console: Console, ring: str, machine: str, cut: Callable[..., tuple[int, float]]
) -> None:
    """Lathes whose parts are alike are not counted."""
    (one, first_um), (two, second_um) = cut(), cut()
    assert (one, two) == (1, 2) and first_um != second_um
    for words in (("--sim", "--lathe-part", "2"), ("--lathe-part", "2"), (*SIX, "--lathe-part", "0")):
        said = console("run", ring, *words)
        assert said.code == 2 and "internal" not in said.err and "--lathe-part" in said.err
    found = console("run", ring, "--machine", machine, "--sim", "--strategy", "none", "--json").json
    assert "lathe" not in found


@pytest.mark.parametrize(
    ("text", "words", "counted"),
    [
        ("[chuck]\nlobe_factor = 1.2\n", (), False),
        ("[chuck]\nlobe_factor = 1.2\n", ("--clamping-sd", "5"), True),
        ("[blank]\nrun_out_um = 20.0\n", (), True),
        ("like = 'steady'\n", (), True),
    ],
)
def test_commands_and_screens_count_the_parts_of_the_same_lathes(
    ring: str, machine: str, tmp_path: Path, data_folder: Path, text: str, words: tuple[str, ...], counted: bool
) -> None:
    plant = tmp_path / "mine, seed 3.toml"
    plant.write_text(text, encoding="utf-8")
    loaded, data = load_machine(machine), data_folder / "trilobe"
    options = [
        "run",
        ring,
        "--machine",
        machine,
        "--sim",
        "--plant",
        str(plant),
        "--seed",
        "6",
        "--data",
        str(data),
        *words,
    ]
    command = plan_request(build(load("en")).parse_args(options)).lathe_parts
    sd_percent = 5.0 if words else None
    true = plant_named(str(plant), loaded.machine, 6, sd_percent, mounted_by_hand=True)
    floor = floor_at(SimulatedLathe(loaded.machine, true), data, loaded)
    assert floor.station.connect()
    job = load_job(ring)
    floor.set_up(job.job)
    floor.do(Arm(job=job.job, job_sha256=job.sha256, loaded=job, strategy=Strategy.NONE))
    assert floor.context.record is not None
    setup = story(data, floor.context.record.run_id).setup
    floor.do(Disarm())
    recorded = dict(setup["lathe"])
    assert recorded.pop("which") == str(true.lathe), "as the traces of its parts name it"
    assert (command is not None, bool(recorded)) == (counted, counted)
    if command is not None:
        assert command.part == 1 and recorded == command.fields()
        assert next_part(data, job.job.name, loaded.machine.name, command.lathe) == 2


def square_trace(folder: Path, lathe: str, strategy: str = "cam") -> Path:
    """Write a trace of a part of a simulated lathe; one that does not say of which, of none ("")."""
    rows = [f"{a},{3.0 if a % 120 < 60 else -3.0}" for a in range(360)]
    head = ("state: free", "simulated: yes", "direction: spindle", "start_mark: spindle index")
    cut = ("compensation: none", f"strategy: {strategy}", "stage: full", *([f"lathe: {lathe}"] if lathe else []))
    path = folder / "square.csv"
    path.write_text("\n".join([*(f"# {line}" for line in (*head, *cut)), "angle_deg,deviation_um", *rows]))
    return path


def test_a_part_of_another_simulated_lathe_teaches_nothing_where_it_was_not_cut(
    console: Console, ring: str, machine: str, tmp_path: Path, data_folder: Path
) -> None:
    where = ("--machine", machine)
    assert console("run", ring, *where, *SIX, "--strategy", "pvt").code == 4, "five turns: not proven"
    words = ("learn", str(square_trace(tmp_path, "realistic, seed 9", "pvt")), "--job", ring, *where, "--keep")
    for language, data in (("en", "--data FOLDER"), ("ko", "데이터 폴더")):
        said = console(*words, "--lang", language)
        assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
        assert all(word in said.err for word in ("realistic, seed 6", "realistic, seed 9", data))
    assert not (data_folder / "trilobe" / "learned").exists()
    for lathe in ("", "realistic, seed 6"):
        square_trace(tmp_path, lathe, "pvt")
        assert console(*words[:-1]).code == 0, "of the lathe whose part is recorded, or of one that is not known"
    square_trace(tmp_path, "realistic, seed 9", "pvt")
    assert console(*words, "--data", str(tmp_path / "fresh")).code == 0, "where no part of the job is recorded"


@pytest.fixture
def learned(console: Console, ring: str, machine: str, tmp_path: Path) -> str:
    """A version that was learned from a part of the realistic lathe with seed 6."""
    path = square_trace(tmp_path, "realistic, seed 6")
    said = console("learn", str(path), "--job", ring, "--machine", machine, "--keep")
    assert said.code == 0 and "--plant realistic --seed 6" in said.out
    return str(path)


@pytest.mark.parametrize(
    ("language", "other"), [("en", "was learned on another simulated lathe"), ("ko", "다른 시뮬레이션 선반")]
)
def test_what_another_lathe_has_taught_is_refused_with_both_named(
    console: Console, ring: str, machine: str, learned: str, language: str, other: str
) -> None:
    words = ["run", ring, "--machine", machine, "--strategy", "cam", "--compensation", "newest"]
    said = console(*words, "--sim", "--plant", "realistic", "--seed", "9", "--lang", language)
    assert (said.code, said.out) == (1, "") and other in said.err
    assert "realistic, seed 6" in said.err and "realistic, seed 9" in said.err and "--seed" in said.err
    there = plan_request(build(load("en")).parse_args([*words, *SIX]))
    assert there.plan.compensation == 1


def test_a_simulated_lathe_behind_a_link_is_another_one_too(ring: str, machine: str, learned: str) -> None:
    words = ["run", ring, "--machine", machine, "--strategy", "cam", "--link", "sim:", "--compensation"]
    with pytest.raises(SessionError) as refused:
        plan_request(build(load("en")).parse_args([*words, "newest"]))
    (problem,) = refused.value.problems
    assert (problem.code, problem.limit) == ("learned.other_lathe", "realistic, seed 6")
    for language in ("en", "ko"):
        said = load(language).problem(problem)
        assert all(word in said for word in ("--sim --plant", "--seed", "--compensation none"))
    request = plan_request(build(load("en")).parse_args([*words, "none"]))
    assert isinstance(request.address, SimulatedAddress) and request.address.seed is not None


def test_a_version_that_names_no_lathe_is_told_behind_a_link_too(
    ring: str, machine: str, data_folder: Path
) -> None:
    job, loaded = load_job(ring), load_machine(machine)
    path = nominal_path(job.job, loaded.machine, Strategy.CAM)
    asked = asked_for(job, loaded, Strategy.CAM, simulated=True)
    version = model_again(asked, path, 1, "2026-01-02T08:52:00.000Z")
    data = data_folder / "trilobe"
    store(data, replace(version, reverts=None, parent=MODEL))
    words = [
        "run",
        ring,
        "--machine",
        machine,
        "--strategy",
        "cam",
        "--compensation",
        "newest",
        "--data",
        str(data),
    ]
    request = plan_request(build(load("en")).parse_args([*words, "--link", "sim:"]))
    told = [each.code for each in request.warnings if each.code.startswith("learned.")]
    assert told == ["learned.lathe_unknown"]


def test_a_screen_on_another_lathe_sets_it_aside_and_does_not_arm_with_it(
    console: Console, ring: str, machine: str, learned: str, data_folder: Path
) -> None:
    data = data_folder / "trilobe"
    work = open_work(load_job(ring), load_machine(machine))
    there = with_accepted(work, data, simulated=True, lathe="realistic, seed 6")
    assert there.compensation is not None and not there.set_aside
    here = with_accepted(work, data, simulated=True, lathe="realistic, seed 9")
    assert here.compensation is None
    assert [(each.code, each.limit, each.value) for each in here.set_aside] == [
        ("learned.other_lathe", "realistic, seed 6", "realistic, seed 9")
    ]
    newest = known(find_newest_version(work.loaded, work.machine, data, simulated=True))
    problems = chosen_problems(using(work, newest), simulated=True, lathe="realistic, seed 9")
    assert [each.code for each in problems] == ["learned.other_lathe"]
