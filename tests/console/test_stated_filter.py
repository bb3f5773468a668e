"""A notch filter of a profile: nothing is cut with it before a health test on this controller proves it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from console.cli.machine.tool_tests import with_origin
from console.session.cut.trip_cause import with_cause
from console.session.data.health import store as store_test
from console.session.data.identified_responses import store as store_response
from console.session.errors import SessionError
from console.session.station.commands import Arm, CheckHealth, EnableDrives, Home, Verify
from console.session.station.machine_connection import CommissioningGate
from console.session.station.machine_control import MachineControl
from console.session.tuning.air_proof import stated_filter_problems
from console.session.tuning.known_loop import known_loop
from console.session.tuning.notch_evidence import NO_FIRMWARE
from console.session.tuning.trial_checks import filter_checks
from console.text.catalogue import load
from drivers.cutting.strategy import Strategy
from drivers.identification.result import ResponseOrigin
from drivers.identification.rig import Rig
from drivers.lathe.heartbeat import Heartbeat
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from profiles.arrays import floats
from profiles.axis.notch import Notch, SignConvention
from profiles.axis.servo_gains import gains_from_variables, notch_settings, variables_from_gains, with_variables
from profiles.axis.step_figures import model_step
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProblemError
from profiles.store import load_machine
from tests.console.commands import Console
from tests.console.consoles import MACHINE, WithStation, station_of
from tests.console.floor import experiment_1
from tests.console.test_gain_trial import LATHE, PUBLISHED, fill
from tests.tui.tune_stage import FIRST, bending, filter_test, identified, swept

JOB = experiment_1()
FIRMWARE = "1.17", "PMAC"


def stating(settings: dict[str, float]) -> MachineProfile:
    """The machine with these gains in its profile, nothing of them on trial."""
    n1, n2, d1, d2 = (settings.get(f"I1{number}", 0.0) for number in range(36, 40))
    machine = with_variables(LATHE, settings)
    return replace(machine, tool=replace(machine.tool, notch_n1=n1, notch_n2=n2, notch_d1=d1, notch_d2=d2))


def codes(data: Path, machine: MachineProfile, firmware: tuple[str, str] = NO_FIRMWARE) -> list[str]:
    return [each.code for each in stated_filter_problems(machine, data, firmware, simulated=False)]


def test_a_profile_without_a_filter_needs_no_test(tmp_path: Path) -> None:
    assert codes(tmp_path, LATHE) == [] and filter_checks(tmp_path, LATHE, FIRMWARE, simulated=False) == []


def test_a_filter_is_proven_by_a_test_with_exactly_these_gains_on_this_firmware(tmp_path: Path) -> None:
    fill(tmp_path)
    machine = stating(FIRST)
    assert codes(tmp_path, machine) == ["trial.filter_untested"]
    (check,) = filter_checks(tmp_path, machine, FIRMWARE, simulated=False)
    assert check.code == "filter_untested" and check.severity == "warning"
    store_test(tmp_path, filter_test(FIRST, FIRST, simulated=False))
    assert codes(tmp_path, machine) == codes(tmp_path, machine, FIRMWARE) == []
    assert filter_checks(tmp_path, machine, FIRMWARE, simulated=False) == []
    assert codes(tmp_path, machine, ("1.18", "PMAC")) == ["trial.filter_untested"], "of another firmware"
    assert codes(tmp_path, stating({**FIRST, "I130": 600.0})) == ["trial.filter_untested"], "with other gains"
    simulated = stated_filter_problems(machine, tmp_path, simulated=True)
    assert [each.code for each in simulated] == ["trial.filter_untested"], "of the other world"


def test_a_test_that_shows_another_reading_proves_nothing(tmp_path: Path) -> None:
    fill(tmp_path)
    machine, loop = stating(FIRST), bending(FIRST)
    misread = {name: -value if name in ("I136", "I137") else value for name, value in FIRST.items()}
    assert loop.gains.notch.read_as(SignConvention.NUMERATOR) == bending(misread).gains.notch
    store_test(tmp_path, filter_test(FIRST, misread, simulated=False))
    assert "trial.read_otherwise" in codes(tmp_path, machine)
    (check,) = filter_checks(tmp_path, machine, FIRMWARE, simulated=False)
    assert check.code == "filter_unproven"


def test_without_responses_a_test_that_does_not_fit_asks_for_them_and_blames_nobody(tmp_path: Path) -> None:
    """The tool has twice the mass that its profile says: that is no other reading."""
    tested, loop = filter_test(FIRST, FIRST, simulated=False), bending(FIRST)
    heavy = replace(loop, plant=replace(loop.plant, acceleration_per_v=0.5 * loop.plant.acceleration_per_v))
    moved = model_step(heavy, floats(tested.reference_um))
    store_test(tmp_path, replace(tested, position_um=tuple(moved.tolist())))
    (told,) = stated_filter_problems(stating(FIRST), tmp_path, simulated=False)
    assert told.code == "trial.filter_axis" and "console identify --frequencies 25" in str(told)


@pytest.mark.parametrize("turned", [("I136", "I137"), ("I138", "I139")])
def test_responses_with_the_filter_do_not_prove_it(tmp_path: Path, turned: tuple[str, ...]) -> None:
    """An axis can be fitted to them that explains the test by the stated reading: the denominator's to 4 %."""
    misread = {name: -value if name in turned else value for name, value in FIRST.items()}
    filtered = identified(swept(bending(misread), 0.0005), FIRST, simulated=False)
    store_response(tmp_path, replace(filtered, date="2025-12-31T10:00:00.000Z"))
    store_test(tmp_path, filter_test(FIRST, misread, simulated=False))
    assert codes(tmp_path, stating(FIRST)) == ["trial.filter_axis"]
    assert known_loop(stating(FIRST), tmp_path, simulated=False).reading is None
    fill(tmp_path)
    assert "trial.read_otherwise" in codes(tmp_path, stating(FIRST)), "by the axis without the filter"


def test_responses_of_two_axes_name_both_ways_out_and_both_lead_out(tmp_path: Path) -> None:
    """Something of the tool was changed since the first sweeps: more responses beside those would not help."""
    machine = stating(FIRST)
    before = replace(bending().plant, acceleration_per_v=0.5 * bending().plant.acceleration_per_v)
    older = identified(swept(replace(bending(), plant=before), 0.0002), PUBLISHED, simulated=False)
    old = store_response(tmp_path, replace(older, date="2025-12-01T10:00:00.000Z"))
    fill(tmp_path)
    store_test(tmp_path, filter_test(FIRST, FIRST, simulated=False))
    (told,) = stated_filter_problems(machine, tmp_path, simulated=False)
    assert told.code == "trial.filter_misfit"
    for language in ("en", "ko"):
        said = load(language).problem(told)
        assert all(way in said for way in (str(old.parent), "console controller apply", "console tune show"))
    assert codes(tmp_path, LATHE) == [], "a profile without the filter"
    old.unlink()
    assert codes(tmp_path, machine) == [], "the responses of the axis as it is now"


def console_at(data: Path, reading: SignConvention) -> WithStation:
    """A console at a lathe that bends, whose profile states a filter and whose controller has it."""
    file = data / "bends.toml"
    file.write_text(f'schema = 1\nflexible_fraction = 0.4\nnotch_reading = "{reading}"\n', encoding="utf-8")
    machine = stating(FIRST)
    sim = SimulatedLathe(machine, plant_named(str(file), machine, seed=1))
    return station_of(sim, data, loaded=replace(load_machine(MACHINE), machine=machine))


@pytest.mark.parametrize("reading", [SignConvention.STATED, SignConvention.NUMERATOR])
def test_no_cut_is_armed_before_the_filter_was_tested_in_air(tmp_path: Path, reading: SignConvention) -> None:
    fill(tmp_path)
    owner, order = console_at(tmp_path, reading), Arm(job=JOB, job_sha256="0" * 64, strategy=Strategy.PVT)
    state = owner.do(Verify())
    assert [each.code for each in state.uncommissioned] == ["trial.filter_untested"]
    owner.do(order)
    assert owner.refusals == ["trial.filter_untested"]
    owner.do(EnableDrives(), Home(), CheckHealth(step_um=25.0))
    assert owner.refusals == []
    owner.do(order)
    if reading is SignConvention.STATED:
        assert not [code for code in owner.refusals if code.startswith("trial.")], "what is left is the alignment"
    else:
        assert "trial.read_otherwise" in owner.refusals
    left = [each.code for each in owner.do(Verify()).uncommissioned]
    assert left == ([] if reading is SignConvention.STATED else ["trial.read_otherwise"])


def test_the_command_that_cuts_asks_the_same_of_the_firmware_that_it_reads(tmp_path: Path) -> None:
    fill(tmp_path)
    owner = console_at(tmp_path, SignConvention.STATED)
    machine = owner.context.loaded_machine.machine
    heartbeat = Heartbeat(owner.client, owner.sim, machine)
    defined = machine.controller.axis_definitions
    commissioned = CommissioningGate(owner.client, heartbeat, machine, tmp_path, lambda: defined, simulated=False)
    commissioned.take_fingerprint()

    def refused() -> bool:
        found = commissioned.filter_doubts()
        return "trial.filter_untested" in [each.code for each in found]

    assert refused()
    version, kind = owner.client.connect()
    tested = filter_test(FIRST, FIRST, simulated=False)
    store_test(tmp_path, tested)
    assert refused(), "the test was made on another controller"
    store_test(tmp_path, replace(tested, origin=replace(tested.origin, version=version, kind=kind)))
    assert not refused()


@pytest.mark.parametrize("language", ["en", "ko"])
def test_simulated_is_like_another(console: Console, data_folder: Path, tmp_path: Path, language: str) -> None:
    own = tmp_path / "filtered.toml"
    write_machine(own)
    said = console("run", "lee-2001-experiment-1", "--machine", str(own), "--sim", "--lang", language)
    assert said.code == 1 and "console health" in said.err


@pytest.mark.long
def test_on_a_simulated_one_the_test_is_made_with_sim(console: Console, data_folder: Path, tmp_path: Path) -> None:
    own = tmp_path / "filtered.toml"
    write_machine(own)
    assert console("health", "--machine", str(own), "--sim", "--yes").code == 0
    said = console("run", "lee-2001-experiment-1", "--machine", str(own), "--sim")
    assert said.code == 0, said.err


def write_machine(file: Path) -> None:
    """Write the bundled machine with a filter, and the gains behind it that it had at rest."""
    loaded = load_machine(MACHINE)
    text = Path(loaded.path).read_text(encoding="utf-8")
    notch = Notch(n1=FIRST["I136"], n2=FIRST["I137"], d1=FIRST["I138"], d2=FIRST["I139"])
    at_rest = replace(gains_from_variables(LATHE).scale_gains(1.0 / notch.at_rest), notch=notch)
    values = {**variables_from_gains(LATHE, at_rest), **notch_settings(LATHE, notch)}
    for name, value in values.items():
        text, count = re.subn(rf"(?m)^{name} = \S+", f"{name} = {value}", text)
        if not count:
            text = text.replace("[controller.variables]\n", f"[controller.variables]\n{name} = {value}\n")
    keys = dict(zip(("notch_n1", "notch_n2", "notch_d1", "notch_d2"), notch.coefficients, strict=True))
    added = "".join(f"{key} = {value}\n" for key, value in keys.items())
    file.write_text(text.replace("[tool]\n", f"[tool]\n{added}"), encoding="utf-8")


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_trip_with_a_filter_names_its_reading_too(language: str, tmp_path: Path) -> None:
    owner = console_at(tmp_path, SignConvention.STATED)
    tripped = Problem(code="machine.fault", key="poll", value="tool: fatal_following_error")
    told = with_cause(owner.lathe, (tripped,))
    assert [each.code for each in told] == ["machine.fault", "trial.filter_suspected"]
    assert "I136 -1.09375" in load(language).problem(told[1])
    owner.lathe.machine = LATHE
    assert with_cause(owner.lathe, (tripped,)) == (tripped,), "without a filter nothing is said of it"


@pytest.mark.parametrize(("machine", "filtered"), [(stating(FIRST), True), (LATHE, False)])
def test_a_measurement_that_trips_names_it_too(tmp_path: Path, machine: MachineProfile, filtered: bool) -> None:
    """`console health` and `console identify` move the tool with the same filter."""
    owner = console_at(tmp_path, SignConvention.STATED)
    owner.lathe.machine = machine
    rig = Rig(client=owner.client, lathe=owner.lathe, clock=owner.sim)
    tripped = Problem(code="machine.fault", key="poll", value="tool: fatal_following_error")

    def trips(_: Rig, origin: ResponseOrigin) -> None:
        raise ProblemError(tripped)

    with pytest.raises(ProblemError) as told:
        with_origin(rig, MachineControl(rig.lathe, "", tmp_path), True, tmp_path, lambda _: None, trips)
    suspected = ["trial.filter_suspected"] if filtered else []
    assert [each.code for each in told.value.problems] == ["machine.fault", *suspected]
    assert isinstance(told.value, SessionError) is filtered
