"""`console run` on a machine behind a link: it cuts and leaves the machine off, or does not touch it."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from benchmarks.run_page import a_frame, moments_of_a_cut
from console.session.station.state import StationState
from drivers.clock import RealClock
from drivers.cutting.planning import CutPlan, Strategy, plan_cut
from drivers.errors import DriverError, RefusedError
from drivers.lathe.console_role import NOBODY
from drivers.lathe.ownership import OWNER_ITEM
from drivers.lathe.snapshot import AxisName, Snapshot
from drivers.lathe.stop import StoppedError
from drivers.link.address import TcpAddress
from drivers.link.opening import open_link
from drivers.pmac.client import PmacClient
from drivers.pmac.dialect import PMAC
from drivers.pmac.gathering.gather_client import DataGathering
from drivers.pmac.status import decode
from drivers.simulator.machine import SimulatedLathe
from profiles.store import load_job
from tests.system.lathe_sites import LINKS, MACHINES, Site, build, compact, opened
from tests.system.patient_card import patient_card
from tests.system.run_over_link import Order, order
from tests.terminal import Terminal

if TYPE_CHECKING:
    from tests.system.conftest import Serve, Served

pytestmark = [pytest.mark.system, pytest.mark.long]

TIMEOUT_S = 40.0
SHORT_MM = 0.5
"""10 turns."""


@pytest.fixture(scope="module")
def served(serve: Serve, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    made = order(tmp_path_factory.mktemp("served"), SHORT_MM)
    with serve("--tcp", "127.0.0.1:0", "--machine", str(made.machine_file)) as running:
        yield running


@pytest.fixture
def made(tmp_path: Path) -> Order:
    return order(tmp_path, SHORT_MM)


def link_to(served: Served) -> str:
    host, port = served.tcp
    return f"tcp:{host}:{port}"


def is_untouched(served: Served) -> None:
    """Drives off, every axis where it was switched on, and nobody's."""
    host, port = served.tcp
    client = PmacClient(open_link(TcpAddress(host=host, port=port)), RealClock())
    client.connect()
    assert client.numbers(OWNER_ITEM, "#1P", "#2P", "#3P") == (NOBODY, 0.0, 0.0, 0.0)
    for motor in client.query("#1?", "#2?", "#3?"):
        assert "amplifier_enabled" not in decode(motor, PMAC.motor_bits)
    client.link.close()


def console(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "console", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, stdin=subprocess.DEVNULL)


def test_a_part_is_cut_and_the_machine_is_left_off_and_nobodys(made: Order) -> None:
    with patient_card(SimulatedLathe(made.machine)) as card:
        made.prove_stops(card.console)
        with made.running(card.console) as process:
            out, err = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == 0, err
        said = json.loads(out)
        assert (said["simulated"], said["strategy"], said["collisions"]) == (False, "pvt", [])
        assert [said[key] for key in ("before", "after", "improvement_percent", "within_tolerance")] == [None] * 4
        assert said["telemetry_samples"] > 10
        motors = [card.lathe.controller.motors[number] for number in (1, 2, 3)]
        assert not any(motor.amplifier_enabled or motor.jogging for motor in motors)
        assert motors[2].position > 10_000.0, "the carriage has gone to the part"
        with card.watcher() as client:
            assert client.numbers(OWNER_ITEM, "P1003", "P1004") == (NOBODY, 0.0, 0.0)


def test_without_a_stop_record_nothing_is_moved(served: Served, made: Order) -> None:
    words = made.command(link_to(served), "--yes")[3:]
    done = console(*words)
    (cut_with,) = done.stdout.splitlines()
    assert (done.returncode, cut_with.partition(",")[0]) == (1, words[words.index("--strategy") + 1])
    assert "--prove" in done.stderr.splitlines()[-1]
    is_untouched(served)


def test_without_agreement_and_without_anybody_to_ask_nothing_is_moved(served: Served, made: Order) -> None:
    made.prove_stops(link_to(served))
    done = console(*made.command(link_to(served))[3:])
    assert (done.returncode, done.stdout) == (1, "")
    assert "--yes" in done.stderr.splitlines()[-1]
    is_untouched(served)


@pytest.mark.parametrize(("typed", "told"), [("lee-2001-lathe", "--prove"), ("yes", "name")])
def test_the_name_of_the_machine_is_what_agrees(served: Served, made: Order, typed: str, told: str) -> None:
    """Behind the name comes what else is missing, here the stop record; behind anything else, nothing."""
    with Terminal(made.command(link_to(served)), columns=160) as terminal:
        terminal.wait_for(r"lee-2001-lathe.*: ?$", TIMEOUT_S)
        terminal.type(f"{typed}\r")
        assert terminal.wait_exit(TIMEOUT_S) == 1
        assert told in " ".join(terminal.text.rstrip().splitlines()[-2:])  # the last message, which may be wrapped
    is_untouched(served)


def test_nobody_says_where_the_machine_is() -> None:
    with Terminal([sys.executable, "-m", "console", "--machine", "lee-2001-lathe"], columns=160) as terminal:
        assert terminal.wait_exit(TIMEOUT_S) == 1
        assert "no address is known for the controller of lee-2001-lathe: add --link ADDRESS" in terminal.text


@pytest.mark.parametrize("command", [(), ("run", "lee-2001-experiment-1")])
def test_a_simulated_machine_has_no_address(command: tuple[str, ...]) -> None:
    done = console(*command, "--sim", "--link", "tcp:127.0.0.1:1")
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert "choose one" in done.stderr


# The lathe does the same over memory, a serial line, TCP and Ethernet, with a card of either family.


JOB = replace(load_job("lee-2001-experiment-1").job, cut_length_mm=0.25)
STEP_COUNTS = 250.0
CLOSE_COUNTS = 5.0
"""1 um of tool, 0.2 deg of spindle, 5 um of carriage."""

TYPES = {"pmac": "PMAC1, X1", "turbo": "TURBO2, X4"}


@pytest.fixture(params=MACHINES)
def family(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=LINKS)
def site(request: pytest.FixtureRequest, family: str) -> Iterator[Site]:
    with opened(request.param, family) as site:
        yield site


def air_cut(site: Site) -> CutPlan:
    """Experiment 1 with 10 turns of feed, from where the spindle stands; nothing is clamped."""
    lathe, counts = site.lathe, site.machine.spindle.counts_per_rev
    turns = math.ceil(lathe.snapshot().spindle.position / counts)
    plan = plan_cut(JOB, site.machine, Strategy.PVT, from_turn=turns, watchdog=lathe.program.watchdog)
    lathe.program.load(plan.program, plan.axis_definitions)
    lathe.jog_to(AxisName.CARRIAGE, plan.carriage_start)
    lathe.jog_to(AxisName.SPINDLE, plan.spindle_start)
    lathe.jog_to(AxisName.TOOL, plan.tool_start)
    return plan


def refused(action: Callable[[], object]) -> str:
    with pytest.raises(DriverError) as error:
        action()
    return error.value.problems[0].code


def stopped_when(site: Site, condition: Callable[[Snapshot], bool]) -> Callable[[Snapshot], None]:
    """Stop, once, with the first look that is as told."""

    def see(snapshot: Snapshot) -> None:
        if condition(snapshot) and site.stop.reason is None:
            site.stop.stop("operator")

    return see


def comes_to_rest(site: Site) -> Snapshot:
    """The stop is obeyed and proven, nothing moves before it was acknowledged, and the drives are held."""
    rest = site.lathe.wait_for_rest()
    assert site.stop.proven
    assert rest.at_rest and not rest.program_running and rest.loops_closed
    with pytest.raises(StoppedError, match="operator"):
        site.lathe.jog_by(AxisName.TOOL, -STEP_COUNTS)
    site.stop.release()
    return rest


def gets_ready(site: Site, family: str) -> None:
    """The card is the one of the profile, set as it says; its drives are switched on and it is homed."""
    lathe = site.lathe
    _, kind = lathe.connect()
    assert kind == TYPES[family]
    assert refused(lathe.enable) == "owner.observer"
    lathe.claim()
    assert lathe.verify() == ()
    lathe.enable()
    assert not lathe.snapshot().homed
    lathe.home()
    assert lathe.snapshot().homed


def jogs_a_step_and_gathers_it(site: Site) -> None:
    """What the card has gathered of a step is the step: out by 250 counts, and nothing but that."""
    gathering = DataGathering(client=site.client, dialect=site.client.dialect)
    before = site.lathe.snapshot().tool.position
    plan = gathering.prepare(gathering.motor_channels("#1 actual"), 100, 15)
    gathering.start(plan)
    site.lathe.jog_by(AxisName.TOOL, STEP_COUNTS)
    assert site.lathe.snapshot().tool.position == pytest.approx(before + STEP_COUNTS, abs=CLOSE_COUNTS)
    gathering.stop()
    track = gathering.fetch(plan).values["#1 actual"]
    assert track[-1] - track[0] == pytest.approx(STEP_COUNTS, abs=CLOSE_COUNTS)
    assert np.diff(track).min() >= -CLOSE_COUNTS


def stops_in_a_jog(site: Site) -> None:
    start = site.lathe.snapshot().carriage.position
    site.seen.append(stopped_when(site, lambda look: look.carriage.position > start + 1000.0))
    with pytest.raises(StoppedError, match="operator"):
        site.lathe.jog_to(AxisName.CARRIAGE, start + 9000.0)
    site.seen.clear()
    assert start + 1000.0 < comes_to_rest(site).carriage.position < start + 4000.0


def is_out(site: Site, plan: CutPlan) -> bool:
    return abs(site.lathe.snapshot().tool.position - plan.setup.retracted) < CLOSE_COUNTS


def cuts(site: Site) -> float:
    """The program is on the card, does the whole cut and takes the tool out; return where the carriage ends."""
    lathe, plan = site.lathe, air_cut(site)
    number = plan.program.number
    assert len(site.client.question(f"LIST PROG{number}")) > 20
    deepest: list[float] = []
    lathe.program.start(number, plan.setup.retracted)
    last = lathe.program.follow(lambda look: deepest.append(look.tool.position), 2 * plan.duration_s)
    assert max(deepest) > plan.setup.surface
    assert last.at_rest and is_out(site, plan)
    assert last.carriage.position >= plan.carriage_start + plan.setup.carriage_counts - CLOSE_COUNTS
    return last.carriage.position


def holds_and_retracts(site: Site, full_way: float) -> None:
    """A cut that is held ends early, at the end of a turn, with the tool out."""
    lathe, plan = site.lathe, air_cut(site)
    held: list[Snapshot] = []

    def hold(look: Snapshot) -> None:
        if look.carriage.position > plan.carriage_start + 3 * plan.setup.carriage_per_turn and not held:
            held.append(look)
            lathe.program.end_after_turn()

    lathe.program.start(plan.program.number, plan.setup.retracted)
    last = lathe.program.follow(hold, 2 * plan.duration_s)
    assert last.at_rest and is_out(site, plan) and held
    assert last.carriage.position < full_way - 3 * plan.setup.carriage_per_turn


def stops_in_a_cut(site: Site) -> None:
    """The tool stays where the stop left it, in the part; it is taken out when somebody asks for that."""
    lathe, plan = site.lathe, air_cut(site)
    lathe.program.start(plan.program.number, plan.setup.retracted)
    watch = stopped_when(site, lambda look: look.carriage.position > plan.carriage_start + 100.0)
    with pytest.raises(StoppedError, match="operator"):
        lathe.program.follow(watch, 2 * plan.duration_s)
    assert comes_to_rest(site).tool.position > plan.setup.surface - 500.0
    lathe.retract(plan.setup.retracted)
    assert is_out(site, plan)


def is_killed_and_switched_off(site: Site) -> None:
    lathe = site.lathe
    site.stop.kill("operator")
    assert lathe.wait_for_rest().loops_open
    site.stop.release()
    assert refused(lambda: lathe.jog_by(AxisName.TOOL, -STEP_COUNTS)) == "machine.not_enabled"
    lathe.enable()
    lathe.switch_off()
    assert lathe.snapshot().loops_open
    assert refused(lathe.enable) == "machine.hands_in"
    lathe.confirm_nobody_inside()
    lathe.release()
    assert lathe.snapshot().owner == 0


def test_the_lathe_does_the_same_over_every_link(site: Site, family: str) -> None:
    gets_ready(site, family)
    jogs_a_step_and_gathers_it(site)
    stops_in_a_jog(site)
    holds_and_retracts(site, cuts(site))
    stops_in_a_cut(site)
    is_killed_and_switched_off(site)
    assert site.client.faults.total == 0


def test_a_card_of_the_other_family_is_refused(site: Site, family: str) -> None:
    other = compact(next(each for each in MACHINES if each != family))
    lathe = build(site.client.link, site.clock, other).lathe
    with pytest.raises(RefusedError) as error:
        lathe.connect()
    problem = error.value.problems[0]
    assert (problem.code, problem.value) == ("controller.family_differs", TYPES[family])
    assert not lathe.has_moved


# What a cut sends to the terminal ten times a second: little enough for a line over a slow network.


FRAMES = 15


@pytest.fixture(scope="module")
def cut() -> list[StationState]:
    return moments_of_a_cut(FRAMES)


@pytest.mark.parametrize(("columns", "rows", "most_bytes"), [(80, 24, 3000), (160, 48, 8000)])
def test_a_frame_of_a_cut_stays_within_its_bytes(
    cut: list[StationState], columns: int, rows: int, most_bytes: int
) -> None:
    frame = a_frame("console", cut, columns, rows)
    # Values, progress and plot move in every frame: next to nothing would mean that nothing was shown.
    assert 300 < frame.sent_bytes < most_bytes


def test_a_page_on_which_nothing_changes_sends_nothing(cut: list[StationState]) -> None:
    assert a_frame("console", cut[:1] * FRAMES, 80, 24).sent_bytes == 0
