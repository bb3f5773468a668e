"""Page Scope: what the controller gathers, over time or over the angle of the spindle, with two cursors."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from textual.containers import Vertical

from console.session.data.kept_files import folder_name, make_folder, names_in
from console.session.station.commands import Control
from console.session.station.state import Activity, StationState
from console.tui.controller.errand import Errand
from console.tui.further.scope_pictures import ScopeView, average_turns, picture, reading_lines
from console.tui.further.scope_setup import ROWS, change_setup, channel_words, setup_lines
from console.tui.keymap import PageName, RowKey
from console.tui.lines import Line, Sheet, entitle, line, wrap_line
from console.tui.page import Page
from console.tui.plot.trace_view import TraceView
from console.tui.rows import list_rows
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View
from drivers.requests.permitted_lines import RequestKind
from drivers.requests.scope_gather import (
    ANGLE,
    Channel,
    MachineConditions,
    Scope,
    ScopeProgress,
    ScopeRecord,
    ScopeSetup,
    ScopeTrigger,
    channel_of,
)
from drivers.requests.side_controller import SideController
from drivers.requests.side_line import SideLine
from profiles.arrays import Floats
from profiles.files import printable, read_regular_file, write_atomically
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError
from profiles.strict_values import DAMAGED_AT

COARSE = 20  # part of the picture that PgUp and PgDn move a cursor by
_SETS = {"scope.up": -1, "scope.down": 1}
_PAGES = {"scope.far_left": -1, "scope.far_right": 1}
_ENDS = {"scope.first": -sys.maxsize, "scope.last": sys.maxsize}
LIST_KEYS = (
    RowKey(action="scope.up", shown="↑↓", words="key.list.choose", doubled=True),
    RowKey(action="scope.more", shown="Enter", words="key.list.open"),
    RowKey(action="scope.list", shown="o", words="key.list.close"),
)

FOLDER = "scope"
TITLE = "# trilobe scope 1"
CAP_BYTES = 50_000_000
_HEAD_KEYS = ("machine", "taken", "trigger")
_TIME_COLUMN = "time [s]"


def refusal_of(ui: UiContext, state: StationState, *, running: bool) -> tuple[Problem, ...]:
    """Return why nothing can be gathered now; motion is no reason, arming is: it takes the gather buffer."""
    if running:
        return (Problem(code="screen.scope_gathers"),)
    if ui.control.side is None or state.activity in (Activity.CONNECTING, Activity.LOST):
        return (Problem(code="screen.no_controller"),)
    if not state.controls:
        return (Problem(code="screen.observes"),)
    if state.activity is Activity.ARMING:
        return (Problem(code="screen.scope_arming"),)
    return ()


class ScopeWork:
    """One record in the making; `progress` is replaced by the thread that makes it."""

    def __init__(self, side: SideLine, machine: MachineProfile, control: Control) -> None:
        self.client = SideController(side, RequestKind.GATHER)
        self.progress = ScopeProgress("setting")
        self._side, self._machine, self._control = side, machine, control

    def record(self, setup: ScopeSetup, taken: str) -> ScopeRecord:
        """Gather; errors as `Scope.record`."""
        with self._side.working():
            cleaner = SideController(self._side, RequestKind.GATHER)
            scope = Scope(self.client, cleaner, self._machine, self._machine_conditions, self._tell)
            return scope.record(setup, taken)

    def _tell(self, progress: ScopeProgress) -> None:
        self.progress = progress

    def _machine_conditions(self) -> MachineConditions:
        state = self._control.state
        snapshot = state.snapshot
        return MachineConditions(
            now_s=self._control.now_s(),
            at_rest=not state.seen_moving and not state.may_move,
            near_cut=state.armed is not None or state.activity in (Activity.POSITIONING, Activity.CUTTING),
            cutting=snapshot is not None and snapshot.program_running,
            round_trip_s=state.round_trip_ms / 1000.0,
        )


def keep_record(data: Path, record: ScopeRecord) -> Path:
    """Write a record into the data folder; return the file. Raises ProfileError: as `write_atomically`."""
    folder = data / FOLDER
    make_folder(folder)
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3]
    path = folder / f"{folder_name(record.machine)}-{stamp}Z.csv"
    write_atomically(path, record_text(record).encode("utf-8"), overwrite=False, private=True)
    return path


def record_text(record: ScopeRecord) -> str:
    """Return a record as CSV: times in s from the trigger, channels in m, rad, m/s, rad/s."""
    head = [TITLE, *(f"# {key}: {printable(str(getattr(record, key)))}" for key in _HEAD_KEYS)]
    head.append(",".join([_TIME_COLUMN, *(f"{channel.key} [{channel.si_unit}]" for channel in record.values)]))
    columns = np.column_stack([record.times_s, *record.values.values()])
    rows = (",".join(f"{value:.12g}" for value in row) for row in columns.tolist())
    return "\n".join([*head, *rows]) + "\n"


def read_record(path: Path) -> ScopeRecord:
    """Return a kept record. Raises ProfileError: `scope.unreadable`, or as `read_regular_file`."""
    where = printable(str(path))
    try:
        text = read_regular_file(path, cap_bytes=CAP_BYTES).decode("utf-8")
        lines = text.splitlines()
        if len(lines) < 5 or lines[0] != TITLE:
            raise ValueError(lines[0] if lines else f"{DAMAGED_AT}: 1")
        facts = dict(line.removeprefix("# ").split(": ", 1) for line in lines[1:4])
        if not text.endswith("\n"):  # its last number may be half of one
            raise ValueError(f"{DAMAGED_AT}: {len(lines)}")
        channels = [_channel(each) for each in lines[4].split(",")[1:]]
        rows = _numbers(lines[5:], len(channels) + 1)
        return ScopeRecord(
            machine=facts["machine"],
            taken=facts["taken"],
            trigger=ScopeTrigger(facts["trigger"]),
            times_s=rows[:, 0],
            values={channel: rows[:, place] for place, channel in enumerate(channels, start=1)},
        )
    except (ValueError, IndexError, KeyError) as error:
        problem = Problem(code="scope.unreadable", where=where, value=printable(str(error), 60))
        raise ProfileError(problem) from error


def _numbers(lines: list[str], columns: int) -> Floats:
    """Return the samples, a row for each. Raises ValueError: the number of the first line that is none."""
    found = []
    for number, each in enumerate(lines, start=6):
        try:
            row = [float(value) for value in each.split(",")]
        except ValueError:
            row = []
        if len(row) != columns or not np.isfinite(row).all():
            raise ValueError(f"{DAMAGED_AT}: {number}")
        found.append(row)
    if len(found) < 2:
        raise ValueError(f"{DAMAGED_AT}: {len(lines) + 6}")
    return np.array(found, dtype=np.float64)


def records_of(data: Path) -> tuple[Path, ...]:
    """Return the kept records, newest first by the times in their names; ProfileError `file.unreadable`."""
    return tuple(
        sorted(names_in(data / FOLDER, ".csv"), key=lambda path: path.stem.rpartition("-")[2], reverse=True)
    )


def _channel(head: str) -> Channel:
    name, _, unit = head.partition(" ")
    channel = channel_of(name)
    if unit != f"[{channel.si_unit}]":
        raise ValueError(head)
    return channel


class ScopePage(Page):
    """Nothing on it moves anything; gathering takes the gather buffer of the controller."""

    name_ = PageName.SCOPE

    DEFAULT_CSS = """
    ScopePage {
        layout: horizontal;
        Sheet { border: round $secondary; border-title-color: $foreground; border-subtitle-color: $foreground; }
        #scope-set { width: 31; height: 1fr; }
        #scope-right { width: 1fr; height: 1fr; }
        #scope-plot { height: 1fr; border: round $secondary; border-title-color: $foreground;
            border-subtitle-color: $foreground; }
        #scope-read { height: 9; }
        #scope-list { width: 1fr; height: 1fr; display: none; }
    }
    ScopePage.-list #scope-set { display: none; }
    ScopePage.-list #scope-right { display: none; }
    ScopePage.-list #scope-list { display: block; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._set = Sheet(ui.palette, id="scope-set")
        self._plot = TraceView(palette=ui.palette, id="scope-plot")
        self._read = Sheet(ui.palette, id="scope-read")
        self._list = Sheet(ui.palette, id="scope-list")
        right = Vertical(self._plot, self._read, id="scope-right")
        self.panels = (self._set, right, self._list)
        self._setup, self._row = ScopeSetup(), 0
        self._work: ScopeWork | None = None
        self._errand: Errand[ScopeRecord] = Errand()
        self._opening: Errand[ScopeRecord] = Errand()
        self._record: ScopeRecord | None = None
        self._sight: ScopeView | None = None
        self._chosen: Channel | None = None
        self._cursors, self._active, self._over_angle = [0, 0], 0, False
        self._files: tuple[Path, ...] = ()
        self._file, self._listing = 0, False
        self._painted: object = None

    # What the keys do ------------------------------------------------------------------------------------------

    def act(self, action: str) -> None:
        """Choose and change a setting, gather, look, keep, open."""
        if self._listing and self._in_list(action):
            return
        if action in _SETS:
            self._row = (self._row + _SETS[action]) % len(ROWS)
        elif self.ui.answers(self.why_not(action, self.ui.view)):
            return
        elif action in ("scope.more", "scope.less"):
            self._change(1 if action == "scope.more" else -1)
        elif action == "scope.gather":
            self._gather()
        elif action == "scope.cancel":
            self._errand.cancel()
        elif action == "scope.list":
            with self.ui.answering():
                self._files = records_of(self.ui.data)
                self._listing, self._file = True, 0
        elif action == "scope.keep" and self._record is not None:
            with self.ui.answering():
                path = keep_record(self.ui.data, self._record)
                self.ui.say("screen.scope_kept", value=printable(str(path)))
        else:
            self._look(action)

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why an action cannot be done now."""
        word = action.removeprefix("scope.")
        if word == "gather":
            return refusal_of(self.ui, view.state, running=self._errand.running)
        if word in ("more", "less") and change_setup(self._setup, self._row, 1) is None:
            return (Problem(code="screen.scope_channels"),)
        if word == "cancel" and not self._errand.running:
            return (Problem(code="screen.nothing_gathers"),)
        looks = ("keep", "angle", "channel", "cursor", "left", "right", "far_left", "far_right", "first", "last")
        if word in looks and self._record is None:
            return (Problem(code="screen.no_record_yet"),)
        if word == "angle" and not self._over_angle and self._record is not None:
            return self._why_no_angle(self._record)
        return ()

    def _why_no_angle(self, record: ScopeRecord) -> tuple[Problem, ...]:
        if ANGLE not in record.values or len(record.values) == 1:
            return (Problem(code="screen.scope_no_angle"),)
        return () if average_turns(record) is not None else (Problem(code="screen.scope_few_turns"),)

    def _in_list(self, action: str) -> bool:
        """Do what a key does in the list of kept records; False for one that does the same as elsewhere."""
        steps = {**_SETS, **_ENDS, **{key: by * max(self._list.size.height - 1, 1) for key, by in _PAGES.items()}}
        if action in steps:
            self._file = max(min(self._file + steps[action], len(self._files) - 1), 0)
        elif action in ("scope.list", "scope.left"):
            self._listing = False
        elif action == "scope.more" and self._files:
            path = self._files[self._file]
            self._opening.start(None, lambda: read_record(path))
            self._listing = False
        elif action == "scope.more":
            self.ui.say("screen.scope_none_kept")
        else:
            self._listing = False
            return False
        return True

    def _change(self, by: int) -> None:
        after = change_setup(self._setup, self._row, by, self.ui.text.units)
        if after is not None:
            self._setup = after

    def _gather(self) -> None:
        side = self.ui.control.side
        assert side is not None  # `why_not` has seen it
        self._work = ScopeWork(side, self.ui.machine.machine, self.ui.control)
        taken = datetime.now(UTC).isoformat(timespec="seconds")
        work, setup = self._work, self._setup
        self._errand.start(work.client, lambda: work.record(setup, taken))

    def _look(self, action: str) -> None:
        sight = self._sight
        if sight is None:
            return
        if action == "scope.angle":
            self._over_angle = not self._over_angle
            self._see()
        elif action == "scope.cursor":
            self._active = 1 - self._active
        elif action == "scope.channel":
            names = self._choices(sight.record)
            place = names.index(sight.chosen) if sight.chosen in names else 0
            self._chosen = names[(place + 1) % len(names)]
            self._see(keep=True)
        else:
            size = len(sight.axis)
            step = max(size // COARSE, 1) if "far" in action else max(size // 300, 1)
            by = _ENDS.get(action, step * (-1 if "left" in action else 1))
            self._cursors[self._active] = min(max(self._cursors[self._active] + by, 0), size - 1)

    def _choices(self, record: ScopeRecord) -> tuple[Channel, ...]:
        return tuple(each for each in record.values if not (self._over_angle and each == ANGLE))

    # What is shown ---------------------------------------------------------------------------------------------

    def show(self, view: View) -> None:
        """Take what was gathered or opened, and show it."""
        self._take()
        self.set_class(self._listing, "-list")
        if self._listing:
            self._show_list()
            return
        self._show_set(view.state)
        shown = (id(self._sight), tuple(self._cursors), self._active, self._plot.size, self._read.size)
        if shown != self._painted:
            self._painted = shown
            self._paint()

    def next_step(self, view: View) -> Line:
        """Return what happens, or the next key."""
        text = self.ui.text
        if self._errand.running and self._work is not None:
            now = self._work.progress
            key = "tries" if now.tries else now.stage
            words = text(f"scope_page.doing.{key}", percent=f"{100.0 * now.part:.0f}", tries=now.tries)
            return line((words, Token.ACTION))
        key = "list" if self._listing else "empty" if self._record is None else "record"
        return line((text(f"scope_page.next.{key}"), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return the readings of every channel."""
        return [] if self._sight is None else self._readings(self._sight, width)

    @property
    def keys(self) -> tuple[RowKey, ...]:
        """Those of the list of kept records while it is open."""
        return LIST_KEYS if self._listing else ()

    def leave(self) -> None:
        """Close the list of kept records; what is being gathered goes on."""
        self._listing = False

    def _take(self) -> None:
        for errand in (self._errand, self._opening):
            if not errand.has_news:
                continue
            if errand.problems:
                self.ui.key_answer = errand.problems
            elif errand.cancelled:
                self.ui.say("screen.scope_cancelled")
            elif errand.found is not None:
                self._record, self._over_angle = errand.found, False
                self._see()

    def _see(self, *, keep: bool = False) -> None:
        record = self._record
        if record is None:
            return
        names = self._choices(record)
        if self._chosen not in names:
            self._chosen = names[0]
        averages = average_turns(record) if self._over_angle else None
        self._sight = ScopeView(record=record, chosen=self._chosen or names[0], averages=averages)
        if not keep:
            size = len(self._sight.axis)
            self._cursors = [size // 4, 3 * size // 4]

    def _show_set(self, state: StationState) -> None:
        cycle_ms = self.ui.machine.machine.controller.servo_period_ms
        width, height = max(self._set.size.width, 1), max(self._set.size.height, 1)
        rows = setup_lines(self._setup, self._row, cycle_ms, self.ui.text, width)
        first = max(min(self._row - height // 2, len(rows) - height), 0)
        count = self._setup.samples(cycle_ms)
        self._set.show(
            rows[first : first + height],
            self.ui.text("scope_page.set_up"),
            self.ui.text("scope_page.samples", count=count),
        )

    def _paint(self) -> None:
        sight, text = self._sight, self.ui.text
        if sight is None:
            entitle(self._plot, text("scope_page.nothing"), text("scope_page.units"))
            self._read.show(wrap_line(text("scope_page.how"), max(self._read.size.width, 1), Token.DIM))
            return
        words = [channel_words(each, text) for each in reversed(sight.drawn_channels)]
        over = text("scope_page.over_angle" if sight.averages is not None else "scope_page.over_time")
        entitle(self._plot, ", ".join(words), over)
        self._plot.show(picture(sight, (self._cursors[0], self._cursors[1]), text.units))
        rows = self._readings(sight, max(self._read.size.width, 1))
        self._read.show(rows, text("scope_page.readings"), sight.record.taken)

    def _readings(self, sight: ScopeView, width: int) -> list[Line]:
        return reading_lines(sight, (self._cursors[0], self._cursors[1]), self._active, self.ui.text, width)

    def _show_list(self) -> None:
        text, height = self.ui.text, max(self._list.size.height, 1)
        names = [(printable(path.name), Token.TEXT) for path in self._files]
        rows = list_rows(names, self._file, height, Token.SELECTED)
        empty = wrap_line(text("scope_page.none_kept"), max(self._list.size.width, 1), Token.DIM)
        self._list.show(rows or empty, text("scope_page.kept", count=len(self._files)))
