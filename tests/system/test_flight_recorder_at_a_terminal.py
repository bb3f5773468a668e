"""The flight recorder of a real console at a real terminal: a stop, a kill, a signal; and the replay of them."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

from console.flight.frozen_recordings import frozen_in
from console.flight.notes import NoteKind
from console.flight.recording import Recording, read_recording
from console.session.station.state import Activity
from tests.terminal import Terminal
from tests.trainee import Trainee, console, console_at

pytestmark = pytest.mark.system


def only(data: Path, reason: str) -> Recording:
    """The one recording with this reason in its name."""
    (path,) = [path for path in frozen_in(data) if reason in path.name]
    return read_recording(path)


def running(data: Path) -> list[Path]:
    return list((data / "flight" / "running").iterdir())


def recorded(data: Path) -> bytes:
    """What is in the ring of the running console."""
    return b"".join(path.read_bytes() for path in sorted(running(data)[0].glob("*.segment")))


@pytest.mark.long
def test_a_stop_is_frozen_and_replayed(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        trainee.press("space")
        trainee.sees("frame.recover")
        trainee.press("ctrl+q")
        assert terminal.wait_exit(10.0) == 0
    recording = only(tmp_path, "stop-space")
    assert running(tmp_path) == []
    activities = [moment.state.activity for moment in recording.moments]
    order = [activities.index(each) for each in (Activity.READY, Activity.HOMING, Activity.STOPPED)]
    assert order == sorted(order)
    stop, sent = (
        next(note.at_s for note in recording.notes if (note.kind, note.text[:1]) == wanted)
        for wanted in ((NoteKind.STOP, "s"), (NoteKind.LINK, "!"))
    )
    assert abs(stop - sent) < 0.1
    assert {"f4", "enter"} <= {note.text for note in recording.notes if note.kind is NoteKind.KEY}
    with Terminal(
        [sys.executable, "-m", "console", "replay", str(recording.path)], columns=80, rows=24
    ) as terminal:
        terminal.wait_for(r"^ REPLAY  SIM ", 20.0)
        Trainee(terminal, "en").press("end")
        Trainee(terminal, "en").sees("frame.recover")
        terminal.press("f4")
        terminal.wait_for("this is a recording", 5.0)
        terminal.press("q")
        assert terminal.wait_exit(5.0) == 0


@pytest.mark.long
def test_the_ring_of_a_killed_console_is_frozen_by_the_next_one_which_a_signal_ends(tmp_path: Path) -> None:
    with console(tmp_path, "en", 80, 24) as terminal:
        trainee = console_at(terminal)
        trainee.switches_on()
        trainee.starts_homing()
        terminal.wait_for(lambda _: b'"homing"' in recorded(tmp_path))
        terminal.signal(signal.SIGKILL)
        terminal.wait_exit(5.0)
    assert (frozen_in(tmp_path), len(running(tmp_path))) == ([], 1)
    with console(tmp_path, "en", 160, 30) as terminal:
        trainee = Trainee(terminal, "en")
        trainee.sees("problem.flight.killed_found")
        assert only(tmp_path, "killed").moments[-1].state.activity is Activity.HOMING
        trainee.press("k")
        trainee.sees("frame.no_alarms_off")
        terminal.signal(signal.SIGTERM)
        assert terminal.wait_exit(8.0) == 1
    assert only(tmp_path, "SIGTERM").header.causes[-1].reason == "SIGTERM"
    assert running(tmp_path) == []
