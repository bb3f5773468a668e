"""A machine that is being stopped: what is said each second, what is sent meanwhile, and when the process ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import pytest

from console.cli.machine.stopping import END_WITHIN_S, TICK_S, Stopping
from console.screens import start
from console.session.signals import LEAVE_WITHIN_S, Interruption
from console.session.station.link_thread import LinkThread
from console.session.station.reaching import guard, leave
from console.text.catalogue import LANGUAGES, load
from drivers.errors import DriverError
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.standstill import COAST_TIMEOUT_S
from drivers.lathe.stop import StopPath
from drivers.link.base import StopWay
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.store import load_machine
from tests.console.consoles import MACHINE, OneConsole, console_of
from tests.console.floor import open_floor
from tests.console.test_link_thread import SOON_S, opened, wait_until


class _Line:
    """A link that keeps when stops went out."""

    address = "tcp:lathe:1025"
    stop_way = StopWay.DIRECT

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self.at_s: list[float] = []

    def send_urgent(self, _: bytes) -> None:
        self.at_s.append(self._now_s())


@dataclass
class Scene:
    """One stop path with somebody who watches it, in a time of its own."""

    text: str = "en"
    now_s: float = 100.0
    said: list[tuple[float, str]] = field(default_factory=list)
    codes: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.line = _Line(lambda: self.now_s)
        self.stop = StopPath(cast("Any", self.line))
        self.interruption = Interruption()
        self.interruption.guard(self.stop)
        self.stopping = Stopping(
            self.interruption,
            load(self.text),
            now_s=lambda: self.now_s,
            say=lambda line: self.said.append((self.now_s, line)),
            give_up=self.codes.append,
        )

    def passes(self, seconds: float, meanwhile: Callable[[], object] = lambda: None) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            meanwhile()
            self.stopping.tick(self.stop)


ANSWER = cast("Snapshot", None)


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_nothing_is_said_or_sent_while_nothing_is_stopped(scene: Scene) -> None:
    scene.passes(5.0)
    assert (scene.said, scene.line.at_s, scene.codes) == ([], [], [])


@pytest.mark.parametrize("language", LANGUAGES)
def test_of_a_silent_controller_it_is_said_at_once_and_each_second_what_was_tried(language: str) -> None:
    scene = Scene(language)
    scene.stop.stop("link.silent")
    began_s = scene.now_s
    scene.passes(5.05)
    times = [at_s - began_s for at_s, _ in scene.said]
    assert times == pytest.approx([0.1, 1.1, 2.1, 3.1, 4.1], abs=0.11)
    counts = [sum(at_s <= told_s for at_s in scene.line.at_s) for told_s, _ in scene.said]
    for (_, line), count in zip(scene.said[1:], counts[1:], strict=True):
        assert f"control-K {'sent ' if language == 'en' else ''}{count} " in line
    assert "stopping." not in " ".join(line for _, line in scene.said)
    scene.passes(55.0)
    assert len(scene.said) <= 12, "a minute without an answer is told in a dozen lines"
    scene.stop.rest_proven(scene.stop.mark or 0)
    scene.passes(1.0)
    last = scene.said[-1][1]
    assert last.startswith(("59 s", "60 s")) and ("at rest" in last or "멈췄습니다" in last), last
    gaps = [b - a for a, b in zip(scene.line.at_s[1:], scene.line.at_s[2:], strict=False)]
    assert max(gaps) <= 0.31, "the stop goes out again while the one who asks waits"


def test_looks_that_come_prove_rest_and_are_not_disturbed(scene: Scene) -> None:
    scene.stop.stop("SIGINT")
    scene.passes(3.0, lambda: scene.stopping.seen(ANSWER))
    assert len(scene.line.at_s) == 1
    assert "the controller answers" in scene.said[-1][1]
    scene.stop.rest_proven(1)
    said = len(scene.said)
    scene.passes(3.0)
    assert (len(scene.said), len(scene.line.at_s), scene.codes) == (said + 1, 1, [])
    assert scene.said[-1][1].endswith("the machine is at rest")


def test_a_signal_that_does_not_wait_ends_the_process_in_time_with_the_truth(scene: Scene) -> None:
    scene.interruption.end("SIGTERM")
    assert scene.interruption.hurried_s is not None
    scene.interruption.hurried_s = scene.now_s
    scene.passes(END_WITHIN_S - 0.2)
    assert scene.codes == []
    scene.passes(0.5)
    assert scene.codes[0] == 1
    assert "SIGTERM" in scene.said[-1][1] and "emergency stop" in scene.said[-1][1]
    assert scene.now_s - scene.line.at_s[-1] < 0.5
    assert END_WITHIN_S < 10.0


def test_ctrl_c_waits_for_rest_and_the_second_one_does_not(scene: Scene) -> None:
    hurried = []
    for _ in range(2):
        scene.interruption.end("SIGINT")
        hurried.append(scene.interruption.hurried_s is not None)
    assert hurried == [False, True]
    assert len(scene.line.at_s) == 2


@pytest.fixture(scope="module")
def machine() -> MachineProfile:
    return load_machine(MACHINE).machine


@pytest.fixture
def silent(machine: MachineProfile, tmp_path: Path) -> OneConsole:
    """A console that has moved the machine, whose controller has fallen silent."""
    console = console_of(SimulatedLathe(machine), machine, tmp_path, locking=False)
    console.owning.claim()
    console.lathe.verify()
    console.lathe.enable()
    console.sim.faults.inject("hang")
    return console


def test_rest_is_waited_for_once(silent: OneConsole) -> None:
    began_s = silent.sim.now_s()
    silent.stop.stop("link.silent")
    with pytest.raises(DriverError):
        silent.lathe.wait_for_rest()
    assert not leave(silent.lathe, silent.owning)
    assert silent.sim.now_s() - began_s < COAST_TIMEOUT_S + 5.0
    assert silent.hear().endswith(b"\x0b"), "and the last word is a stop"


@pytest.mark.parametrize("waited_s", [0.0, 20.0])
def test_who_has_to_end_waits_no_longer_than_there_is_time(silent: OneConsole, waited_s: float) -> None:
    interruption = Interruption()
    guard(interruption, silent.lathe, silent.sim.now_s)
    silent.stop.stop("link.silent")
    came: list[float] = []
    send_urgent = silent.client.link.send_urgent

    def stops(data: bytes) -> None:
        send_urgent(data)
        if not came and silent.sim.now_s() >= began_s + waited_s:
            came.append(silent.sim.now_s())
            interruption.end("SIGTERM")

    began_s = silent.sim.now_s()
    silent.client.link.send_urgent = stops  # type: ignore[method-assign]
    with pytest.raises(DriverError) as unproven:
        silent.lathe.wait_for_rest()
    assert unproven.value.problems[0].code == "machine.rest_unknown"
    assert not leave(silent.lathe, silent.owning)
    assert silent.sim.now_s() - came[0] < LEAVE_WITHIN_S + 1.0


def test_a_machine_that_answers_again_is_proven_at_rest_after_all(silent: OneConsole) -> None:
    silent.stop.stop("link.silent")
    with pytest.raises(DriverError):
        silent.lathe.wait_for_rest()
    silent.sim.faults.clear()
    assert silent.lathe.wait_for_rest().loops_open
    assert not silent.stop.given_up
    assert leave(silent.lathe, silent.owning)
    assert silent.on_the_card == 0


def test_the_screens_of_a_silent_machine_end_in_time_behind_a_signal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [1000.0]

    class Never:
        rested = False

        def end(self, _: str) -> None: ...

        def join(self, timeout_s: float) -> bool:
            now[0] += timeout_s
            return False

    monkeypatch.setattr("console.screens.start.time.monotonic", lambda: now[0])
    ending = start._Ending(cast("Any", Never()), cast("Any", None))
    ending.reason, ending.came_s = "SIGTERM", 1000.0
    monkeypatch.setattr(ending, "ignore", lambda: None)
    start._leave(cast("Any", Never()), ending, load("en"))
    assert 5.0 < now[0] - 1000.0 < 10.0
    assert "press the emergency stop" in capsys.readouterr().err
    now[0], ending.came_s = 1000.0, float("inf")
    start._leave(cast("Any", Never()), ending, load("en"))
    assert now[0] - 1000.0 > COAST_TIMEOUT_S, "who quits in peace waits until a spindle has run out"


def test_a_signal_to_the_screens_hurries_the_proof_of_rest(tmp_path: Path) -> None:
    floor = open_floor(tmp_path)
    link = LinkThread("a lathe", True, lambda: opened(floor), give_up=lambda _: None, leave_s=0.0)
    link.start()
    link.open()
    wait_until(lambda: link.state.activity.value == "ready")
    link.end("SIGTERM", must_leave=True)
    assert link.join(SOON_S)
    assert floor.stop.leave_by_s < float("inf")
