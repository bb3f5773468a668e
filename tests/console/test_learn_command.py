"""`console learn` and the stages of `console run`: a first part step by step, and what it teaches the next."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from console.cli.commands import build
from console.cli.machine.run_cut import learn_hint, tell_cut_with
from console.cli.machine.run_request import plan_request
from console.session.data.learned_store import asked_for, store
from console.session.data.measured_part import MadeWith, made_with
from console.session.errors import SessionError
from console.session.stages import nominal_path
from console.text.catalogue import load
from drivers.cutting.strategy import Strategy
from profiles.compensations.learned_compensation import model_again
from profiles.store import load_job, load_machine
from tests.console.commands import Console, JobFile
from tests.signed_profile import signed_copy
from tests.system.lathe_sites import compact_text

SOFT = ("--plant", "steady", "--seed", "11")
PLAIN = ("--sim", "--json")


@pytest.fixture
def ring(job_file: JobFile) -> str:
    """Experiment 1 over a few turns."""
    return str(job_file(cut_length_mm="0.8", feed_mm_per_rev="0.1"))


@pytest.fixture
def lathe(tmp_path: Path) -> tuple[str, str]:
    """A lathe with short ways, so that most of the time is the cut."""
    path = tmp_path / "lathe.toml"
    path.write_text(compact_text("pmac"), encoding="utf-8")
    return ("--machine", str(path))


def lobe_um_pp(part: dict[str, Any]) -> float:
    return 2.0 * next(float(h["amplitude_um"]) for h in part["harmonics"] if h["n"] == 3)


@pytest.mark.long
def test_a_first_part_step_by_step(console: Console, ring: str, lathe: tuple[str, str], tmp_path: Path) -> None:
    air = console("run", ring, *lathe, *PLAIN, "--stage", "air").json
    assert (air["stage"], air["compensation"], air["expected"]) == ("air", None, None)
    assert (air["before"], air["after"], air["within_tolerance"], air["collisions"]) == (None, None, None, [])
    assert air["tool_error_um"] < 2.0 and air["telemetry_samples"] > 10
    trace = str(tmp_path / "half.csv")
    half = console("run", ring, *lathe, *PLAIN, "--stage", "partial", "--part", trace).json
    assert half["expected"] == {"right_um_pp": 27.5, "wrong_um_pp": 82.5}
    assert half["after"]["RONt_um"] == pytest.approx(27.5, abs=0.5)
    assert half["within_tolerance"] is None
    # As it was to be: there is nothing to learn from it but that, and nothing is kept.
    said = console("learn", trace, "--job", ring, *lathe, "--json").json
    made = {"compensation": "none", "strategy": "pvt", "stage": "partial", "inverted": "model"}
    assert said["cut_with"] == {**made, "cut_jaw_1_deg": "file"}
    assert said["contraction"]["verdict"] == "converges"
    assert said["contraction"]["arrives_share"] == pytest.approx(1.0, abs=0.02)
    assert said["contraction"]["arrives_late_deg"] == pytest.approx(0.0, abs=0.3)
    assert (said["expected"]["RONt_um"] < 0.5, said["kept"]) == (True, None)


def test_the_second_part_is_rounder_and_one_can_go_back(
    console: Console, ring: str, lathe: tuple[str, str], tmp_path: Path, data_folder: Path
) -> None:
    words, of_job = ("run", ring, *lathe, *PLAIN, *SOFT, "--strategy", "cam"), ("--job", ring, *lathe)
    first, second = str(tmp_path / "1.csv"), str(tmp_path / "2.csv")
    before_um = console(*words, "--part", first).json["after"]["RONt_um"]
    lesson = console("learn", first, *of_job, "--keep", "--json").json
    assert (lesson["next"]["version"], lesson["next"]["gain"] > 0.9) == (1, True)
    assert {3, 9} <= set(lesson["learned_waves"]) <= {3, 6, 9}
    # One part shows an oval: whether the next blank has the same, only that can show.
    stands = {(each["order"], each["axial"]): each["standing"] for each in lesson["certificate"]}
    assert (stands[3, 0], stands[2, 0] in ("one_part", "noise")) == ("learned", True)
    assert (stands[3, 1], stands[3, 2]) == ("unseen", "unseen"), "of one section"
    within_um = next(each["known_within_um"] for each in lesson["certificate"] if each["axial"] == 1)
    assert within_um == pytest.approx(0.15, abs=0.1), "half a mm of cut, between straight jaws and even pressure"
    assert all(each["bound"] < 1.0 for each in lesson["certificate"] if each["standing"] == "learned")
    made = console(*words, "--compensation", "newest", "--part", second).json
    assert (made["compensation"], made["stage"]) == (1, "full")
    assert made["after"]["RONt_um"] < 0.5 * before_um < 8.0 < before_um
    lesson = console("learn", second, *of_job, "--keep", "--json").json
    assert (lesson["next"]["version"], lesson["next"]["parent"]) == (2, 1)
    assert lesson["next"]["gain"] < 0.7, "two clampings are known now"
    assert lesson["contraction"]["verdict"] != "diverges"
    # The first part again, said to be one of version 1: its trace knows better.
    said = console("learn", first, *of_job, "--compensation", "1", "--keep")
    assert said.code == 1 and "compensation 1" in said.err and "none" in said.err
    assert console("learn", *of_job, "--revert", "1", "--sim", "--keep").code == 0
    known = console("learn", *of_job, "--list", "--sim", "--json").json["versions"]
    assert [(v["version"], v["parent"], v["reverts"], v["holds"]) for v in known] == [
        (1, 0, None, True),
        (2, 1, None, True),
        (3, 0, 1, True),
    ]
    assert known[2]["path"] == known[0]["path"]
    assert "repeats 1" in console("learn", *of_job, "--list", "--sim").out
    files = sorted((data_folder / "trilobe" / "learned" / "simulated").rglob("*.json"))
    assert [json.loads(file.read_text())["version"] for file in files] == [1, 2, 3]


@pytest.fixture
def learned(console: Console, ring: str, tmp_path: Path) -> str:
    """A trace with which a first version was kept: it says itself what it was cut with."""
    rows = [f"{a},{3.0 if a % 120 < 60 else -3.0}" for a in range(360)]
    head = ("state: free", "simulated: yes", "direction: spindle", "start_mark: spindle index")
    cut = ("compensation: none", "strategy: cam", "stage: full")
    path = tmp_path / "square.csv"
    path.write_text("\n".join([*(f"# {line}" for line in (*head, *cut)), "angle_deg,deviation_um", *rows]))
    said = console("learn", str(path), "--job", ring, "--keep")
    assert said.code == 0 and "stored as version 1" in said.out
    return str(path)


def test_a_run_without_what_was_learned_says_so(console: Console, ring: str, learned: str) -> None:
    def unused(*words: str) -> list[tuple[str, str, str]]:
        options = build(load("en")).parse_args(["run", ring, "--sim", *words])
        found = [(problem.code, problem.key, problem.value) for problem in plan_request(options).warnings]
        return [each for each in found if each[0].startswith("learned.")]

    assert unused("--strategy", "cam") == unused("--strategy", "pvt") == [("learned.not_used", "1", "cam")]
    newest = unused("--strategy", "cam", "--compensation", "newest")
    assert newest == [("learned.lathe_unknown", "1", "ideal")], "its trace does not say on which lathe it was cut"
    assert unused("--strategy", "cam", "--learn", "2") == unused("--strategy", "none") == []
    assert console("learn", "--job", ring, "--revert", "0", "--sim", "--keep").code == 0
    assert unused("--strategy", "cam") == []


def test_what_was_changed_since_it_was_learned_is_named(console: Console, ring: str, learned: str) -> None:
    def holds() -> tuple[bool, str]:
        (version,) = console("learn", "--job", ring, "--list", "--sim", "--json").json["versions"]
        return version["holds"], console("learn", "--job", ring, "--list", "--sim").out

    file, text = Path(ring), Path(ring).read_text()
    file.write_text(f"{text}\n# another remark\n")
    assert holds()[0], "no path depends on it"
    file.write_text(text.replace("feed_mm_per_rev = 0.1", "feed_mm_per_rev = 0.09"))
    assert holds() == (False, holds()[1]) and "feed_mm_per_rev 0.1 → 0.09" in holds()[1]
    said = console("run", ring, *PLAIN, "--strategy", "cam", "--compensation", "newest")
    assert said.code == 1 and "feed_mm_per_rev 0.1 → 0.09" in said.err
    # Without it the cut is made, and it is told, and not dropped without a word.
    air = console("run", ring, *PLAIN, "--strategy", "cam", "--stage", "air")
    assert air.code == 0 and any("feed_mm_per_rev 0.1 → 0.09" in each for each in air.json["warnings"])


def test_what_is_not_meant_for_this_cut_is_refused_before_it(console: Console, ring: str, learned: str) -> None:
    for words, told in (
        ("--strategy pvt --compensation newest", ("--strategy cam",)),
        ("--strategy cam --compensation 7", ("no version 7", "1 … 1")),
        ("--stage partial --strategy paper", ("paper", "pvt | cam | timebase")),
        ("--strategy cam --stage air --part x.csv", ("--part x.csv",)),
        ("--strategy cam --learn 2 --compensation 1", ("--learn", "--compensation")),
    ):
        said = console("run", ring, "--sim", *words.split())
        assert (said.code, said.out) == (1, "")
        assert all(word in said.err for word in told)


def test_a_part_of_which_too_little_is_known_teaches_nothing(console: Console, ring: str, learned: str) -> None:
    path = Path(learned)
    sound = path.read_text()
    for before, after, told in (
        ("# start_mark: spindle index", "# start_mark: unknown", "the phase of the trace is unknown"),
        ("# stage: full", "", "--stage"),
        ("# strategy: cam", "# strategy: none", "console calibrate lobe"),
        ("# compensation: none", "# compensation: 4", "no version 4"),
    ):
        path.write_text(sound.replace(before, after))
        said = console("learn", learned, "--job", ring, "--keep")
        assert said.code == 1 and told in said.err
    assert len(console("learn", "--job", ring, "--list", "--sim", "--json").json["versions"]) == 1


@pytest.mark.parametrize(
    ("language", "named", "missing"),
    [("en", "next part", "# start_mark: unknown"), ("ko", "다음 공작물", "")],
)
def test_a_part_without_a_place_on_the_spindle_promises_nothing_even_without_keep(
    console: Console, ring: str, learned: str, language: str, named: str, missing: str
) -> None:
    path = Path(learned)
    placed = console("learn", learned, "--job", ring, "--lang", language)
    assert placed.code == 0 and named in placed.out
    path.write_text(path.read_text().replace("# start_mark: spindle index", missing))
    said = console("learn", learned, "--job", ring, "--lang", language)
    assert said.code == 1 and named not in said.out and "RONt" in said.out
    assert "# start_mark: spindle index | jaw 1" in said.err and "# direction" not in said.err
    found = console("learn", learned, "--job", ring, "--json")
    assert found.code == 1 and (found.json["next"], found.json["expected"]) == (None, None)
    assert found.json["learned_waves"] == [] and found.json["diagnosis"] is None
    assert found.json["measured"]["lobe_um_pp"] == pytest.approx(4.0 / math.pi * 6.0, abs=0.1)


def test_the_last_part_is_meant_unless_somebody_says_another() -> None:
    model = MadeWith(compensation="none", strategy="cam", stage="full", inverted="model")
    half, second = replace(model, stage="partial"), replace(model, compensation="2")
    assert made_with({}, {}, [second, half, model]) == second
    assert made_with({"compensation": "none"}, {}, [second, half, model]) == half
    assert made_with({}, {"compensation": "none", "stage": "full"}, [second, half, model]) == model
    unknown: list[tuple[dict[str, str], list[MadeWith | None]]] = [
        ({}, [None, second]),
        ({}, []),
        ({"compensation": "3"}, [second]),
    ]
    for said, made in unknown:
        with pytest.raises(SessionError, match=r"learned\.cut_unknown"):
            made_with(said, {}, made)
    with pytest.raises(SessionError, match=r"learned\.other_version"):
        made_with({"compensation": "3", "strategy": "cam", "stage": "full"}, {}, [second])
    # Of a part from the screen somebody has to say all of it, and is believed.
    told = {"compensation": "none", "strategy": "cam", "stage": "full"}
    assert made_with(told, {}, [None, second]) == model


def test_the_last_line_says_how_to_learn(ring: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, machine = load("en"), str(signed_copy("lee-2001-lathe", tmp_path))
    words = ["run", ring, "--machine", machine, "--link", "tcp:127.0.0.1:1", "--data", str(tmp_path)]
    options = build(text).parse_args(words)
    order = plan_request(options)
    tell_cut_with(options, order, text)
    assert capsys.readouterr().out == "pvt, full compensation: from the job alone, nothing learned\n"
    assert learn_hint(options, order, text) == [
        f"To learn from it: console learn FILE.csv --job {ring} --machine {machine}"
    ]


def test_what_was_simulated_is_not_for_iron(console: Console, ring: str, learned: str, tmp_path: Path) -> None:
    machine = str(signed_copy("lee-2001-lathe", tmp_path / "signed"))
    there = ("--machine", machine, "--link", "tcp:127.0.0.1:1", "--strategy", "cam", "--yes")
    said = console("run", ring, *there, "--compensation", "newest")
    assert said.code == 1 and "nothing has been learned" in said.err
    said = console("run", ring, *there, "--part", "x.csv")
    assert said.code == 1 and "the part is not measured here" in said.err


@pytest.mark.long
def test_a_version_makes_up_for_the_push_that_its_part_has_shown_also_after_a_restart(
    console: Console, job_file: JobFile, lathe: tuple[str, str], tmp_path: Path
) -> None:
    """Each command is a console of its own: what the second one knows of the push is on disk."""
    ring, trace = str(job_file(cut_length_mm="2.5", feed_mm_per_rev="0.05")), str(tmp_path / "part.csv")
    cut = ("run", ring, *lathe, *PLAIN, *SOFT, "--strategy", "cam")
    ran = console(*cut, "--part", trace)
    assert "push_um" in ran.json, ran.out + ran.err
    first = ran.json
    taught = console("learn", trace, "--job", ring, *lathe, "--keep", "--json").json
    (push,) = [each for each in taught["certificate"] if not each["order"] and not each["axial"]]
    assert push["standing"] == "learned" and 2.0 * push["on_part_um"] == pytest.approx(first["push_um"])
    second = console(*cut, "--compensation", "newest").json
    assert first["push_um"] > 10.0
    assert abs(second["push_um"]) < 0.3 * first["push_um"]
    before, after = (abs(each["tool"]["mean_um"]) for each in (first, second))
    assert before > 8.0 and after < 0.3 * before, "3 N or less on 10.9 um/N"


@pytest.mark.parametrize(
    ("simulated", "there", "said"), [(True, (), "add --sim"), (False, ("--sim",), "leave out --sim")]
)
def test_versions_for_the_other_kind_of_lathe_are_told(
    console: Console, data_folder: Path, simulated: bool, there: tuple[str, ...], said: str
) -> None:
    name = "lee-2001-experiment-1"
    job, machine = load_job(name), load_machine("lee-2001-lathe")
    asked = asked_for(job, machine, "cam", simulated=simulated)
    path = nominal_path(job.job, machine.machine, Strategy.CAM)
    for number in (1, 2):
        store(data_folder / "trilobe", model_again(asked, path, number, "2026-01-02T03:04:05.000Z"))
    listed = console("learn", "--job", name, "--list", *there)
    assert listed.code == 0 and "nothing learned yet" in listed.out
    assert said in listed.out and ": 2" in listed.out
    back = console("learn", "--job", name, "--revert", "1", *there)
    assert back.code != 0 and said in back.err
    same = console("learn", "--job", name, "--list", *(() if there else ("--sim",)))
    assert "nothing learned yet" not in same.out and said not in same.out
