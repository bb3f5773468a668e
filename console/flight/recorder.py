"""The flight recorder: a thread that looks at the newest state ten times a second and writes what changed.

Nothing waits for it. The threads of the link and of the keys append to a queue; the state, which is immutable and
replaced, is read by reference. A disk that is full, slow or gone costs the recording, and nothing else.
"""

from __future__ import annotations

import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from console.flight.frozen_recordings import SCHEMA, FreezeCause, freeze
from console.flight.notes import Inbox, Note, NoteKind
from console.flight.plain_values import changes, to_json_value
from console.flight.recorded_forms import RecordedMoment, to_recorded_form
from console.flight.ring import SegmentRing, left_rings, whole_lines
from console.session.errors import fault_problem
from console.session.station.alarms import Alarms, Priority, clear_alarms, raise_alarm
from console.session.station.state import StationState
from drivers.link.tracing import Dialogue, format_bytes
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedMachine

PERIOD_S = 0.1
AT_REST_S = 1.0
RETRY_S = 10.0
CLOSE_S = 3.0  # timeout for the last recording; what is not done by then, the next start does

_POLLED = frozenset(
    {"at_s", "asked_s", "position", "following_error", "round_trip_ms", "spindle_rpm"}
    | {"jaw_1_past_mark_deg", "tool_gap_mm", "tool_current_percent"}
)
"""What changes with each poll of a machine at rest: written once a second."""

LOST, KILLED = "flight.not_recorded", "flight.killed_found"
MOST_CHARACTERS = 60_000  # of lines in a segment; a stop or a failure of the link is written in any case

_ASKS = r"(?:#\d+P|F|\?|&\d+\?\?|%|[PMI]\d+)"
_POLL = re.compile(rf"(?:\[\w+\]|.)?(?:#\d+P F \? .*&\d+\?\?|M\d+=\d+ {_ASKS})(?: {_ASKS})*")
"""A status poll, or questions after a renewal of the watchdog; before it perhaps the checksum of another line."""
AFTER_S = 5.0  # aftermath that is still recorded
JOINED_S = 60.0  # causes within this time of the first one make one file
QUIT = "quit"  # the stop with which a console leaves its machine


class LinkLines:
    """Makes notes of bytes; it belongs to the thread of the recorder."""

    def __init__(self, add: Callable[[Note], object]) -> None:
        self._add = add
        self._dialogue = Dialogue(self._line)
        self._polling = False
        self._room = MOST_CHARACTERS
        self._polls = self._left_out = 0

    def take_bytes(self, at_s: float, mark: str, data: bytes) -> None:
        """Take bytes that were sent (`>`), received (`<`) or sent as a stop (`!`), or the code of a failure."""
        if mark in "<>":
            self._dialogue.take_bytes(at_s, mark, data)
        else:
            self._add(Note(at_s=at_s, kind=NoteKind.LINK, text=f"{mark} {format_bytes(data)}"))

    def begin_segment(self, at_s: float) -> None:
        """Begin to count anew; note what was left out since the last time."""
        if self._polls or self._left_out:
            words = f"polls={self._polls} lines={self._left_out}"
            self._add(Note(at_s=at_s, kind=NoteKind.LEFT_OUT, text=words))
        self._room, self._polls, self._left_out = MOST_CHARACTERS, 0, 0

    def _line(self, at_s: float, mark: str, words: str) -> None:
        if mark == ">":
            self._polling = _POLL.fullmatch(words) is not None
            self._polls += self._polling
        if self._polling:
            return
        if len(words) > self._room:
            self._left_out += 1
            return
        self._room -= len(words)
        self._add(Note(at_s=at_s, kind=NoteKind.LINK, text=f"{mark} {words}"))


class Triggers:
    """Find causes in the states; it belongs to the thread of the recorder."""

    def __init__(self) -> None:
        self.leaving = False
        self.is_fresh = False
        """Whether a cause came that is not on the disk yet."""
        self.extends = False
        """Whether the last causes belong to the file that was frozen before."""
        self._alarms: frozenset[tuple[str, str]] = frozenset()
        self._stop_s: float | None = None
        self._causes: list[FreezeCause] = []
        self._due_s: float | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether there is something to freeze."""
        return self._due_s is not None

    def find_causes(self, state: StationState, now_s: float) -> tuple[FreezeCause, ...]:
        """Return the causes that are new in a state."""
        before = self._alarms
        urgent = [alarm for alarm in state.alarms if alarm.active and alarm.priority is not Priority.LOW]
        self._alarms = frozenset((alarm.problem.code, alarm.problem.key) for alarm in urgent)
        fresh = [each.problem.code for each in urgent if (each.problem.code, each.problem.key) not in before]
        stop = state.stop
        if stop is not None and stop.sent_s != self._stop_s and not (self.leaving and stop.reason == QUIT):
            fresh.insert(0, f"stop {stop.reason}")
        self._stop_s = None if stop is None else stop.sent_s
        causes = tuple(FreezeCause(at_s=now_s, reason=reason) for reason in fresh)
        for cause in causes:
            self.add(cause)
        return causes

    def add(self, cause: FreezeCause) -> None:
        """Take a cause: the file is due some seconds later; it is another one where the last began long ago."""
        if self._causes and cause.at_s - self._causes[0].at_s > JOINED_S and not self.is_waiting:
            self._causes = []
        self._causes.append(cause)
        self.is_fresh = True
        if self._due_s is None:
            self._due_s = cause.at_s + AFTER_S
            self.extends = len(self._causes) > 1

    def is_due(self, now_s: float) -> bool:
        """Whether the aftermath is over."""
        return self._due_s is not None and now_s >= self._due_s

    def freeze_again(self, due_s: float) -> None:
        """Freeze once more: it could not be written."""
        self._due_s = due_s

    def begin_file(self) -> tuple[FreezeCause, ...]:
        """Return all causes of the file, which is frozen now."""
        self._due_s = None
        return tuple(self._causes)


class FlightRecorder:
    """Records one console. `observe` is called in its thread, and returns at once."""

    def __init__(
        self,
        data: Path,
        machine: LoadedMachine,
        observe: Callable[[], RecordedMoment],
        inbox: Inbox,
        *,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.alarms: Alarms = ()
        self._data, self._machine, self._observe, self._inbox, self._now_s = data, machine, observe, inbox, now_s
        self._ring: SegmentRing | None = None
        self._before: RecordedMoment | None = None
        self._written_s = self._retry_s = float("-inf")
        self._lines: list[Mapping[str, Any]] = []
        self._link = LinkLines(self._add)
        self._triggers = Triggers()
        self._frozen: Path | None = None
        self._done, self._reason = threading.Event(), ""
        self._alarming = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="flight", daemon=True)

    def start(self) -> None:
        """Start the thread; it first freezes what killed consoles have left."""
        self._thread.start()

    def leave(self) -> None:
        """Take note that the operator leaves: the stop of a machine that is left is no event."""
        self._triggers.leaving = True

    def close(self, reason: str = "") -> None:
        """End the recording; `reason` is a signal or a crash, to be frozen, "" where the operator has left."""
        self._reason = reason
        self._done.set()
        if self._thread.is_alive():
            self._thread.join(CLOSE_S)

    def acknowledge(self, change: Callable[[Alarms], Alarms]) -> None:
        """Change the alarms of the recorder itself."""
        with self._alarming:
            self.alarms = change(self.alarms)

    def _run(self) -> None:
        try:
            self._freeze_left()
            while not self._done.wait(PERIOD_S):
                self.turn()
            self.turn()
            self._finish()
        except Exception as fault:  # nothing of a recording may end a console
            self._alarm(Problem(code=LOST, value=fault_problem(fault).value))

    def turn(self) -> None:
        """Take what waits, look at the state, write, and freeze what is due."""
        now_s = self._now_s()
        try:
            self._look(now_s)
            self._write(now_s)
        except OSError as error:
            self._lines.clear()
            self._retry_s = now_s + RETRY_S
            if self._ring is not None and not self._ring.folder.is_dir():
                self._ring.close(remove=False)
                self._ring = self._frozen = None
            self._report(error)
        try:
            if self._triggers.is_due(now_s):
                self._freeze()
        except (OSError, ProblemError) as error:
            self._triggers.freeze_again(now_s + RETRY_S)
            self._report(error)

    def _look(self, now_s: float) -> None:
        heard, lost = self._inbox.take_entries()
        for at_s, kind, words in heard:
            if isinstance(words, bytes):
                self._link.take_bytes(at_s, kind, words)
            else:
                self._add(Note(at_s=at_s, kind=NoteKind(kind), text=words))
        if lost:
            self._add(Note(at_s=now_s, kind=NoteKind.LOST, text=str(lost)))
        moment = self._observe()
        for cause in self._triggers.find_causes(moment.state, now_s):
            self._add(Note(at_s=now_s, kind=NoteKind.FROZEN, text=cause.reason))
        changed = {} if self._before is None else changes(self._before, moment, to_recorded_form)
        busy = moment.state.seen_moving or any(path.rpartition(".")[2] not in _POLLED for path in changed)
        due = now_s - self._written_s >= AT_REST_S or self._triggers.is_due(now_s)
        if self._before is None or (busy and changed) or due:
            self._before, self._written_s = moment, now_s
            self._lines.append({"t": now_s, "set": changed})

    def _write(self, now_s: float) -> None:
        if now_s < self._retry_s:
            self._lines.clear()
            return
        if self._ring is None:
            self._ring = SegmentRing(self._data, self._machine.machine.name)
        if self._ring.is_due(now_s):
            self._link.begin_segment(now_s)
            self._ring.begin(now_s, self._header(now_s))
            full = {"t": now_s, "full": to_json_value(self._before, to_recorded_form)}
            self._lines = [full, *(line for line in self._lines if "set" not in line)]
        lines, self._lines = self._lines, []
        self._ring.write(lines, through=self._triggers.is_fresh)
        self._triggers.is_fresh = False
        if self._is_alarmed and not self._triggers.is_waiting:
            self.acknowledge(lambda alarms: clear_alarms(alarms, LOST))

    def _freeze(self) -> None:
        causes = self._triggers.begin_file()
        if self._ring is not None:
            to = self._frozen if self._triggers.extends else None
            self._frozen = freeze(self._data, whole_lines(self._ring.segments()), causes, to)

    def _freeze_left(self) -> None:
        """Freeze the rings of killed consoles, and say so."""
        try:
            for folder in left_rings(self._data, self._machine.machine.name):
                path = freeze(self._data, whole_lines(sorted(folder.glob("*.segment"))), ())
                shutil.rmtree(folder, ignore_errors=True)
                if path is not None:
                    self._alarm(Problem(code=KILLED, value=path.name))
                    self.acknowledge(lambda alarms: clear_alarms(alarms, KILLED))  # an event: gone once it is seen
        except (OSError, ProblemError) as error:
            self._report(error)

    def _finish(self) -> None:
        """Freeze what still has to be, and remove the ring; one that cannot be frozen stays for the next start."""
        now_s = self._now_s()
        if self._reason:
            self._triggers.add(FreezeCause(at_s=now_s, reason=self._reason))
        done = True
        if self._triggers.is_waiting:
            try:
                self._freeze()
            except (OSError, ProblemError):
                done = False
        if self._ring is not None:
            self._ring.close(remove=done)

    @property
    def _is_alarmed(self) -> bool:
        return any(alarm.active and alarm.problem.code == LOST for alarm in self.alarms)

    def _report(self, error: OSError | ProblemError) -> None:
        """Report once that nothing is recorded; it is tried again after some time."""
        if not self._is_alarmed:
            why = error.problems[0].value if isinstance(error, ProblemError) else error.strerror or str(error)
            self._alarm(Problem(code=LOST, value=why))

    def _add(self, note: Note) -> None:
        self._lines.append({"t": note.at_s, "kind": note.kind.value, "text": to_json_value(note.text)})

    def _alarm(self, problem: Problem) -> None:
        self.acknowledge(lambda alarms: raise_alarm(alarms, problem, Priority.LOW, self._now_s()))

    def _header(self, now_s: float) -> dict[str, Any]:
        loaded = self._machine
        return {
            "flight": SCHEMA,
            "software": _software(),
            "machine": to_json_value(loaded.machine),
            "machine_path": to_json_value(loaded.path),
            "machine_sha256": loaded.sha256,
            "simulated": self._before is not None and self._before.state.simulated,
            "console": os.getpid(),
            "at_s": now_s,
            "utc_s": time.time(),
        }


@cache
def _software() -> str:
    from importlib.metadata import version  # slow to import

    return f"trilobe {version('trilobe')}"
