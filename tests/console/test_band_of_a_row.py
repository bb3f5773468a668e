"""A trial band in a row of parts: cut, indicated in the jaws, and its own part corrected by it."""

from __future__ import annotations

import json

import pytest

from drivers.simulator.plant.presets import plant_named
from profiles.store import load_machine
from tests.console.commands import Console, JobFile

SEED = 103
CUT = ("--sim", "--plant", "realistic", "--seed", str(SEED), "--strategy", "cam")


@pytest.fixture
def short(job_file: JobFile) -> str:
    return str(job_file(cut_length_mm="6.0"))


@pytest.mark.timeout(180)
def test_a_band_shows_what_arrives_and_corrects_its_own_part(console: Console, short: str) -> None:
    said = console("run", short, *CUT, "--learn", "1", "--fingerprint", "indicator", "--trial-band", "--json")
    assert said.code == 0, said.err
    (part,) = json.loads(said.out)["passes"]
    band, true = (
        part["learned"]["trial_band"],
        plant_named("realistic", load_machine("lee-2001-lathe").machine, SEED),
    )
    assert band["arrives"] == pytest.approx(true.process_gain, abs=0.03)
    assert band["play_um"] == pytest.approx(true.indicator_backlash_um, abs=1.0)
    assert 10.0 < band["push_um"] < 40.0
    assert part["CYLt_um"] < 6.0, "without a band 13 um and more"


def test_between_band_and_rest_somebody_has_to_read(console: Console, short: str) -> None:
    said = console("run", short, *CUT, "--trial-band")
    assert said.code == 1 and "--learn" in said.err and "PARTS" in said.err


@pytest.mark.long
@pytest.mark.timeout(300)
@pytest.mark.parametrize("more", [(), ("--trial-band",)])
def test_what_a_fingerprint_corrects_before_the_first_part_is_no_step(
    console: Console, short: str, more: tuple[str, ...]
) -> None:
    """The lobe of this lathe stands 3 deg beside its job: that is known from the first reading on."""
    cut = ("--sim", "--plant", "realistic", "--seed", "204", "--strategy", "cam")
    said = console("run", short, *cut, "--learn", "2", "--fingerprint", "indicator", *more, "--json")
    assert said.code == 0, said.err
    assert len(said.json["passes"]) == 2
    assert not any("stepped" in each for each in said.json["warnings"])
