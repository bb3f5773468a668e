"""`console tune`: what it proposes, writes on trial, takes back, and how a comparison explains it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.console.commands import Console, on_one
from tests.drivers.commissioned import Commissioned

NAMES = ("I130", "I131", "I132", "I133")


def stands(card: Commissioned) -> list[float]:
    settings = card.sim.controller.variables.settings()
    return [settings[int(name[1:])] for name in NAMES]


@pytest.mark.first(1)
@on_one
@pytest.mark.parametrize("language", ["en", "ko"])
def test_gains_are_shown_applied_explained_and_taken_back(
    console: Console,
    card: Commissioned,
    data_folder: Path,
    language: str,
) -> None:
    before = stands(card)
    shown = console("tune", "show", "--factor", "0.9", "--lang", language)
    assert shown.code == 0 and "I130  528 -> " in shown.out and not (data_folder / "trilobe" / "trials").exists()
    assert "10.87 um/N" in shown.out, "what the published gains yield at most"
    dry = console("tune", "apply", "--factor", "0.9", "--lang", language)
    assert (dry.code, stands(card)) == (0, before) and "--yes" in dry.out
    done = console("tune", "apply", "--factor", "0.9", "--yes", "--lang", language)
    # Kp times 0.9 squared.
    assert (done.code, stands(card)[0]) == (0, round(528 * 0.81))
    told = console("controller", "verify", "--lang", language)
    assert told.code == 1 and "console tune revert --yes" in " ".join(told.out.split())
    found = console("tune", "show", "--json").json["trial"]
    gains = {name: value for name, value in found["before"] if name in NAMES}
    assert gains == dict(zip(NAMES, before, strict=True)) and found["whole"]
    assert console("tune", "revert", "--yes", "--lang", language).code == 0
    assert stands(card) == before
    assert console("controller", "verify").code == 0
    assert console("tune", "revert", "--yes").code == 1


@on_one
@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_filter_that_the_profile_does_not_state_is_named_and_written_away(
    console: Console, card: Commissioned, language: str
) -> None:
    card.tell("I136=-0.5", "I138=0.25")
    shown = console("tune", "show", "--lang", language)
    assert "I136 -0.5 (0), I138 0.25 (0)" in shown.out
    assert console("tune", "show", "--json").json["differing"]["I138"] == {"profile": 0.0, "found": 0.25}
    assert console("controller", "verify").code == 1
    assert console("controller", "apply", "--yes", "--lang", language).code == 0
    assert card.client.numbers("I136", "I138") == (0.0, 0.0)
    assert console("controller", "verify").code == 0
    assert "I136" not in console("tune", "show").out


@on_one
def test_once_the_profile_is_applied_nobody_says_that_gains_are_on_trial(
    console: Console, card: Commissioned, data_folder: Path
) -> None:
    assert console("tune", "apply", "--factor", "0.9", "--yes").code == 0
    assert "on trial" in console("controller", "verify").out
    assert console("controller", "apply", "--yes").code == 0
    verified = console("controller", "verify")
    assert verified.code == 0 and "on trial" not in verified.out
    assert console("tune", "show", "--json").json["trial"] is None


@on_one
def test_gains_beyond_the_bounds_are_refused_with_the_number(console: Console, card: Commissioned) -> None:
    before = stands(card)
    for factor, word in (("2.4", "phase margin with these gains 42.1 deg"), ("9", "0.4..3")):
        said = console("tune", "apply", "--factor", factor, "--yes")
        assert said.code == 1 and word in said.err and stands(card) == before
    card.tell("#1J/")
    said = console("tune", "apply", "--factor", "0.9", "--yes")
    assert said.code == 1 and "#1" in said.err and stands(card) == before
