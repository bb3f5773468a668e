"""The terminal of these tests is one: keys go in, the screen comes out, windows close and lines stall."""

from __future__ import annotations

import os
import signal
import sys

import pytest

from docs import pictures
from tests.terminal import Terminal
from tests.terminal_screen import Emulation

pytestmark = pytest.mark.system

APP = """
import subprocess, sys
from textual.app import App
from textual.widgets import Label, Static

class Small(App):
    BINDINGS = [("f5", "tell('five')"), ("space", "tell('blank')"), ("q", "leave"), ("escape", "tell('back')")]
    CSS = "#colour { color: #ff0000; background: #0000ff; text-style: bold; width: 10; height: 1; }"

    def compose(self):
        yield Label("차축 정지 [b]END[/b]|", id="korean")
        yield Static("RED", id="colour")
        yield Label("-", id="told")
        yield Label("-", id="size")
        yield Label("-", id="child")

    def on_mount(self):
        child = subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"], start_new_session=True)
        self.query_one("#child").update(f"child {child.pid}.")

    def on_resize(self, event):
        self.query_one("#size").update(f"{event.size.width} by {event.size.height}")

    def on_key(self, event):
        self.query_one("#told").update(f"key {event.key}.")

    def action_tell(self, what):
        self.query_one("#told").update(f"action {what}.")

    def action_leave(self):
        self.exit(return_code=3, message="left by the key")

app = Small()
app.run()
sys.exit(app.return_code)
"""


def small_app(columns: int = 60, rows: int = 12) -> Terminal:
    return Terminal([sys.executable, "-c", APP], columns=columns, rows=rows)


def test_keys_arrive_under_their_names_and_the_screen_is_read_back_cell_by_cell() -> None:
    with small_app() as terminal:
        terminal.wait_for(r"child \d+\.")
        for key in ("up", "pagedown", "f1", "f12", "enter", "tab", "ctrl+t", "a"):
            terminal.press(key)
            terminal.wait_for(rf"^ *key {key.replace('+', '.')}\.")
        for key, told in (("space", "action blank"), ("escape", "action back"), ("f5", "action five")):
            terminal.press(key)
            terminal.wait_for(told)
        drawn = pictures.svg(terminal.cells())
        assert ">action five.</text>" in drawn and ">차축</text>" in drawn
        terminal.press("1", "2", "3")
        terminal.wait_for("key 3")
        terminal.type("가")
        terminal.wait_for("key 가")
        with pytest.raises(ValueError, match="pagedwn"):
            terminal.press("pagedwn")
        first, second, *_ = terminal.cells()
        assert terminal.row(0) == "차축 정지 END|"
        assert [cell.text for cell in first[:14]] == [*"차", "", "축", "", " ", "정", "", "지", "", *" END|"]
        assert [cell.bold for cell in first[9:14]] == [False, True, True, True, False]
        assert (second[0].text, second[0].foreground, second[0].background) == ("R", "#ff0000", "#0000ff")
        assert second[0].bold
        assert second[9].background == "#0000ff" != second[10].background
        terminal.press("q")
        assert terminal.wait_exit() == 3
        assert terminal.text.strip() == "left by the key", "the screen before it is back"
        with pytest.raises(AssertionError, match="the program ended, not on the screen: END"):
            terminal.wait_for("END")


def test_the_program_sees_each_size_a_stalled_line_brings_nothing_and_a_failed_wait_shows_the_screen() -> None:
    with small_app(columns=60, rows=12) as terminal:
        terminal.wait_for("60 by 12")
        terminal.resize(91, 30)
        terminal.wait_for("91 by 30")
        assert (len(terminal.cells()), len(terminal.cells()[0])) == (30, 91)
        terminal.resize(40, 9)
        terminal.wait_for(lambda text: "40 by 9" in text and text.startswith("차축 정지 END|"))
        assert len(terminal.text.split("\n")) == 9
        terminal.press("a")
        terminal.wait_for("key a")
        terminal.stall()
        seen = terminal.bytes_seen
        terminal.press("b")
        with pytest.raises(AssertionError, match="not on the screen") as failed:
            terminal.wait_for("key b", timeout_s=0.3)
        assert "0.3 s are over" in str(failed.value) and "차축 정지 END|" in str(failed.value)
        assert terminal.bytes_seen == seen
        terminal.resume()
        terminal.wait_for("key b")
        assert terminal.bytes_seen > seen


def test_a_closed_window_ends_a_program_that_does_not_care() -> None:
    with small_app() as terminal:
        terminal.wait_for("END")
        terminal.hang_up()
        assert terminal.wait_exit() == -signal.SIGHUP
        with pytest.raises(AssertionError, match="closed"):
            terminal.press("a")


def test_a_signal_reaches_the_program_and_what_it_started_stays_known_and_does_not_outlive_the_terminal() -> None:
    with small_app() as terminal:
        terminal.wait_for(r"child \d+\.")
        (child,) = terminal.children()
        assert f"child {child}." in terminal.text
        terminal.signal(signal.SIGTERM)
        assert terminal.wait_exit() == -signal.SIGTERM
        assert terminal.children() == [child]
        os.kill(child, signal.SIGTERM)
        terminal.wait_alone()
        assert terminal.children() == []
    with small_app() as terminal:
        terminal.wait_for(r"child \d+\.")
        (child,) = terminal.children()
    assert terminal.children() == []
    with pytest.raises(ProcessLookupError):
        os.kill(terminal.pid, 0)
    assert not is_alive(child)


def is_alive(pid: int) -> bool:
    """Whether a process still does something; a dead one may wait for whoever inherited it."""
    try:
        with open(f"/proc/{pid}/stat") as stat:
            return stat.read().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_the_environment_is_that_of_a_plain_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TEXTUAL_ANIMATIONS", "none")
    show = (
        "import os, sys; e = os.environ;"
        "print(e['TERM'], 'NO_COLOR' in e, 'TEXTUAL_ANIMATIONS' in e, os.ttyname(0));"
        "print(sys.stdout.isatty(), os.getsid(0) == os.getpid(), os.tcgetpgrp(1) > 0)"
    )
    command = [sys.executable, "-c", show]
    with Terminal(command) as plain, Terminal(command, environment={"NO_COLOR": "1"}) as grey:
        assert plain.wait_exit() == grey.wait_exit() == 0
        assert plain.row(0).startswith("xterm-256color False False /dev/pts/")
        assert grey.row(0).startswith("xterm-256color True False /dev/pts/")
        assert plain.row(1) == "True True True"


@pytest.mark.parametrize(
    ("sent", "shown"),
    [
        pytest.param("a\x1b[=0;1ub\x1b[>25uc\x1b[<ud", "abcd", id="kitty keyboard"),
        pytest.param("a\x1b[?2026$pb\x1b[?2048$pc\x1b[14td\x1b[>qe", "abcde", id="queries"),
        pytest.param("a\x1b]11;?\x1b\\b\x1bP+q544e\x1b\\c\x1b]0;title\x07d", "abcd", id="strings"),
        pytest.param("a\x1b[?4mb\x1b[4:3mc\x1b(Bd\x1b[2 qe", "abcde", id="styles that pyte cannot read"),
        pytest.param("\x1b[?2026hab\x1b[?2026l\x1b[?2026hcd\x1b[?2026l", "abcd", id="frames"),
        pytest.param("⚠\ufe0f ok\u200d!", "⚠ ok!", id="no width"),
        pytest.param("차축\x1b[1;2Hx", " x축", id="right half written over"),
        pytest.param("차축\x1b[1;1Hx", "x 축", id="left half written over"),
        pytest.param("차축\x1b[1;2H가", " 가", id="two halves written over"),
        pytest.param("before\x1b[?1049hinside\x1b[?1049l!", "before!", id="alternate screen"),
    ],
)
def test_what_a_terminal_swallows_leaves_no_trace(sent: str, shown: str) -> None:
    whole, in_bytes = Emulation(20, 2), Emulation(20, 2)
    whole.feed(sent.encode())
    for byte in sent.encode():
        in_bytes.feed(bytes([byte]))
    assert whole.rows()[0].rstrip() == shown
    assert in_bytes.cells() == whole.cells()
    assert not any(cell.underline for cell in whole.cells()[0])


def test_a_lower_window_loses_rows_at_the_bottom() -> None:
    emulation = Emulation(10, 4)
    emulation.feed(b"one\r\ntwo\r\nthree\r\nfour")
    emulation.resize(4, 2)
    assert emulation.rows() == ["one", "two"]
    emulation.resize(10, 3)
    emulation.feed(b"\x1b[3;1Hlast")
    assert emulation.rows() == ["one", "two", "last"]


def test_half_a_frame_is_not_shown() -> None:
    emulation = Emulation(20, 2)
    emulation.feed(b"\x1b[?2026hold\x1b[?2026l\x1b[?2026h\rn")
    assert emulation.rows()[0] == "old"
    emulation.feed(b"ew\x1b[?2026l")
    assert emulation.rows()[0] == "new"
