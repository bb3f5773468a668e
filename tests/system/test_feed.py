"""The socket of a feed: who may read it, who is dropped, and what is left when its console ends."""

from __future__ import annotations

import json
import os
import signal
import socket
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from console.__main__ import main
from console.cli.feed.next_step import step_words
from console.session.feed import server as server_module
from console.session.feed.feed_state import read_state
from console.session.feed.following import Follower
from console.session.feed.observed_state import RUN, ObservedState
from console.session.feed.place import claim_place, connect_feed, feeds
from console.session.feed.report import line_of
from console.session.feed.server import MOST_READERS, FeedServer
from console.session.station.state import Activity, StationState
from console.text.catalogue import load
from profiles.store import load_machine
from tests.fuzz.of_feed import sound_states
from tests.system.accounts import STRANGER, A, B, as_account, become, lathe_folder, needs_root
from tests.tui import align_stage, run_stage
from tests.tui.stage import experiment, lathe

pytestmark = [pytest.mark.system, pytest.mark.timeout(60)]

MACHINE = load_machine("lee-2001-lathe").machine
STATE = StationState(activity=Activity.READY, machine=MACHINE.name)
TIMEOUT_S = 20.0


class Console:
    """Is observed by its feed; counts how often."""

    def __init__(self) -> None:
        self.looks = 0

    def observed(self) -> ObservedState:
        self.looks += 1
        return ObservedState(state=STATE, machine=MACHINE, now_s=0.0, parts=self.looks)


@pytest.fixture
def console() -> Console:
    return Console()


@pytest.fixture
def data(tmp_path: Path, console: Console) -> Iterator[Path]:
    server = FeedServer(tmp_path, console.observed)
    server.launch()
    wait_for_feed(tmp_path)
    yield tmp_path
    server.close()
    assert os.listdir(tmp_path / "feed") == []
    assert server.problems == ()


def wait_for_feed(data: Path) -> Path:
    """Wait until one listens."""
    until_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until_s:
        for path in feeds(data):
            try:
                with connect_feed(path, TIMEOUT_S) as link:
                    lines(link, 1)
            except OSError:
                continue
            return path
        time.sleep(0.01)
    raise TimeoutError("no feed")


def joined(data: Path, line: bytes = b"") -> socket.socket:
    (path,) = feeds(data)
    link = connect_feed(path, TIMEOUT_S)
    if line:
        link.sendall(line)
    return link


def lines(link: socket.socket, count: int) -> list[dict[str, Any]]:
    with link.makefile("rb") as stream:
        return [json.loads(stream.readline()) for _ in range(count)]


def is_dropped(link: socket.socket) -> bool:
    """Whether the connection ends; what came before is thrown away."""
    try:
        while link.recv(65_536):
            pass
    except ConnectionError:
        pass
    return True


@pytest.mark.parametrize(("asked", "hz"), [(b"", 1.0), (b"rate 10\n", 10.0), (b"rate 2.5\r\n", 2.5)])
def test_lines_come_at_the_rate_that_was_asked_for(asked: bytes, hz: float, data: Path) -> None:
    with joined(data, asked) as link:
        lines(link, 1)
        began_s = time.monotonic()
        found = lines(link, 4 if hz > 1.0 else 2)
        took_s = time.monotonic() - began_s
    assert all((line["schema"], line["machine"]) == (1, MACHINE.name) for line in found)
    assert took_s >= 0.8 * len(found) / hz  # never more often than asked; a busy computer may be later


def test_a_rate_may_be_said_later(data: Path) -> None:
    with joined(data) as link:
        lines(link, 1)
        link.sendall(b"rate 10\n")
        began_s = time.monotonic()
        lines(link, 6)
        assert time.monotonic() - began_s < 4.0  # six at the least rate take longer than that


@pytest.mark.parametrize("sent", [b"rate 100\n", b"\xff\xfe\n", b"stop\n", b"GET / HTTP/1.1\r\n"])
def test_garbage_is_answered_and_dropped(sent: bytes, data: Path) -> None:
    with joined(data, sent) as link:
        (line,) = lines(link, 1)
        assert line == {"schema": 1, "refused": "rate HZ, 1 to 10"}
        assert is_dropped(link)


def test_a_line_without_an_end_is_dropped(data: Path) -> None:
    with joined(data) as link:
        with pytest.raises(ConnectionError):
            for _ in range(1000):
                link.sendall(b"x" * 10_000)
    with joined(data) as another:
        assert lines(another, 1)


def test_who_does_not_read_is_dropped_and_holds_up_nobody(data: Path) -> None:
    stalled = [joined(data, b"rate 10\n") for _ in range(10)]
    with joined(data, b"rate 10\n") as reader:
        began_s = time.monotonic()
        found = lines(reader, 90)
        assert time.monotonic() - began_s < 14.0  # 9 s at the rate; the stalled ones wait 5 s each
    assert len({line["parts"] for line in found}) == 90
    assert all(is_dropped(link) for link in stalled)  # else this would read for ever
    for link in stalled:
        link.close()


def test_who_comes_beyond_the_most_is_dropped_until_another_leaves(data: Path) -> None:
    with ExitStack() as held:
        for _ in range(MOST_READERS):
            lines(held.enter_context(joined(data)), 1)
        with joined(data) as further:
            assert is_dropped(further)
    until_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until_s:
        with suppress(ConnectionError), joined(data) as link:
            if link.recv(1):
                return
    raise AssertionError("nobody is let in any more")


def test_a_console_that_ends_drops_its_readers_without_a_word(
    tmp_path: Path, console: Console, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    server = FeedServer(tmp_path, console.observed)
    server.launch()
    wait_for_feed(tmp_path)
    with joined(tmp_path) as plain, joined(tmp_path, b"rate 10\n") as asked, joined(tmp_path, b"rate") as half:
        for link in (plain, asked, half):
            assert lines(link, 1)
        server.close()
        assert all(is_dropped(link) for link in (plain, asked, half))
    assert (caplog.records, capfd.readouterr().err) == ([], "")


def test_without_readers_nothing_is_observed(data: Path, console: Console) -> None:
    with joined(data, b"rate 10\n") as link:
        lines(link, 2)
    time.sleep(0.5)  # for the feed to notice; nothing is simulated here
    before = console.looks
    time.sleep(1.0)
    assert console.looks == before


def test_the_folder_may_have_any_path(tmp_path: Path, console: Console) -> None:
    deep = tmp_path / ("d" * 100) / ("e" * 100)
    server = FeedServer(deep, console.observed)
    server.launch()
    wait_for_feed(deep)
    assert followed(deep) == [MACHINE.name]
    server.close()
    assert os.listdir(deep / "feed") == []


def test_a_folder_that_cannot_have_a_feed_is_a_problem_and_no_fault(tmp_path: Path, console: Console) -> None:
    (tmp_path / "feed").write_text("in the way")
    server = FeedServer(tmp_path, console.observed)
    server.launch()
    until_s = time.monotonic() + TIMEOUT_S
    while not server.problems and time.monotonic() < until_s:
        time.sleep(0.01)
    server.close()
    assert [problem.code for problem in server.problems] == ["feed.not_served"]


def test_feeds_of_consoles_on_one_folder_stand_beside_each_other(data: Path) -> None:
    with ExitStack() as opened:
        claim_place(data, opened).listen()
        assert len(feeds(data)) == 2
    assert len(feeds(data)) == 1


def followed(data: Path, told: list[str] | None = None) -> list[str]:
    """Return the machines whose consoles publish, as `watch` finds them."""
    codes = [] if told is None else told
    follower = Follower(data, 10.0, lambda _: True, lambda problem: codes.append(problem.code))
    machines = [heard.state.machine for heard in follower.settle()]
    follower.close()
    return machines


def test_what_is_no_feed_is_told_and_is_no_console(tmp_path: Path) -> None:
    assert followed(tmp_path) == []
    told: list[str] = []
    with ExitStack() as opened:
        server = claim_place(tmp_path, opened)
        server.listen()
        assert (followed(tmp_path, told), told) == ([], ["feed.not_one"])


def publishing_as(account: int, folder: Path) -> int:
    """A process of another account that publishes until it is killed; return its number."""
    if pid := os.fork():
        return pid
    try:
        become(account, 0o077)
        FeedServer(folder, Console().observed).launch()
        signal.pause()
    finally:
        os._exit(1)


@needs_root
def test_the_feed_of_a_shared_folder_is_for_its_group() -> None:
    def reads() -> None:
        assert followed(folder) == [MACHINE.name]

    def is_kept_out() -> None:
        with pytest.raises(PermissionError):
            feeds(folder)

    def takes_over() -> None:
        (left,) = feeds(folder)
        with ExitStack() as opened:
            claim_place(folder, opened)
            assert left not in feeds(folder)

    with lathe_folder() as folder:
        pid = publishing_as(A, folder)
        try:
            path = wait_for_feed(folder)
            assert stat.S_IMODE(path.stat().st_mode) == 0o660
            assert stat.S_IMODE(path.parent.stat().st_mode) == 0o2770
            as_account(B, reads)
            as_account(STRANGER, is_kept_out)
        finally:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        as_account(B, takes_over)  # what the killed one has left


def test_the_feed_of_any_other_folder_is_its_owners(data: Path) -> None:
    (path,) = feeds(data)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700


# `console next`: the next step at a running console, in the operator's language, and why it cannot be done.


UNCLAMPED = replace(align_stage.VALID, clamping=None, drives_on=False)


class Screens:
    """Screens whose feed shows one moment."""

    def __init__(self) -> None:
        self.shown = ObservedState(state=StationState(), machine=lathe().machine, now_s=100.0)

    def show(self, state: StationState, program: str = "screens") -> None:
        named = replace(state, machine=MACHINE.name)
        self.shown = replace(self.shown, state=named, work=experiment(), program=program)


@pytest.fixture
def screens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Screens]:
    monkeypatch.setattr(server_module, "SHARED_S", 0.0)  # a line is of the moment that is shown
    shown = Screens()
    shown.show(run_stage.state())
    server = server_module.FeedServer(tmp_path, lambda: shown.shown)
    server.launch()
    wait_for_feed(tmp_path)
    yield shown
    server.close()


def said(capsys: pytest.CaptureFixture[str], data: Path, *more: str) -> str:
    assert main(["next", "--data", str(data), *more]) == 0
    return capsys.readouterr().out


def test_the_step_is_told_with_its_key_in_the_language_of_the_operator(
    screens: Screens, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for language, page in (("en", "Run"), ("ko", load("ko")("page.run"))):
        out = said(capsys, tmp_path, "--lang", language)
        assert out.count("\n") == 1 and "SIM" in out and f"{MACHINE.name}@" in out
        assert out.rstrip().endswith(f"{page}: {load(language)('run_page.next.arm')}")
    screens.show(align_stage.state(UNCLAMPED, snapshot=align_stage.look(align_stage.OFF)))
    assert "1314 N" in said(capsys, tmp_path, "--machine", MACHINE.name)


def test_what_is_against_the_step_is_below_it(
    screens: Screens, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    screens.show(align_stage.state(UNCLAMPED, snapshot=align_stage.look(align_stage.OFF)))
    step, *why = said(capsys, tmp_path).splitlines()
    assert "Enter" in step and any("drives" in each for each in why) and all(each[:4] == "  - " for each in why)
    told = json.loads(said(capsys, tmp_path, "--json"))
    assert (told["machine"], told["next"]["word"], told["next"]["key"]) == (
        MACHINE.name,
        "align.clamp",
        "align.take",
    )
    assert "alignment.no_clamping" in [each["code"] for each in told["next"]["why"]]


def test_a_run_asks_nobody_and_no_console_is_an_error(
    screens: Screens, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    screens.show(run_stage.cutting(), RUN)
    assert said(capsys, tmp_path).rstrip().endswith(load("en")("next.none"))
    assert main(["next", "--data", str(tmp_path), "--machine", "another"]) == main(
        ["watch", "--list", "--data", str(tmp_path), "--machine", "another"]
    )
    assert "another" in capsys.readouterr().err


def test_a_step_of_a_newer_console_is_told_by_its_word() -> None:
    values = {"word": "align.polish", "key": "align.polish", "left_s": None, "force_n": None, "radius_mm": None}
    table = json.loads(line_of(asdict(sound_states()[0])))
    for word in ("align.polish", "records.next", "x", "jog_page.{no}", "run.{left.__class__}"):
        table["next"] = {**values, "word": word, "why": []}
        state = read_state(json.dumps(table).encode())
        assert state.next is not None and step_words(state.next, state, load("en")) == word
