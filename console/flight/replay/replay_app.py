"""The console on a recording: the very pages, without a machine behind them; nothing can be commanded or saved.

The keys of the machine do nothing here, and say so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from textual import events

from console.flight.notes import NoteKind
from console.flight.playback import Playback, PlaybackEvent, PlaybackEventKind, ReplayControl
from console.flight.recorded_forms import RecordedWork
from console.session.appearance import Appearance
from console.session.station.history.session_log import SessionLog
from console.session.station.state import StationState
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.app import ConsoleApp
from console.tui.frame import Frame
from console.tui.key_help import KEY_WIDTH
from console.tui.keymap import DIGITS, NUMBERED, READING, PageName, action_of
from console.tui.lines import BLANK, Line, fit_text, hanging, line, width_of, wrap_line
from console.tui.list_panel import MESSAGES, PAGE, ListPanel
from console.tui.theme import Palette, Token
from profiles.problem import Problem
from profiles.store import LoadedJob, LoadedMachine

REFUSED = Problem(code="flight.is_recording")
HELP = 1
PAGES = (*(page for page in NUMBERED if page is not PageName.RECORDS), PageName.LOG)
"""Pages that can be seen: what the page Records and the others without a digit read is not part of a recording."""


LOOKING = ("alarms.up", "alarms.down", "alarms.log", "log.up", "log.down")
"""Actions of the pages that only show something else; the other keys of the same kind are those of the replay."""


_SIGNS = {
    PlaybackEventKind.ALARM: (3, "!", Token.WARNING),
    PlaybackEventKind.STOPPED: (2, "■", Token.STRONG),
    NoteKind.STOP: (2, "■", Token.STRONG),
    NoteKind.KILL: (2, "■", Token.STRONG),
    NoteKind.KEY: (1, "·", Token.KEY),
}
"""Rank, sign and colour of a mark; where two meet, the higher rank is shown."""

LEAST_TRACK = 8
LITTLE_S, MUCH_S = 10.0, 60.0


def clock_words(seconds: float) -> str:
    """Return a time as minutes and seconds with a tenth."""
    tenths = round(10.0 * seconds)
    return f"{tenths // 600}:{tenths % 600 // 10:02d}.{tenths % 10}"


def time_bar(playback: Playback, width: int) -> Line:
    """Return the row: paused or playing, speed, time of all, and the track with its marks."""
    sign = "▶" if playback.playing else "‖"
    speed = f"x{playback.speed:g}"
    length_s = playback.recording.length_s
    times = f"{clock_words(playback.past_s)} / {clock_words(length_s)}"
    head: list[tuple[str, Token]] = [(f" {sign} {speed:<5}", Token.ACTION), (f"{times}  ", Token.TEXT)]
    room = width - width_of(tuple(head)) - 1
    return (*head, *_track(playback, room)) if room >= LEAST_TRACK else tuple(head)


def _track(playback: Playback, cells: int) -> Line:
    first_s, length_s = playback.recording.times_s[0], max(playback.recording.length_s, 1e-9)

    def cell(at_s: float) -> int:
        return min(max(round((at_s - first_s) / length_s * (cells - 1)), 0), cells - 1)

    marks: dict[int, tuple[int, str, Token]] = {}
    for event in playback.events:
        mark = _mark(event)
        place = cell(event.at_s)
        if mark is not None and mark[0] > marks.get(place, (0, "", Token.DIM))[0]:
            marks[place] = mark
    marks[cell(playback.at_s)] = (4, "●", Token.STRONG)
    return tuple(marks[place][1:] if place in marks else ("─", Token.DIM) for place in range(cells))


def _mark(event: PlaybackEvent) -> tuple[int, str, Token] | None:
    return None if event.is_low else _SIGNS.get(event.kind)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayKey:
    """One action: its keys by their Textual names or characters, and how they are written."""

    id: str
    keys: tuple[str, ...]
    shown: str


KEYS = (
    ReplayKey(id="play", keys=("space",), shown="Space"),
    ReplayKey(id="back", keys=("left",), shown="←"),
    ReplayKey(id="on", keys=("right",), shown="→"),
    ReplayKey(id="minute_back", keys=("pageup",), shown="PgUp"),
    ReplayKey(id="minute_on", keys=("pagedown",), shown="PgDn"),
    ReplayKey(id="frame_back", keys=(",",), shown=","),
    ReplayKey(id="frame_on", keys=(".",), shown="."),
    ReplayKey(id="event_back", keys=("b", "ㅠ"), shown="b"),
    ReplayKey(id="event_on", keys=("n", "ㅜ"), shown="n"),
    ReplayKey(id="slower", keys=("-",), shown="-"),
    ReplayKey(id="faster", keys=("+", "="), shown="+"),
    ReplayKey(id="begin", keys=("home",), shown="Home"),
    ReplayKey(id="end", keys=("end",), shown="End"),
    ReplayKey(id="follow", keys=("f", "ㄹ"), shown="f"),
    ReplayKey(id="quit", keys=("q", "ㅂ", "ctrl+q"), shown="q"),
)

_ROW = (
    ("Space", "play"),
    ("←→", "seek"),
    (",.", "frame"),
    ("b n", "event"),
    ("+-", "speed"),
    ("f", "follow"),
    ("q", "quit"),
    ("?", "help"),
)


def key_of(key: str, character: str | None) -> ReplayKey | None:
    """Return the action of a key, None if it has none here."""
    return next((each for each in KEYS if key in each.keys or character in each.keys), None)


def move(playback: Playback, action: str) -> None:
    """Go to another time, or at another speed."""
    match action:
        case "play":
            playback.toggle()
        case "back" | "on":
            playback.seek(LITTLE_S if action == "on" else -LITTLE_S)
        case "minute_back" | "minute_on":
            playback.seek(MUCH_S if action == "minute_on" else -MUCH_S)
        case "frame_back" | "frame_on":
            playback.step(1 if action == "frame_on" else -1)
        case "event_back" | "event_on":
            playback.to_event(1 if action == "event_on" else -1)
        case "slower" | "faster":
            playback.change_speed(1 if action == "faster" else -1)
        case "begin" | "end":
            length_s = playback.recording.length_s
            playback.seek(length_s if action == "end" else -length_s)


def keys_line(text: Catalogue, width: int) -> Line:
    """Return the row of the keys, as far as they fit."""
    pieces: list[tuple[str, Token]] = [(" ", Token.TEXT)]
    for written, name in _ROW:
        fresh = [(written, Token.KEY), (f" {text(f'replay.key.{name}')}  ", Token.DIM)]
        if width_of((*pieces, *fresh)) > width + 2:
            break
        pieces += fresh
    return tuple(pieces)


def replay_help(text: Catalogue, width: int) -> list[Line]:
    """Return the list of the keys, and the marks of the time bar."""
    rows = [line((text("replay.help"), Token.TITLE))]
    pairs = [(each.shown, text(f"replay.help.{each.id}")) for each in KEYS]
    for shown, said in (*pairs, ("1-6 8", text("replay.help.pages")), ("! ■ ·", text("replay.help.marks"))):
        rows += hanging((fit_text(shown, KEY_WIDTH), Token.KEY), said, width)
    return [*rows, BLANK, *(wrap_line(text("replay.help.not_shown"), width, Token.DIM))]


class ReplayApp(ConsoleApp):
    """Plays a recording. `data` is an empty folder.

    The page of the operator is followed until the viewer chooses one.
    """

    def __init__(
        self,
        playback: Playback,
        *,
        text: Catalogue,
        palette: Palette,
        data: Path,
        now_s: Callable[[], float] = time.monotonic,
        ticking: bool = True,
        appearance: Appearance | None = None,
    ) -> None:
        header = playback.recording.header
        machine = LoadedMachine(machine=header.machine, path=header.machine_path, sha256=header.machine_sha256)
        super().__init__(
            text=text,
            palette=palette,
            control=ReplayControl(playback),
            machine=machine,
            data=data,
            local_time=lambda: datetime.fromtimestamp(header.utc_of(playback.at_s)),
            ticking=ticking,
            appearance=appearance,
        )
        simulated = f" {text('sim')}" if header.simulated else ""
        self.title = f"{text('replay.badge')}{simulated} {header.machine.name}"
        self.playback, self._loaded_machine = playback, machine
        self._list = _ReplayList(self.look.palette, self.look.text)
        self._real_s = now_s
        self._ticked_s: float | None = None
        self._shown: RecordedWork | None = None
        self._follows, self._refused = True, False

    def tick(self) -> None:
        """Let the recording go on, then show what it shows."""
        now_s = self._real_s()
        if self._ticked_s is not None:
            self.playback.advance(now_s - self._ticked_s)
        self._ticked_s = now_s
        moment = self.playback.moment
        if moment.work is not self._shown:
            self._shown = moment.work
            self.ui.work = None if moment.work is None else _work(moment.work, self._loaded_machine)
        if self._follows and moment.page in PAGES and moment.page != self.page and not self._list.is_open:
            self.go(PageName(moment.page))
        self.ui.key_answer = (REFUSED,) if self._refused else moment.said
        super().tick()

    def log_of(self, state: StationState) -> SessionLog:
        """Return the log of the session as far as it is recorded."""
        return self.playback.log

    def rows_of(self, frame: Frame) -> dict[str, list[Line]]:
        """Return the rows, with the time in the place of the stop."""
        width = self.size.width
        rows = super().rows_of(replace(frame, badge=self.ui.text("replay.badge")))
        return {**rows, "stop": [time_bar(self.playback, width)], "keys": [keys_line(self.ui.text, width)]}

    def small_rows(self, state: StationState) -> list[Line]:
        """Return what a small terminal shows."""
        words = self.ui.text("replay.small")
        title = line((f" {self.ui.text('replay.badge')} ", Token.SELECTED))
        return [title, *wrap_line(words, max(self.size.width, 1), Token.TEXT)]

    def action_quit(self) -> None:  # type: ignore[override]
        """Leave; nothing is in motion."""
        self.exit()

    def stop_now(self, reason: str) -> None:
        """Stop nothing."""
        self._refused = True

    def kill_now(self, reason: str) -> None:
        """Open no loop."""
        self._refused = True

    def perform_key(self, event: events.Key) -> bool:
        """Perform the action of a key; every key of the machine is answered that this is a recording."""
        self._refused = False
        action = key_of(event.key, event.character)
        reading = next((each for each in READING if self._list.is_open and event.key in each.keys), None)
        if reading is not None:
            self._list.read(reading)
        elif action is not None and action.id == "quit":
            self.action_quit()
        elif action is not None and action.id == "follow":
            self._follows = True
            self._list.open(PAGE)
        elif action is not None:
            move(self.playback, action.id)
        else:
            self._show_view(event.key, event.character)
        self.call_after_refresh(self.tick)
        return True

    def _show_view(self, key: str, character: str | None) -> None:
        """Show another page or a list; anything else is a key of the machine."""
        page = next((each for each in PAGES if DIGITS.get(each) == key), None)
        action = action_of(key, character, self.page)
        if key in ("?", "question_mark", "f1") or character == "?":
            self._list.open(PAGE if self._list.shown == HELP else HELP)
        elif key in ("w", "ㅈ") or character == "ㅈ":
            self._list.open(PAGE if self._list.shown == MESSAGES else MESSAGES)
        elif key in ("backspace", "escape"):
            self._list.open(PAGE)
        elif page is not None:
            self._follows = False
            self.go(page)
        elif action is not None and action.id in LOOKING:
            self._list.open(PAGE)
            self._follows = self._follows and action.id != "alarms.log"  # it shows another page
            self._pages[self.page].act(action.id)
        else:
            self._refused = True


class _ReplayList(ListPanel):
    """The list of messages as ever, and the keys of a replay."""

    def lay_open(self, frame: Frame, of_page: Sequence[Line], width: int) -> None:
        """Lay out the list that is open."""
        if self.shown == MESSAGES:
            super().lay_open(frame, of_page, width)
        else:
            self._lay(replay_help(frame.text, width))


def _work(recorded: RecordedWork, machine: LoadedMachine) -> Work:
    loaded = LoadedJob(job=recorded.saved, path=Path(recorded.path), sha256=recorded.sha256)
    return Work(loaded=loaded, machine=machine, job=recorded.job, strategy=recorded.strategy, stage=recorded.stage)
