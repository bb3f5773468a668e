"""A notch filter on trial: proposed, written, proven in air, or told that this controller reads it otherwise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from console.session.data.health import kept_tests
from console.session.data.health import store as store_test
from console.session.data.identified_responses import store
from console.session.station.commands import (
    ApplyGains,
    CheckHealth,
    DisableDrives,
    EnableDrives,
    Home,
    Recover,
    RevertGains,
)
from console.session.tuning.bounds import hidden_problems
from console.session.tuning.known_loop import known_loop
from console.session.tuning.notch_evidence import NO_FIRMWARE, seen_reading
from console.session.tuning.proposal import GainFacts, gain_facts
from console.session.tuning.trial import TrialPlace, air_doubts
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.axis.loop_design import unseen_hz
from profiles.axis.notch import Notch, SignConvention
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import gains_from_variables, notch_settings, with_variables
from profiles.store import load_machine
from tests.console.consoles import MACHINE, WithStation, cabled, station_of, until_back
from tests.console.floor import known as given
from tests.console.test_gain_trial import BEFORE, LATHE, PUBLISHED, cut_after, fill, record, stands
from tests.tui.tune_stage import FIRST, bending, filter_test, identified, swept


def station_with(data: Path, reading: SignConvention, friction_n: float = 0.0) -> WithStation:
    """A console at a lathe that bends, whose controller reads a filter in its own way."""
    file = data / "bends.toml"
    plant = (
        f'schema = 1\nflexible_fraction = 0.4\nnotch_reading = "{reading}"\ncoulomb_friction_n = {friction_n}\n'
    )
    file.write_text(plant, encoding="utf-8")
    return station_of(SimulatedLathe(LATHE, plant_named(str(file), LATHE, seed=1)), data)


def proposed(owner: WithStation, data: Path) -> GainFacts:
    read = TrialPlace(client=owner.client, machine=LATHE, data=data, simulated=False).gains.loop("")
    return gain_facts(LATHE, read, data, simulated=False)


def apply(owner: WithStation, facts: GainFacts) -> dict[str, float]:
    assert facts.proposal is not None
    settings = facts.proposal.settings
    owner.do(ApplyGains(settings=tuple(settings.items()), shown=tuple(facts.proposal.present.items())))
    return settings


def doubts_after_a_test(owner: WithStation, data: Path, step_um: float = 25.0) -> list[str]:
    """What a health test in air leaves to be said of the gains on trial; the drives are disabled again."""
    state = owner.do(EnableDrives(), Home(), CheckHealth(step_um=step_um))
    assert owner.refusals == [] and state.stop is None, "it neither trips nor is it stopped"
    owner.do(DisableDrives())
    place = TrialPlace(client=owner.client, machine=LATHE, data=data, simulated=False)
    kept = given(place.trial())
    return [problem.code for problem in air_doubts(place, kept[1], place.gains.read())]


def test_a_response_from_before_there_was_a_filter_is_of_a_loop_without_one(tmp_path: Path) -> None:
    """Whatever filter the controller has now: the axis is the one that was measured."""
    fill(tmp_path)
    plain, filtered = (
        known_loop(each, tmp_path, simulated=False) for each in (LATHE, with_variables(LATHE, FIRST))
    )
    for known in (plain, filtered):
        assert known.fit is not None and known.fit.holds
        (mode,) = known.fit.plant.modes
        assert mode.hz == pytest.approx(300.0, rel=0.02) and mode.fraction == pytest.approx(0.4, rel=0.1)
    assert filtered.loop.gains.notch and not plain.loop.gains.notch


def test_a_health_test_from_before_there_was_a_filter_tells_nothing_of_how_it_is_read(tmp_path: Path) -> None:
    """The same step with the filter named tells it: its numbers are those of the filtered loop."""
    machine, plant = with_variables(LATHE, FIRST), bending().plant

    def read_from(gains: dict[str, float]) -> SignConvention | None:
        store_test(tmp_path, filter_test(gains))
        return seen_reading(machine, tmp_path, plant, NO_FIRMWARE, simulated=True)

    assert read_from({name: value for name, value in FIRST.items() if name <= "I135"}) is None
    assert read_from(FIRST) is SignConvention.STATED


def test_a_filter_is_written_read_back_kept_on_disk_and_taken_back(tmp_path: Path) -> None:
    fill(tmp_path)
    owner = station_with(tmp_path, SignConvention.STATED)
    settings = {**FIRST}
    owner.do(ApplyGains(settings=tuple(settings.items()), shown=tuple(BEFORE.items())))
    assert (owner.refusals, owner.alarms, stands(owner)) == ([], ["trial.active"], settings)
    assert settings["I136"] < -0.5 and record(tmp_path)["proposed"] == settings
    owner.station.close("end")
    again = station_of(owner.sim, tmp_path)
    assert again.alarms == ["trial.active"], "known after a restart"
    state = again.do(RevertGains())
    assert (again.refusals, state.trial, stands(again)) == ([], None, BEFORE)


def test_a_link_that_is_cut_while_a_filter_is_written_leaves_a_loop_without_force(tmp_path: Path) -> None:
    """With n1 of it alone the loop would turn its sign at rest: Ix30 is 0 until all of it is there."""
    fill(tmp_path)
    owner, cable = cabled(SimulatedLathe(LATHE), tmp_path, load_machine(MACHINE))
    owner.context.client = owner.client
    cut_after(owner, cable, b"I136=-1.09375")
    owner.do(ApplyGains(settings=tuple(FIRST.items()), shown=tuple(BEFORE.items())))
    cable.mend()
    until_back(owner)
    trial = given(owner.state.trial)
    assert not trial.whole
    assert (stands(owner)["I130"], stands(owner)["I136"], stands(owner)["I137"]) == (0.0, -1.09375, 0.0)
    (told,) = trial.problems
    assert (told.code, told.limit) == ("trial.stands", "I130 0")
    owner.do(Recover(), EnableDrives())
    assert owner.refusals[0] == "trial.stands"
    found = proposed(owner, tmp_path)
    assert found.proposal is not None and found.proposal.factor is None, "there is no loop to compare with"
    owner.do(RevertGains())
    assert (owner.refusals, owner.alarms, stands(owner)) == ([], [], BEFORE)


def test_a_filter_that_would_not_be_safe_otherwise_is_refused_before_a_test(tmp_path: Path) -> None:
    """The stiff one, for a controller whose reading is known: unstable with the signs of its zeros turned."""
    fill(tmp_path)
    owner = station_with(tmp_path, SignConvention.STATED)
    owner.do(ApplyGains(settings=tuple(STIFF.items()), shown=tuple(BEFORE.items())))
    assert owner.refusals == ["trial.notch_unsafe"] and stands(owner) == BEFORE


@pytest.mark.parametrize("value", [2.5, 2.0, -2.25])
def test_a_coefficient_that_a_controller_takes_for_another_is_refused(tmp_path: Path, value: float) -> None:
    """2 becomes -2 in its 24 bits (tests/drivers/test_tool_servo.py)."""
    owner = station_with(tmp_path, SignConvention.STATED)
    beyond = {**FIRST, "I138": value}
    owner.do(ApplyGains(settings=tuple(beyond.items()), shown=tuple(BEFORE.items())))
    assert owner.refusals == ["trial.range"] and stands(owner) == BEFORE
    assert ">= -2, < 2" in str(owner.state.refusals[0])


STIFF = {"I130": 3126.0, "I131": 1656.0, "I132": 1656.0, "I133": 37_134.0}
STIFF |= notch_settings(LATHE, Notch(n1=-1.087890625, n2=0.60546875, d1=-0.5078125, d2=0.22265625))
"""For a controller whose reading is known: 2.6 um/N at most, where gains alone yield 17."""


def read_and_proven(data: Path, *tests: dict[str, float]) -> None:
    """Keep the responses up to 225 Hz, and a health test that agrees with the model for each of these gains."""
    fill(data)
    for gains in tests:
        store_test(data, filter_test(gains, gains, simulated=False))


def test_with_the_reading_proven_the_published_gains_get_a_filter_and_not_gains_alone(tmp_path: Path) -> None:
    """The stiffest might meet a mode above 225 Hz, which no sweep can show: the next one is taken."""
    read_and_proven(tmp_path, FIRST)
    found = gain_facts(LATHE, None, tmp_path, simulated=False)
    assert found.proposal is not None and found.reasons == found.notes == ()
    assert found.proposal.settings["I136"] < -0.5
    assert found.stiffness is not None and found.stiffness[1].most_um_per_n < 5.0 < 10.0
    fit = given(found.known.fit)
    assert unseen_hz(found.known.loop, found.proposal.gains, fit) is None


def test_gains_that_are_proven_and_yield_less_than_what_may_be_proposed_are_kept(tmp_path: Path) -> None:
    read_and_proven(tmp_path, FIRST, STIFF)
    machine = with_variables(LATHE, STIFF)
    found = gain_facts(machine, None, tmp_path, simulated=False)
    assert found.proposal is None and [each.code for each in found.reasons] == ["trial.stiff_already"]
    assert found.reasons[0].value == "2.59 um/N" and "keep them" in str(found.reasons[0])
    assert float(found.reasons[0].limit.split()[0]) > 2.59


def test_gains_that_no_test_has_proven_are_not_told_to_be_kept(tmp_path: Path) -> None:
    read_and_proven(tmp_path, FIRST)
    found = gain_facts(with_variables(LATHE, STIFF), None, tmp_path, simulated=False)
    assert found.proposal is not None and found.reasons == ()


@pytest.mark.parametrize(("reaches_hz", "code"), [(225.0, "trial.unseen_above"), (180.0, "trial.unseen")])
def test_what_only_a_sweep_above_can_show_gives_softer_gains_meanwhile(
    tmp_path: Path, reaches_hz: float, code: str
) -> None:
    """Stiff gains for a rigid tool, by responses so vague that a mode could hide."""
    loop = loop_of(LATHE)
    points = tuple(each for each in swept(loop, 0.02) if each.frequency_hz <= reaches_hz)
    store(tmp_path, identified(points, PUBLISHED, simulated=False))
    known = known_loop(LATHE, tmp_path, simulated=False)
    stiff = with_variables(LATHE, {"I130": 2954.0, "I131": 1263.0, "I132": 1263.0, "I133": 55_697.0})
    (told,) = hidden_problems(LATHE, known, replace(known.loop, gains=gains_from_variables(stiff)))
    assert told.code == code
    found = gain_facts(LATHE, None, tmp_path, simulated=False)
    if code == "trial.unseen":
        assert found.proposal is None and [each.code for each in found.reasons] == [code]
    else:
        assert "console identify --frequencies 240" in str(told)
        assert found.proposal is not None and [each.code for each in found.notes] == [code], (
            "softer, with the reason"
        )
        assert hidden_problems(LATHE, known, replace(known.loop, gains=found.proposal.gains)) == ()


@pytest.mark.parametrize("present", [PUBLISHED, STIFF], ids=["published", "stiff"])
def test_a_filter_that_a_hidden_mode_might_meet_is_told(tmp_path: Path, present: dict[str, float]) -> None:
    """Responses so vague that a mode could hide above them: not that no filter would be safe."""
    store(tmp_path, identified(swept(bending(), 0.04), PUBLISHED, simulated=False))
    found = gain_facts(with_variables(LATHE, present), None, tmp_path, simulated=False)
    assert found.proposal is not None and found.proposal.settings["I136"] == 0.0, "gains alone"
    assert [each.code for each in found.notes] == ["trial.unseen_above"]


@pytest.mark.long
def test_proven_in_air_it_makes_room_for_a_stiffer_one(tmp_path: Path) -> None:
    fill(tmp_path)
    owner = station_with(tmp_path, SignConvention.STATED)
    first = proposed(owner, tmp_path)
    assert [note.code for note in first.notes] == ["trial.first_notch"]
    apply(owner, first)
    assert doubts_after_a_test(owner, tmp_path) == []
    assert known_loop(LATHE, tmp_path, simulated=False).reading is SignConvention.STATED
    second = proposed(owner, tmp_path)
    assert second.stiffness is not None and second.notes == ()
    assert second.stiffness[1].most_um_per_n < 0.3 * second.stiffness[0].most_um_per_n
    apply(owner, second)
    assert owner.refusals == []
    assert doubts_after_a_test(owner, tmp_path, 15.0) == [], "less, for the stiffer loop over this slow line"
    (newest, *_) = kept_tests(tmp_path, MACHINE, 1)
    assert newest.result is not None and newest.result.origin.gains["I130"] == stands(owner)["I130"]
    owner.do(RevertGains())
    assert stands(owner) == BEFORE


@pytest.mark.long
@pytest.mark.parametrize(
    ("reading", "friction_n"),
    [
        (SignConvention.NUMERATOR, 0.0),
        (SignConvention.DENOMINATOR, 0.0),
        (SignConvention.BOTH, 0.0),
        (SignConvention.DENOMINATOR, 1.0),
    ],
)
def test_a_controller_that_reads_it_otherwise_is_told(
    tmp_path: Path, reading: SignConvention, friction_n: float
) -> None:
    fill(tmp_path)
    owner = station_with(tmp_path, reading, friction_n)
    apply(owner, proposed(owner, tmp_path))
    doubts = doubts_after_a_test(owner, tmp_path, 50.0 if friction_n else 25.0)
    assert doubts[-1] == "trial.read_otherwise" and "trial.swings" not in doubts
    told = proposed(owner, tmp_path)
    assert [note.code for note in told.notes] == ["trial.other_reading"]
    assert told.proposal is not None and told.proposal.settings["I136"] == 0.0, "gains alone"
    owner.do(RevertGains())
    assert (owner.refusals, stands(owner)) == ([], BEFORE)


def test_a_trial_of_gains_alone_from_before_is_taken_back(tmp_path: Path) -> None:
    """Its file names four gains: there was no filter, neither before nor proposed."""
    owner = station_with(tmp_path, SignConvention.STATED)
    owner.do(ApplyGains(settings=tuple({**BEFORE, "I130": 264.0}.items()), shown=tuple(BEFORE.items())))
    file = tmp_path / "trials" / MACHINE / "trial-000001.json"
    text = file.read_text("utf-8")
    for name in ("I136", "I137", "I138", "I139"):
        text = text.replace(f',\n    "{name}": 0.0', "")
    assert "I136" not in text.split('"margins"')[0]
    file.write_text(text, encoding="utf-8")
    owner.station.close("end")
    again = station_of(owner.sim, tmp_path)
    assert again.alarms == ["trial.active"]
    again.do(RevertGains())
    assert (again.refusals, stands(again)) == ([], BEFORE)
