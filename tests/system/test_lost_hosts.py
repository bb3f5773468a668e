"""Hosts that are lost in motion, as processes: killed, stopped for a while, cut off. The card ends what moves.

Times are those of the card. What is measured is seen by another host, over a socket of its own.
"""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

import pytest

from console.session.data.run_reader import runs, story
from console.session.feed.feed_state import FeedState
from console.session.feed.following import Stream
from console.session.feed.place import connect_feed, feeds
from console.session.feed.request import LEAST_HZ
from console.session.station.machine_control import take_lock
from drivers.lathe.console_role import NOBODY
from drivers.lathe.ownership import OWNER_ITEM
from drivers.pmac.client import PmacClient
from drivers.pmac.heartbeat.watch import LOOK_EVERY_S, MotorPoll, MotorWatch, rest_s, rests
from drivers.pmac.heartbeat.watchdog import GuardedActivity
from drivers.pmac.language.syntax import VariableKind
from drivers.pmac.programs.setup import CutSetup, cut_setup
from drivers.pmac.reserved import OWNER
from drivers.simulator.machine import SimulatedLathe
from tests.system.patient_card import PatientCard, patient_card
from tests.system.run_over_link import Order, order

pytestmark = [pytest.mark.system, pytest.mark.long]

TOOL, SPINDLE, CARRIAGE = 1, 2, 3
CUT_MM = 4.0
"""80 turns, of which the console is lost in the first: nothing ends by itself before it is measured."""

LEASE_S = 0.3
REST_S = 2.0
CLOSE_COUNTS = 500.0
"""0.1 mm: so near to where it is out the card takes the tool for arrived."""

JOG_S = {5.0: 0.3, 100.0: 0.38}
"""Background cycle, ms: when at the latest a jog is ended, s behind the last lease."""

SLOW_MS = 100.0
ENDS_WITHIN_S = 30.0


@dataclass(frozen=True, kw_only=True)
class Site:
    """A card, what is cut on it, and the console that cuts."""

    card: PatientCard
    order: Order
    process: subprocess.Popen[str]

    def until_in_the_part(self) -> None:
        """Let time run until the tool is in the part, and the carriage has gone on."""
        lathe, surface, face = self.card.lathe, setup_of(self).surface, face_counts(self)
        tool, carriage = lathe.controller.motors[TOOL], lathe.controller.motors[CARRIAGE]
        self.card.until(lambda: tool.position > surface and carriage.position > face + 300.0)
        assert lathe.controller.systems[1].running

    def until_in_a_jog(self) -> None:
        """Let time run until the carriage is on its way to the part, at full speed."""
        carriage = self.card.lathe.controller.motors[CARRIAGE]
        self.card.until(lambda: carriage.home_complete and carriage.jogging and carriage.position > 3000.0)

    def killed(self) -> None:
        self.process.kill()
        self.process.wait(ENDS_WITHIN_S)

    def ended(self) -> tuple[int, str]:
        """Wait until the console has ended by itself; return its exit code, and what it told."""
        _, err = self.process.communicate(timeout=ENDS_WITHIN_S)
        return self.process.returncode, err


@pytest.fixture(scope="module")
def long_cut(tmp_path_factory: pytest.TempPathFactory) -> Order:
    return order(tmp_path_factory.mktemp("order"), CUT_MM)


@pytest.fixture
def site(long_cut: Order) -> Iterator[Site]:
    with patient_card(SimulatedLathe(long_cut.machine)) as card:
        long_cut.prove_stops(card.console)
        with long_cut.running(card.console) as process:
            yield Site(card=card, order=long_cut, process=process)


@contextmanager
def watching(site: Site) -> Iterator[tuple[PmacClient, MotorWatch]]:
    with site.card.watcher() as client:
        yield client, MotorWatch(client, site.card.server, client.dialect, (TOOL, SPINDLE, CARRIAGE))


def feed_of(site: Site) -> Stream:
    (path,) = feeds(site.order.data)
    return Stream(path, connect_feed(path, ENDS_WITHIN_S), LEAST_HZ, lambda _: None)


def last_state(stream: Stream) -> FeedState:
    """Read a feed to the end of its console; return the last state."""
    states: list[FeedState] = []
    with suppress(ConnectionError):
        while True:
            states += stream.take()
    stream.close()
    return states[-1]


def last_lease_s(site: Site) -> float:
    """When the console has sent its last lease."""
    return max(at_s for at_s, data in site.card.words.said if b"M70=" in data)


def until_rest(site: Site, watch: MotorWatch, limit_s: float = 5.0) -> list[MotorPoll]:
    """Look on until everything rests and the card is about to do nothing more."""
    looks = [watch.look()]
    while not rests(looks) or looks[-1].ending:
        assert looks[-1].answered_s < looks[0].asked_s + limit_s, "it does not come to rest"
        site.card.server.wait(LOOK_EVERY_S)
        looks.append(watch.look())
    return looks


def setup_of(site: Site) -> CutSetup:
    return cut_setup(site.order.job, site.order.machine)


def is_out(site: Site, look: MotorPoll) -> bool:
    return look.positions[TOOL] < setup_of(site).surface


def stays_out(site: Site, looks: list[MotorPoll]) -> float:
    """Return from when on the tool is out of the part."""
    assert is_out(site, looks[-1]), "the tool stands in the part"
    return next(look.answered_s for n, look in enumerate(looks) if all(is_out(site, later) for later in looks[n:]))


def is_retracted_and_rests(site: Site, client: PmacClient, watch: MotorWatch) -> None:
    lease_s = last_lease_s(site)
    looks = until_rest(site, watch)
    rested_s = rest_s(looks)
    assert rested_s is not None
    assert stays_out(site, looks) - lease_s <= REST_S
    assert rested_s - lease_s <= REST_S
    assert looks[-1].lost and not looks[-1].running
    assert looks[-1].positions[TOOL] < setup_of(site).retracted + CLOSE_COUNTS
    assert client.numbers("P1003", "P1004") == (GuardedActivity.NOTHING, GuardedActivity.CUT)


@pytest.mark.parametrize("cycle_ms", [None, SLOW_MS])
def test_a_console_that_is_killed_in_a_cut_leaves_the_tool_out_and_all_at_rest(
    site: Site, cycle_ms: float | None
) -> None:
    site.until_in_the_part()
    if cycle_ms is not None:
        site.card.slow_background(cycle_ms)
    site.killed()
    with watching(site) as (client, watch):
        is_retracted_and_rests(site, client, watch)
        (number,) = client.numbers(OWNER_ITEM)
    lock = take_lock(site.order.data, site.card.console)
    assert lock is not None, "a dead console holds no lock"
    assert lock.last_number == number > 0, "the next console of this computer may take its place"
    lock.close()


def test_a_console_that_was_stopped_for_a_while_renews_nothing_and_tells(site: Site) -> None:
    site.until_in_the_part()
    stream = feed_of(site)
    os.kill(site.process.pid, signal.SIGSTOP)
    _, status = os.waitpid(site.process.pid, os.WUNTRACED)
    assert os.WIFSTOPPED(status)
    silent_s = time.monotonic()
    with watching(site) as (client, watch):
        is_retracted_and_rests(site, client, watch)
        while time.monotonic() - silent_s < 2.0 * LEASE_S:  # its own clock has to go on, too
            site.card.server.wait(LOOK_EVERY_S)
            watch.look()
        said = len(site.card.words.said)
    site.card.run_on()
    os.kill(site.process.pid, signal.SIGCONT)
    code, err = site.ended()
    after = b"".join(data for _, data in site.card.words.said[said:])
    assert code == 1
    assert "did not hear from this console in time" in err
    assert [alarm.code for alarm in last_state(stream).alarms] == ["heartbeat.lapsed"]
    newest = runs(site.order.data)[0]
    assert [alarm.problem.code for alarm in story(site.order.data, newest.run_id).alarms] == ["heartbeat.lapsed"]
    # A line may have been under way when it was stopped: a lease that comes late starts nothing.
    assert after.count(b"M70=") <= after.startswith(b"M70=") and b"R\r" not in after
    is_left_off(site)


def test_a_console_whose_cable_is_cut_in_a_cut_ends_by_itself_and_so_does_the_cut(site: Site) -> None:
    site.until_in_the_part()
    began_s = site.card.server.now_s()
    site.card.cut_cable(for_s=0.2)
    site.card.server.wait(0.25)
    code, err = site.ended()
    assert code == 1
    assert "the link is lost" in err and "standstill is not confirmed" in err
    with watching(site) as (client, watch):
        looks = until_rest(site, watch)
        assert client.numbers("P1003", "P1004") == (GuardedActivity.NOTHING, GuardedActivity.CUT)
        rested_s = rest_s(looks)
    assert rested_s is not None and rested_s - began_s <= REST_S
    assert is_out(site, looks[-1])


@pytest.mark.parametrize("cycle_ms", JOG_S)
def test_a_jog_whose_console_is_killed_ends_within_a_lease(site: Site, cycle_ms: float) -> None:
    site.until_in_a_jog()
    server, carriage = site.card.server, site.card.lathe.controller.motors[CARRIAGE]
    if cycle_ms == SLOW_MS:
        site.card.slow_background(cycle_ms)
    site.killed()
    full = carriage.velocity
    assert full == pytest.approx(10.0)  # counts/ms: 10 mm/s
    lease_s = last_lease_s(site)
    ended_s = passes_until(site, lambda: carriage.velocity < 0.999 * full)
    assert ended_s - lease_s <= JOG_S[cycle_ms]
    with watching(site) as (client, watch):
        looks = until_rest(site, watch)
        assert client.numbers("P1003", "P1004") == (GuardedActivity.NOTHING, GuardedActivity.JOG)
        assert looks[-1].positions[CARRIAGE] < face_counts(site) - 1000.0
    assert server.now_s() - lease_s < REST_S


def passes_until(site: Site, seen: Callable[[], bool], limit_s: float = 1.0) -> float:
    """Let time pass until something is so; return when. In the card itself: a slow one answers late."""
    end_s = site.card.server.now_s() + limit_s
    while not seen():
        assert site.card.server.now_s() < end_s
        site.card.server.wait(0.001)
    return site.card.server.now_s()


def face_counts(site: Site) -> float:
    """Where the carriage has the tool over the face of the part."""
    job, carriage = site.order.job, site.order.machine.carriage
    return (carriage.jaw_face_mm - job.overhang_mm) * carriage.counts_per_mm


def is_left_off(site: Site) -> None:
    """Drives off, nobody's, nothing moves, by what the card says itself."""
    card = site.card.lathe.controller
    assert not any(motor.amplifier_enabled for motor in card.motors.values())
    assert not card.systems[1].running
    assert int(card.variables.get(VariableKind.P, OWNER)) == NOBODY
