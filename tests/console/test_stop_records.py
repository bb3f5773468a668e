"""The stop record on the disk, and what is said of a machine that is being stopped."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from datetime import date, timedelta
from pathlib import Path
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.cli.machine.stopping import END_WITHIN_S, TICK_S, StopMonitor
from console.screens import start
from console.session.data.stop_records import (
    load,
    record_path,
    simulated_record,
    stop_record_problems,
    store,
    with_checksum,
    withdraw,
)
from console.session.signals import LEAVE_WITHIN_S, Interruption
from console.session.station.link_thread import LinkThread
from console.session.station.machine_connection import guard, leave
from console.text.catalogue import LANGUAGES
from console.text.catalogue import load as load_words
from drivers.commissioning.stop_record import PriorMotion, StopEntry, StopMethod, StopRecord, needed_stops
from drivers.errors import DriverError
from drivers.lathe.snapshot import Snapshot
from drivers.lathe.standstill import COAST_TIMEOUT_S
from drivers.lathe.stop import StopPath
from drivers.link.base import StopWay
from drivers.pmac.dialect import PMAC
from drivers.simulator.machine import SimulatedLathe
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.store import load_machine
from profiles.words.sentences import Sentences, words_of
from tests.console.consoles import MACHINE as MACHINE_NAME
from tests.console.consoles import OneConsole, console_of
from tests.console.floor import open_floor
from tests.console.test_link_thread import SOON_S, opened, wait_until
from tests.drivers.commissioned import Commissioned, commissioned

TODAY = date(2026, 3, 1)
MACHINE = load_machine("lee-2001-lathe").machine


@pytest.fixture(scope="module")
def simulated() -> StopRecord:
    return simulated_record(MACHINE, PMAC, TODAY)


def said(card: Commissioned, data: Path | None, *, simulator: bool = False, now: date = TODAY) -> list[str]:
    found = stop_record_problems(card.client, card.machine, card.dialect, data, simulator, now)
    return [problem.code for problem in found]


def test_a_simulator_measures_its_own_at_once_and_is_not_armed_changed(simulated: StopRecord) -> None:
    assert {(e.way, e.origin, e.axis) for e in simulated.entries} == needed_stops(MACHINE)
    card = commissioned(MACHINE)
    assert said(card, None, simulator=True) == []
    card.tell("I115=20")
    assert said(card, None, simulator=True) == ["stops.other_settings"]
    endless = replace(MACHINE.controller, variables={**MACHINE.controller.variables, "I5": 0.0})
    endless_card = commissioned(replace(MACHINE, controller=endless))
    assert said(endless_card, None, simulator=True) == ["stops.incomplete"]


def test_a_machine_of_iron_needs_a_record_of_its_own(tmp_path: Path, simulated: StopRecord) -> None:
    card = commissioned(MACHINE)
    assert said(card, tmp_path) == ["stops.no_record"]
    assert said(card, None) == ["stops.no_record"]
    store(tmp_path, MACHINE, simulated)
    assert said(card, tmp_path) == []
    assert said(card, tmp_path, now=TODAY + timedelta(days=181)) == ["stops.expired"]
    store(tmp_path, MACHINE, replace(simulated, stop_way=StopWay.RESERVED))
    assert said(card, tmp_path) == ["stops.other_way"]
    store(tmp_path, MACHINE, simulated)
    card.tell("I235=100")
    assert said(card, tmp_path) == ["stops.other_settings"]
    withdraw(tmp_path, MACHINE)
    assert said(card, tmp_path) == ["stops.no_record"]
    withdraw(tmp_path, MACHINE)


def test_nothing_is_armed_while_the_connection_for_stops_is_lost(tmp_path: Path, simulated: StopRecord) -> None:
    card = commissioned(MACHINE)
    store(tmp_path, MACHINE, replace(simulated, stop_way=StopWay.RESERVED))
    for way, target in ((StopWay.LOST, ["stops.connection_lost"]), (StopWay.RESERVED, [])):
        card.link.stop_way = way
        assert said(card, tmp_path) == target


def test_what_is_stored_comes_back_from_a_file_in_the_folder(tmp_path: Path, simulated: StopRecord) -> None:
    assert load(tmp_path, MACHINE) is None
    assert store(tmp_path, MACHINE, simulated) == tmp_path / "stops" / "lee-2001-lathe.json"
    assert load(tmp_path, MACHINE) == simulated
    store(tmp_path, MACHINE, replace(simulated, measured_at=TODAY + timedelta(days=1)))
    loaded = load(tmp_path, MACHINE)
    assert loaded is not None and loaded.measured_at == date(2026, 3, 2)
    for name in ("../lathe", "a/b", "선반 2", "..", "x" * 40):
        machine: MachineProfile = replace(MACHINE, name=name)
        assert record_path(tmp_path, machine).resolve().parent == tmp_path / "stops"
    (tmp_path / "file").mkdir()
    (tmp_path / "file" / "stops").write_text("", encoding="ascii")
    with pytest.raises(ProfileError) as refusal:
        store(tmp_path / "file", MACHINE, simulated)
    assert refusal.value.problems[0].code == "file.not_writable"


def write(path: Path, values: dict[str, Any]) -> None:
    """Write a file whose checksum is right, whatever is in it."""
    values.pop("sha256", None)
    path.write_bytes(with_checksum(values))


def test_a_file_that_is_no_record_arms_nothing_though_its_checksum_is_right(
    tmp_path: Path, simulated: StopRecord
) -> None:
    path = store(tmp_path, MACHINE, simulated)
    content = path.read_bytes()
    digest = json.loads(content)["sha256"]
    assert hashlib.sha256(content.replace(digest.encode(), b"")).hexdigest() == digest
    card = commissioned(MACHINE)
    of_all: list[dict[str, object]] = [{}, {"stop_way": "by post"}, {"measured_at": "yesterday"}, {"address": 5}]
    of_all += [{"entries": [{"way": "abort"}]}, {"version": 1.17}, {"more": 1}]
    times: tuple[object, ...] = ("long", True, float("nan"), float("inf"), -0.1, 10**400)
    of_entry = [{"way": "shout"}, *({"time_s": time_s} for time_s in times)]
    for change, entry in (*((each, {}) for each in of_all), *(({}, each) for each in of_entry)):
        values = json.loads(content)
        if not change and not entry:
            values.clear()
        values.update(change)
        if entry:
            values["entries"][0].update(entry)
        write(path, values)
        assert said(card, tmp_path) == ["stops.unreadable"], (change, entry)
    values = json.loads(content)
    del values["stop_way"]
    write(path, values)
    assert said(card, tmp_path) == ["stops.unreadable"]
    write(path, values := json.loads(content))
    assert said(card, tmp_path) == []
    for numbers in values["entries"]:
        numbers["time_s"] = 0
    write(path, values)
    assert said(card, tmp_path) == ["stops.impossible"] * len(simulated.entries)


@given(st.data())
def test_one_flipped_digit_is_seen(
    tmp_path_factory: pytest.TempPathFactory, simulated: StopRecord, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("data")
    path = store(folder, MACHINE, simulated)
    text = path.read_text(encoding="utf-8")
    places = [found.start() for found in re.finditer(r"\d", text)]
    place = data.draw(st.sampled_from(places))
    digit = str((int(text[place]) + data.draw(st.integers(1, 9))) % 10)
    path.write_text(text[:place] + digit + text[place + 1 :], encoding="utf-8")
    with pytest.raises(ProfileError) as refusal:
        load(folder, MACHINE)
    assert refusal.value.problems[0].code.startswith("stops.")


@pytest.mark.parametrize("schema", [0, 2, 1.0, "1", None])
def test_a_record_of_another_version_is_told(tmp_path: Path, simulated: StopRecord, schema: object) -> None:
    path = store(tmp_path, MACHINE, simulated)
    values = json.loads(path.read_text(encoding="utf-8"))
    values["schema"] = schema
    del values["sha256"]
    path.write_text(json.dumps(values), encoding="utf-8")
    (problem,) = stop_problems(tmp_path)
    assert problem.code == "stops.unknown_schema"
    for language in ("en", "ko"):
        told = load_words(language).problem(problem)
        assert "console doctor --machine lee-2001-lathe --prove" in told, told


def stop_problems(data: Path) -> tuple[Problem, ...]:
    card = commissioned(MACHINE)
    return stop_record_problems(card.client, card.machine, card.dialect, data, False, TODAY)


def test_the_record_of_another_machine_or_link_arms_nothing(tmp_path: Path, simulated: StopRecord) -> None:
    sister = replace(MACHINE, name="its-sister")
    measured = store(tmp_path, sister, replace(simulated, machine=sister.name))
    measured.rename(record_path(tmp_path, MACHINE))
    (problem,) = stop_problems(tmp_path)
    assert (problem.code, problem.value, problem.limit) == ("stops.other_machine", "its-sister", MACHINE.name)
    store(tmp_path, MACHINE, replace(simulated, address="ethernet:10.0.0.7"))
    (problem,) = stop_problems(tmp_path)
    assert (problem.code, problem.value, problem.limit) == ("stops.other_address", "ethernet:10.0.0.7", "memory")


@given(content=st.binary(max_size=60))
def test_any_content_is_a_record_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    folder = tmp_path_factory.mktemp("data")
    path = record_path(folder, MACHINE)
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    with pytest.raises(ProfileError):
        load(folder, MACHINE)


def test_an_entry_has_the_unit_of_its_axis(simulated: StopRecord) -> None:
    for entry in simulated.entries:
        assert isinstance(entry, StopEntry)
        turned = entry.distance_deg is not None and entry.speed_rpm is not None
        moved = entry.distance_mm is not None and entry.speed_mm_per_s is not None
        assert (turned, moved) == ((True, False) if entry.axis == "spindle" else (False, True))
        if entry.axis == "spindle":
            assert entry.speed_rpm == pytest.approx(1000.0 if entry.origin is PriorMotion.CUT else 100.0, rel=1e-4)
    assert {e.way for e in simulated.entries} == set(StopMethod)


def test_a_file_that_was_cut_short_is_told_by_its_line(tmp_path: Path, simulated: StopRecord) -> None:
    path = store(tmp_path, MACHINE, simulated)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    line = whole[: len(whole) // 2].count(b"\n") + 1
    with pytest.raises(ProfileError) as caught:
        load(tmp_path, MACHINE)
    (problem,) = caught.value.problems
    assert problem.code == "stops.unreadable" and problem.value.endswith(f": {line}")
    korean = Sentences(words_of("ko")).problem(problem)
    assert f": {line}" in korean and "damaged" not in korean and "Expecting" not in korean


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
        self.stopping = StopMonitor(
            self.interruption,
            load_words(self.text),
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
    scene.passes(3.0, lambda: scene.stopping.note_reply(ANSWER))
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
    return load_machine(MACHINE_NAME).machine


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
    start._leave(cast("Any", Never()), ending, load_words("en"))
    assert 5.0 < now[0] - 1000.0 < 10.0
    assert "press the emergency stop" in capsys.readouterr().err
    now[0], ending.came_s = 1000.0, float("inf")
    start._leave(cast("Any", Never()), ending, load_words("en"))
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
