"""`console machines`: what `--machine` takes, and a copy as the beginning of another lathe's profile."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from console.cli.library import refuse_unsigned
from profiles.problem import ProfileError
from profiles.store import BUNDLED_MACHINES, load_machine
from tests.console.conftest import Said

Console = Callable[..., Said]


def rows(run: Said) -> dict[str, list[str]]:
    return {line.split()[0]: line.split()[1:] for line in run.out.splitlines()[1:]}


def test_the_bundled_machines_are_listed_with_link_and_signature(console: Console, data_folder: Path) -> None:
    assert rows(console("machines"))["lee-2001-lathe"] == ["-", "simulator", "37", "bundled"]
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
    assert rows(console("machines"))["lathe-4"] == ["-", "simulator", "38", "own"]


@pytest.mark.parametrize("name", ["lathe-3", "lee-2001-lathe", "../lathe", "", "x" * 61, ".hidden"])
def test_nothing_is_overwritten_or_written_elsewhere(console: Console, data_folder: Path, name: str) -> None:
    console("machines", "copy", "lee-2001-lathe", "lathe-3")
    before = {path: path.read_bytes() for path in data_folder.rglob("*.toml")}
    run = console("machines", "copy", "turbo-ethernet-lathe", name)
    assert run.code == 1 and run.err.startswith("console: ") and run.err.count("\n") == 1
    assert {path: path.read_bytes() for path in data_folder.rglob("*.toml")} == before


def test_a_plain_copy_is_listed_with_why_it_is_refused(console: Console, data_folder: Path) -> None:
    folder = data_folder / "trilobe" / "machines"
    folder.mkdir(parents=True)
    shutil.copy(BUNDLED_MACHINES / "lee-2001-lathe.toml", folder / "lathe-3.toml")
    said = console("machines")
    assert rows(said)["lathe-3"] == ["cannot", "be", "read", "own"] and 'name = "lathe-3"' in said.out
    (copy,) = (each for each in console("machines", "--json").json["machines"] if each["name"] == "lathe-3")
    assert copy["problems"] and "signed_for" not in copy


def test_a_profile_that_cannot_be_read_is_listed_with_its_reason(console: Console, data_folder: Path) -> None:
    folder = data_folder / "trilobe" / "machines"
    folder.mkdir(parents=True)
    (folder / "bad.toml").write_text("schema = 1\n", encoding="utf-8")
    run = console("machines")
    assert "cannot be read" in run.out and "name is missing" in run.out
    assert "lee-2001-lathe" in run.out


@pytest.mark.parametrize(
    ("command", "rest"),
    [
        ("run", "lee-2001-experiment-1"),
        ("retract", ""),
        ("calibrate lobe", "FILE --job lee-2001-experiment-1"),
        ("calibrate chuck", "FILE"),
    ],
)
def test_who_is_refused_is_told_only_of_options_that_the_command_has(
    console: Console, command: str, rest: str
) -> None:
    """turbo-ethernet-lathe has a link, and is signed for the simulator."""
    words = (*command.split(), *rest.split(), "--machine", "turbo-ethernet-lathe")
    told = re.search(r"use the simulated machine \((.*?)\)", console(*words).err)
    assert told is not None
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
