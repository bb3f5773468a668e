"""`console machines`: what `--machine` takes, and a copy as the beginning of another lathe's profile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from profiles.store import load_machine
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
    path.write_text(f"{signed.replace('simulated lathe only: sign anew for iron', 'H. Kim')}\n# a note", "utf-8")
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


def test_a_profile_that_cannot_be_read_is_listed_with_its_reason(console: Console, data_folder: Path) -> None:
    folder = data_folder / "trilobe" / "machines"
    folder.mkdir(parents=True)
    (folder / "bad.toml").write_text("schema = 1\n", encoding="utf-8")
    run = console("machines")
    assert "cannot be read" in run.out and "name is missing" in run.out
    assert "lee-2001-lathe" in run.out
