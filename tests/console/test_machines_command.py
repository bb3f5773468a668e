"""`console machines`, `jobs`, `reproduce`: lists stay tables, a copied profile is signed before iron is moved."""

from __future__ import annotations

import os
import re
import shutil
import sys
from functools import cache
from pathlib import Path

import pytest
from pytest import MonkeyPatch

import profiles.store
from console.cli.library import refuse_unsigned
from console.cli.measured import comparison
from console.cli.parser import columns
from profiles.paper.record import Record, Section, lee_2001
from profiles.paper.reproduction import sections
from profiles.problem import ProfileError
from profiles.store import BUNDLED_MACHINES, load_machine
from tests.console.commands import Console
from tests.console.conftest import Said
from tests.console.floor import known
from tests.signed_profile import signed


def rows(run: Said) -> dict[str, list[str]]:
    return {line.split()[0]: line.split()[1:] for line in run.out.splitlines()[1:]}


def test_the_bundled_machines_are_listed_with_link_and_signature(console: Console, data_folder: Path) -> None:
    assert rows(console("machines"))["lee-2001-lathe"] == ["-", "simulator", "39", "bundled"]
    assert console("machines", "list").out == console("machines").out
    (turbo,) = [each for each in console("machines", "--json").json["machines"] if "turbo" in each["name"]]
    assert turbo["link"] == "ethernet:192.6.94.5" and turbo["signed_for"] == "simulator"


def test_a_copy_keeps_everything_but_what_belongs_to_one_machine(console: Console, data_folder: Path) -> None:
    """Its signature and its link: with either of them it would be taken for the other machine."""
    console("machines", "copy", "turbo-ethernet-lathe", "lathe-3")
    path = data_folder / "trilobe" / "machines" / "lathe-3.toml"
    signed = path.read_text(encoding="utf-8").replace('signed_for = "simulator"', 'signed_for = "machine"')
    path.write_text(
        f"{signed.replace('simulated lathe only: sign again for a real machine', 'H. Kim')}\n# a note", "utf-8"
    )
    run = console("machines", "copy", "lathe-3", "lathe-4")
    made, source = load_machine("lathe-4", path.parent), load_machine("turbo-ethernet-lathe")
    assert (made.machine.name, made.machine.link, made.machine.safety.signed_for) == ("lathe-4", "", "simulator")
    assert "H. Kim" not in made.text and made.text.endswith("# a note")
    assert made.machine.tool == source.machine.tool and made.machine.controller == source.machine.controller
    assert (
        str(made.path) in run.out and "controller.variables" in run.out and "doctor --machine lathe-4" in run.out
    )
    assert rows(console("machines"))["lathe-4"] == ["-", "simulator", "40", "own"]


@pytest.mark.parametrize("name", ["lathe-3", "lee-2001-lathe", "../lathe", "", "x" * 61, ".hidden"])
def test_nothing_is_overwritten_or_written_elsewhere(console: Console, data_folder: Path, name: str) -> None:
    console("machines", "copy", "lee-2001-lathe", "lathe-3")
    before = {path: path.read_bytes() for path in data_folder.rglob("*.toml")}
    run = console("machines", "copy", "turbo-ethernet-lathe", name)
    assert run.code == 1 and run.err.startswith("console: ") and run.err.count("\n") == 1
    assert {path: path.read_bytes() for path in data_folder.rglob("*.toml")} == before


def test_a_plain_copy_or_a_bad_profile_is_listed_with_why_it_is_refused(
    console: Console, data_folder: Path
) -> None:
    folder = data_folder / "trilobe" / "machines"
    folder.mkdir(parents=True)
    shutil.copy(BUNDLED_MACHINES / "lee-2001-lathe.toml", folder / "lathe-3.toml")
    (folder / "bad.toml").write_text("schema = 1\n", encoding="utf-8")
    said = console("machines")
    assert rows(said)["lathe-3"] == ["cannot", "be", "read", "own"] and 'name = "lathe-3"' in said.out
    assert "name is missing" in said.out and "lee-2001-lathe" in said.out
    (copy,) = (each for each in console("machines", "--json").json["machines"] if each["name"] == "lathe-3")
    assert copy["problems"] and "signed_for" not in copy


@pytest.mark.parametrize(
    ("command", "rest"),
    [
        ("run", "lee-2001-experiment-1"),
        ("retract", ""),
        ("calibrate lobe", "FILE --job lee-2001-experiment-1"),
        ("calibrate chuck", "FILE"),
    ],
)
def test_who_is_refused_is_told_of_options_that_exist(console: Console, command: str, rest: str) -> None:
    """turbo-ethernet-lathe has a link, and is signed for the simulator."""
    words = (*command.split(), *rest.split(), "--machine", "turbo-ethernet-lathe")
    told = known(re.search(r"use the simulated machine \((.*?)\)", console(*words).err))
    taken, named = console(*command.split(), "--help").out, re.findall(r"--\w+", told[1])
    assert named and all(re.search(rf"^ +{name}\b", taken, re.MULTILINE) for name in named)
    assert told[1] in console(*words, "--lang", "ko").err


@pytest.mark.parametrize(
    "command", ["controller apply", "controller restore", "controller download", "tune apply"]
)
def test_so_are_commands_that_have_connected_before(console: Console, command: str) -> None:
    with pytest.raises(ProfileError) as refused:
        refuse_unsigned(load_machine("turbo-ethernet-lathe").machine)
    assert refused.value.problems[0].limit == "--link sim:"
    assert re.search(r"^ +--link\b", console(*command.split(), "--help").out, re.MULTILINE)


@pytest.fixture
def own_jobs(data_folder: Path) -> Path:
    folder = data_folder / "trilobe" / "jobs"
    folder.mkdir(parents=True)
    return folder


def bundled() -> bytes:
    return (profiles.store.BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_bytes()


def test_no_file_name_breaks_the_table_of_jobs(console: Console, own_jobs: Path) -> None:
    (own_jobs / os.fsdecode(b"odd\xff.toml")).write_bytes(bundled())
    for content in (bundled(), b"name = 3"):
        (own_jobs / "two\nlines\x1b[31m.toml").write_bytes(content)
        said = console("jobs").out
        assert next(line for line in said.splitlines() if "two" in line).startswith(r"two\nlines\x1b[31m  ")
        assert "\x1b" not in said and r"odd\udcff" in said
        assert "two\nlines\x1b[31m" in [job["name"] for job in console("jobs", "--json").json["jobs"]]


def test_a_plain_copy_is_listed_with_why_it_is_not_cut(console: Console, own_jobs: Path) -> None:
    """Its runs and learned versions would be those of the job that it was copied from."""
    (own_jobs / "copy.toml").write_bytes(bundled())
    jobs = {job["name"]: job for job in console("jobs", "--json").json["jobs"]}
    assert "title" not in jobs["copy"] and any('name = "copy"' in said for said in jobs["copy"]["problems"])
    assert jobs["lee-2001-experiment-1"]["title"] == "lee-2001-experiment-1"
    said = console("run", "copy", "--sim")
    assert said.code == 1 and 'name = "copy"' in said.err


def test_with_a_machine_each_job_is_judged_by_its_rules(console: Console, own_jobs: Path) -> None:
    thick = bundled().replace(b"wall_thickness_mm = 2.5", b"wall_thickness_mm = 99.0")
    thick = thick.replace(b'name = "lee-2001-experiment-1"', b'name = "thick"')
    (own_jobs / "thick.toml").write_bytes(thick)
    said = console("jobs", "--machine", "lee-2001-lathe")
    assert said.code == 0 and "lee-2001-lathe" in said.out.splitlines()[-1]
    rows = {line.split()[0]: line for line in said.out.splitlines()}
    assert rows["lee-2001-experiment-1"].endswith("fits") and "refused" in rows["thick"]
    assert "thicker than the radius" in said.out
    found = console("jobs", "--machine", "lee-2001-lathe", "--json").json
    assert found["judged_on"] == "lee-2001-lathe"
    problems = {job["name"]: job["problems"] for job in found["jobs"]}
    assert problems["lee-2001-experiment-1"] == []
    assert any("thicker than the radius" in sentence for sentence in problems["thick"])


def test_an_unknown_machine_is_refused_with_those_that_are_known(console: Console) -> None:
    said = console("jobs", "--machine", "no-such-lathe")
    assert (said.code, said.out) == (1, "") and "no-such-lathe" in said.err and "lee-2001-lathe" in said.err


def test_a_configured_machine_changes_no_list(console: Console, own_jobs: Path, monkeypatch: MonkeyPatch) -> None:
    monkeypatch.setenv("TRILOBE_MACHINE", "no-such-lathe")
    assert console("jobs").code == 0 and "fits" not in console("jobs").out


@pytest.fixture
def console_without_numerics(console: Console, monkeypatch: MonkeyPatch) -> Console:
    """The sections computed once; they are tested elsewhere."""
    monkeypatch.setattr(comparison, "sections", lambda _: computed())
    return console


@cache
def computed() -> tuple[Section, ...]:
    return tuple(sections(lee_2001()))


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_row_has_its_sentence_and_its_reason(console_without_numerics: Console, language: str) -> None:
    """A key without a sentence shows itself."""
    said = console_without_numerics("reproduce", "--quick", "--plot", "--lang", language)
    assert said.code == 0
    assert "reproduce." not in said.out
    assert "55.25 Hz" in said.out and "80 Hz" in said.out and "✗" in said.out
    assert "⠉" in said.out, "the figures"
    assert "1, 5, 6, 7, 8, 9" in said.out.splitlines()[-1], "what was left out is told"


def test_json_is_not_rounded_and_has_the_curves(console_without_numerics: Console) -> None:
    found = console_without_numerics("reproduce", "--quick", "--json").json
    by_name = {record["name"]: record for section in found["sections"] for record in section["records"]}
    assert by_name["eq9.overshoot"]["ours"] == pytest.approx(2.309, abs=1e-3)
    assert len(str(by_name["eq9.overshoot"]["ours"])) > 10
    assert by_name["slip.concluded"]["holds"] is False and "27 um" in by_name["slip.concluded"]["why"]
    assert {figure["name"] for section in found["sections"] for figure in section["figures"]} >= {"fig3", "fig12"}
    assert found["acceptance"] == {"2": True, "3": True, "4": True, "10": True, "11": True, "12": True}


def test_a_missed_number_is_the_exit_code(console: Console, monkeypatch: MonkeyPatch) -> None:
    missed = Record(name="accept.servo", at="gain", ours=0.5, expected=0.7455, tolerance=0.0037, number=2)
    monkeypatch.setattr(comparison, "sections", lambda _: (Section(name="acceptance", records=(missed,)),))
    assert console("reproduce", "--quick").code == 1


def test_what_tells_nothing_of_the_paper_is_counted_apart(console_without_numerics: Console) -> None:
    said = console_without_numerics("reproduce", "--quick").out
    rows = {
        line.split("  ")[0]: line.split()[-1] for line in said.splitlines() if line.startswith(("Fig", "Table"))
    }
    assert rows["Fig 4: undulations of the deflection per revolution"] == "≡"
    assert rows["Fig 5a: variation of 35 mm over that of 68 mm"] == "✗"
    assert rows["Table 5: amplitude error, 50 Hz, fitted loop"] == "(✓)"
    assert rows["Table 5: phase error, 10 Hz, fitted loop"] == "(✗)"
    counted = next(line for line in said.splitlines() if "Counted separately" in line)
    assert rows["Fig 11: bandwidth, as the controller samples it"] == "(✓)"
    assert rows["Table 5: amplitude error, 50 Hz, Eq 9"] == "(✗)"
    # The rows of docs/paper.md, counted: 2 ✓ of 32 that could have come out otherwise, 29 ≡, and in brackets 8 of
    # Table 5, 4 by a reading of it, two explanations of Fig 11 and, for two parts, ten explanations of Fig 16.
    assert [int(word) for word in counted.replace(".", " ").split() if word.isdigit()] == [2, 32, 29, 8, 4, 22]
    found = console_without_numerics("reproduce", "--quick", "--json").json
    by_name = {record["name"]: record for section in found["sections"] for record in section["records"]}
    assert by_name["eq4.speed"]["basis"] == "by construction"


@pytest.mark.parametrize(("told", "width"), [("132", 132), ("", 97), ("0", 97), ("wide", 97), ("-5", 97)])
def test_the_width_is_that_of_columns_else_that_of_the_terminal(
    monkeypatch: MonkeyPatch, told: str, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", told)
    monkeypatch.setattr(os, "get_terminal_size", lambda fd: os.terminal_size((97, 30)))
    assert columns() == width


def test_without_a_terminal_it_is_eighty_columns(monkeypatch: MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        monkeypatch.setattr(sys, "__stdout__", pipe)
        assert columns() == 80
    assert columns() == 80  # closed
    os.close(reading)


JOB = "lee-2001-experiment-1"
NOBODY_THERE = "tcp:127.0.0.1:1"
"""No port to listen at for anybody but the system: whoever gets there is refused by the link."""


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    """What an engineer begins with: the bundled profile, with the address of his controller."""
    path = tmp_path / "lathe.toml"
    text = load_machine("lee-2001-lathe").path.read_text(encoding="utf-8")
    path.write_text(text.replace("schema = 1", f'schema = 1\nlink = "{NOBODY_THERE}"'), encoding="utf-8")
    return path


def sign(profile: Path) -> None:
    profile.write_text(signed(profile.read_text(encoding="utf-8")), encoding="utf-8")


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize(
    "command", [("run", JOB, "--yes"), ("identify", "--yes"), ()], ids=["run", "identify", "screens"]
)
def test_a_copy_is_refused_where_it_would_move_iron(
    console: Console, copied: Path, monkeypatch: MonkeyPatch, command: tuple[str, ...], language: str
) -> None:
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    said = console("--machine", str(copied), *command, "--lang", language)
    assert (said.code, said.out) == (1, "")
    assert "safety.signed_for" in said.err and '"machine"' in said.err
    assert "127.0.0.1" not in said.err  # nobody was looked for


@pytest.mark.parametrize("command", [("run", JOB), ("identify",)], ids=["run", "identify"])
def test_once_signed_for_it_is_looked_for(console: Console, copied: Path, command: tuple[str, ...]) -> None:
    sign(copied)
    said = console("--machine", str(copied), *command, "--yes")
    assert said.code == 1
    assert "127.0.0.1" in said.err and "safety" not in said.err


def test_what_sends_nothing_and_a_simulated_machine_need_no_signature(console: Console, copied: Path) -> None:
    for command in ("preview", "program"):
        assert console(command, JOB, "--machine", str(copied)).code == 0
    short = ("--frequencies", "50", "--periods", "8")
    assert console("identify", "--sim", "--machine", str(copied), *short).code == 0
