"""The views of the page Controller: what each shows, asks for and does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from rich.cells import cell_len

from console.session.data.controller_backups import backups_of
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.controller.errand import Errand
from console.tui.controller.terminal import TerminalView
from console.tui.controller.watching import WatchTable, watch_lines
from console.tui.lines import BLANK, NOTHING, Line, dim, fit_text, line, wrap_line
from console.tui.rows import wrap_problems
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View, refusal
from drivers.errors import ControllerError
from drivers.requests.permitted_lines import RequestKind
from drivers.requests.side_controller import SideController
from drivers.requests.status_words import StatusBit, StatusWords, read_status
from profiles.machine import MachineProfile
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.tui.controller.configuration import Result

STATUS_PERIOD_S = 0.5
BACKUP_ROWS = 5
WORDS = ("TYPE", "VERSION", "DATE", "CID", "CPU", "VID", "SIZE")
_LABEL = 22  # columns

FAULTS = frozenset(
    "negative_limit positive_limit integrated_fatal_error i2t_fault amplifier_fault fatal_following_error "
    "phasing_error stopped_on_limit stopped_on_desired_limit runtime_error circle_radius_error resume_error "
    "interrupt_overrun servo_error watchdog checksum_error dpram_error flash_error interrupt_warning "
    "configuration_error phase_clock_missing fixed_buffer_full abort_input data_block_error "
    "warning_following_error".split()
)
"""Bits that deserve attention where they are set."""

_PLACE = 7  # columns
Cell = tuple[str, str, Token]
"""A bit: its place, its words, how they are shown."""

_SET, _UNSET = "●", "·"


class ViewName(StrEnum):
    """Views in order."""

    IDENTITY = "identity"
    STATUS = "status"
    WATCH = "watch"
    TERMINAL = "terminal"
    CONFIGURATION = "configuration"


VIEWS = tuple(ViewName)
_READS = ("verify", "backup", "diff")


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """What the controller answers; `words` by their names, those that it has. `servo_ms` from I10."""

    words: dict[str, str]
    servo_ms: float


def read_identity(client: SideController) -> Identity:
    """Ask for it. Raises DriverError, as `SideController.query`."""
    words = {}
    for word in WORDS:
        try:
            (answer,) = client.query(word, again=True)
        except ControllerError:  # this family does not have it
            continue
        words[word] = answer.strip()
    (servo,) = client.numbers("I10", again=True)
    return Identity(words=words, servo_ms=servo / 8_388_608.0)


def identity_lines(
    found: Identity | None,
    state: StationState,
    machine: MachineProfile,
    faults: int,
    text: Catalogue,
    width: int,
    client: str = "",
) -> list[Line]:
    """Return the lines, also before anything was answered. `client`: where a terminal comes from, "" for here."""
    controller, values = machine.controller, list[tuple[str, str]]()
    kind = state.controller or NOTHING
    values.append((text("controller_page.identity.controller"), kind))
    values.append((text("controller_page.identity.address"), state.address or NOTHING))
    profile = f"{machine.name}, {controller.family}"
    values.append((text("controller_page.identity.profile"), profile))
    if found is not None:
        values += [
            (text(f"controller_page.identity.{word.lower()}"), answer)
            for word, answer in found.words.items()
            if word not in ("TYPE", "VERSION")
        ]
        servo = f"{found.servo_ms:.4f} ms ({controller.servo_period_ms:.4f} ms)"
        values.append((text("controller_page.identity.servo"), servo))
    link = f"{state.round_trip_ms:.1f} ms"
    values.append((text("controller_page.identity.round_trip"), link))
    values.append((text("controller_page.identity.faults"), str(faults)))
    standing = text("controller_page.identity.controls" if state.controls else "controller_page.identity.observes")
    values.append((text("controller_page.identity.standing"), standing))
    at = text("controller_page.identity.far", client=client) if client else text("controller_page.identity.here")
    values.append((text("controller_page.identity.terminal"), at))
    rows = [line(dim(fit_text(label, _LABEL)), value) for label, value in values]
    return [*rows, BLANK, *commissioned_lines(state, text, width)]


def commissioned_lines(state: StationState, text: Catalogue, width: int) -> list[Line]:
    """Return whether the controller is as it was commissioned, as far as it was compared."""
    settings = state.alignment.settings
    rows = [line((text("controller_page.commissioned"), Token.TITLE))]
    if settings is None:
        return [*rows, line(dim(text("controller_page.settings.unread")))]
    if settings:
        rows += wrap_line(text("controller_page.settings.differ", count=len(settings)), width, Token.WARNING)
        for problem in settings:
            rows += wrap_line("· " + text.problem(problem), width)
    else:
        rows.append(line((text("controller_page.settings.agree"), Token.OK)))
    for problem in state.uncommissioned:
        rows += wrap_line("· " + text.problem(problem), width, Token.WARNING)
    if not state.uncommissioned:
        key = "simulated" if state.simulated else "recorded"
        rows += wrap_line(text(f"controller_page.stops.{key}"), width)
    return rows


def status_lines(words: Sequence[StatusWords], text: Catalogue, width: int, *, all_bits: bool) -> list[Line]:
    """Return each status word with its set bits, or with all; two columns where they fit."""
    rows: list[Line] = []
    for each in words:
        if rows:
            rows.append(BLANK)
        subject = text(f"controller_page.subject.{each.subject}")
        rows.append(line((subject, Token.TITLE), dim(f"  {each.item}  "), each.digits))
        bits = [bit for bit in each.bits if all_bits or bit.is_set]
        cells = [_cell(bit, text) for bit in bits]
        rows += _rows(cells, width)
        if not cells:
            rows.append(line(dim("  " + text("controller_page.no_bit"))))
    return rows


def bit_words(name: str, text: Catalogue) -> str:
    """Return what a bit means, by its name in the tables of the families."""
    axis, _, kind = name.partition("_")
    if len(axis) == 1:
        return text(f"bit.axis_{kind}", axis=axis.upper())
    return text(f"bit.{name}") if name else text("controller_page.unnamed_bit")


def _cell(bit: StatusBit, text: Catalogue) -> Cell:
    token = Token.DIM
    if bit.is_set:
        token = Token.WARNING if bit.name in FAULTS else Token.TEXT
    place = f"{bit.word}.{bit.bit:02d}"
    words = bit_words(bit.name, text)
    return place, f"{_SET if bit.is_set else _UNSET} {words}", token


def _rows(cells: Sequence[Cell], width: int) -> list[Line]:
    """Return two cells a row where both fit beside each other, else one."""
    half = width // 2
    rows: list[Line] = []
    left: Cell | None = None
    for cell in cells:
        if left is not None and _fits(left, half) and _fits(cell, half):
            rows.append((*_pieces(left, half), *_pieces(cell, half)))
            left = None
            continue
        if left is not None:
            rows.append(_pieces(left, width))
        left = cell
    return rows if left is None else [*rows, _pieces(left, width)]


def _fits(cell: Cell, width: int) -> bool:
    return cell_len(cell[1]) < width - _PLACE


def _pieces(cell: Cell, width: int) -> Line:
    place, words, token = cell
    return dim("  " + fit_text(place, _PLACE - 2)), (fit_text(words, max(width - _PLACE, 1)), token)


class ControllerViews:
    """The views with what they know. Whatever is asked is asked in a thread beside the screen."""

    def __init__(self, ui: UiContext) -> None:
        self.view = ViewName.IDENTITY
        self.ui = ui
        self.terminal = TerminalView(ui)
        self.watch = WatchTable(ui.data, ui.machine.machine.name)
        self._identity: Errand[Identity] = Errand()
        self._status: Errand[tuple[StatusWords, ...]] = Errand()
        self._reading: Errand[Result] = Errand()
        self._action = ""
        self._asked_s, self._identified = float("-inf"), ""
        self._backups: tuple[Path, ...] = ()
        self._chosen, self._all_bits = 0, False
        self._tops = dict.fromkeys(ViewName, 0)

    # What the keys do ------------------------------------------------------------------------------------------

    def step(self, by: int) -> None:
        """Show the next or the previous view."""
        self.view = VIEWS[(VIEWS.index(self.view) + by) % len(VIEWS)]
        if self.view is ViewName.CONFIGURATION:
            self._list_backups()

    def move(self, by: int, *, page: bool) -> None:
        """Scroll, or select."""
        if self.view is ViewName.TERMINAL:
            self.terminal.scroll(by)
        elif self.view is ViewName.WATCH:
            self.watch.move(by)
        elif self.view is ViewName.CONFIGURATION and not page:
            self._chosen = max(min(self._chosen + by, len(self._backups) - 1), 0)
        else:
            self._tops[self.view] = max(self._tops[self.view] + by, 0)

    def do(self, word: str) -> None:
        """Do what `why_not` has let through."""
        match word:
            case "enter":
                self._identified = ""
            case "repeat":
                self.terminal.ask_again()
            case "pause":
                self.terminal.pause()
            case "all":
                self._all_bits = not self._all_bits
                self.terminal.polls = not self.terminal.polls
            case "remove":
                self.watch.remove()
            case "cancel":
                self._reading.cancel()
                self.terminal.cancel()
            case _:
                self._read(word)

    def take(self, words: str) -> None:
        """Take what was typed: an item to watch, or a query."""
        side = self.ui.control.side
        if side is None:
            self.ui.say("screen.no_controller")
        elif self.view is ViewName.WATCH:
            self.watch.add(words, side)
        else:
            self.terminal.ask(words)

    def why_not(self, word: str, state: StationState) -> tuple[Problem, ...]:
        """Return why an action cannot be done now."""
        if word == "enter":
            return self._why_not_enter(state)
        if word == "remove":
            shown = self.view is ViewName.WATCH and bool(self.watch.rows)
            return () if shown else (Problem(code="screen.nothing_watched"),)
        if word == "repeat":
            return self.terminal.why_not_again()
        if word == "pause":
            return () if self.view is ViewName.TERMINAL else (Problem(code="screen.terminal_first"),)
        if word == "cancel":
            busy = self._reading.running or self.terminal.running
            return () if busy else (Problem(code="screen.nothing_to_cancel"),)
        return self._why_not_read(word, state) if word in _READS else ()

    def leave(self) -> None:
        """End what is being read; the next visit asks anew."""
        self._reading.cancel()
        self._identified, self._asked_s = "", float("-inf")

    def _why_not_enter(self, state: StationState) -> tuple[Problem, ...]:
        if self.view in (ViewName.STATUS, ViewName.CONFIGURATION):
            return (Problem(code="screen.no_entry_here"),)
        if self.ui.control.side is None or state.activity in (Activity.CONNECTING, Activity.LOST):
            return (Problem(code="screen.no_controller"),)
        if self.view is not ViewName.IDENTITY and (state.may_move or state.seen_moving):
            return (Problem(code="screen.entry_moving"),)
        return ()

    def _why_not_read(self, word: str, state: StationState) -> tuple[Problem, ...]:
        if reasons := refusal(state, f"controller.{word}"):
            return reasons
        if self.ui.control.side is None:
            return (Problem(code="screen.no_controller"),)
        if state.armed is not None:
            return (Problem(code="screen.controller_armed"),)
        if state.seen_moving:
            return (Problem(code="screen.in_motion"),)
        if self._reading.running:
            return (Problem(code="screen.controller_reading"),)
        if word == "diff" and not self._backups:
            return (Problem(code="screen.no_backup"),)
        return ()

    # What is asked ---------------------------------------------------------------------------------------------

    def follow(self, view: View, shown: frozenset[ViewName]) -> None:
        """Take what was answered, and ask for what the shown views need."""
        side, state = self.ui.control.side, view.state
        self._take_reading()
        self.terminal.follow()
        if side is None or state.activity in (Activity.CONNECTING, Activity.LOST):
            return
        if self.view is ViewName.IDENTITY and not self._identity.running and self._identified != state.controller:
            self._identified = state.controller
            asking = SideController(side, RequestKind.QUERY)
            self._identity.start(asking, lambda: read_identity(asking))
        due = view.now_s - self._asked_s >= STATUS_PERIOD_S
        if ViewName.STATUS in shown and not self._status.running and due:
            self._asked_s = view.now_s
            client, machine = SideController(side, RequestKind.QUERY), self.ui.machine.machine
            self._status.start(client, lambda: read_status(client, machine, client.dialect))
        if ViewName.WATCH in shown:
            self.watch.load()
            self.watch.follow(side, state, view.now_s)

    def _read(self, word: str) -> None:
        from console.tui.controller.configuration import ConfigurationReader

        side = self.ui.control.side
        assert side is not None  # `why_not` has seen it
        reader = ConfigurationReader(
            side, self.ui.machine, self.ui.data, self.ui.text, simulated=self.ui.control.state.simulated
        )
        self._list_backups()
        chosen = self._backups[self._chosen] if self._backups else Path()
        works: dict[str, Callable[[], Result]] = {
            "verify": reader.verify,
            "backup": reader.backup,
            "diff": lambda: reader.diff(chosen),
        }
        self._action, self.view = word, ViewName.CONFIGURATION
        self._tops[self.view] = 0
        self._reading.start(reader.client, works[word])

    def _take_reading(self) -> None:
        if not self._reading.has_news:
            return
        self._list_backups()
        if self._reading.cancelled:
            self.ui.say("screen.controller_cancelled")

    def _list_backups(self) -> None:
        before = self._backups[self._chosen : self._chosen + 1]
        self._backups = ()
        with self.ui.answering():
            self._backups = backups_of(self.ui.data, self.ui.machine.machine.name)
        self._chosen = self._backups.index(before[0]) if before and before[0] in self._backups else 0
        if self._reading.found is not None and self._reading.found.action == "backup":
            self._chosen = 0

    # What is shown ---------------------------------------------------------------------------------------------

    def lines(self, shown: ViewName, view: View, width: int, height: int | None) -> list[Line]:
        """Return the lines of a view; all of them without a height."""
        if shown is ViewName.TERMINAL:
            return self.terminal.lines(width, height)
        if shown is ViewName.CONFIGURATION:
            return self._configuration_lines(width, height)
        rows = {
            ViewName.IDENTITY: self._identity_lines,
            ViewName.STATUS: self._status_lines,
            ViewName.WATCH: self._watch_lines,
        }[shown](view, width)
        return rows if height is None else self._window(shown, rows, height)

    def subtitle(self, shown: ViewName) -> str:
        """Return what is said in the frame of a view."""
        if shown is ViewName.TERMINAL:
            return self.terminal.subtitle
        below = self._tops[shown]
        return f"↑ {self.ui.text('jobs_page.above', count=below)}" if below else ""

    def next_words(self, *, typing: bool) -> str:
        """Return the next step of the view."""
        if self._reading.running:
            return self.ui.text("controller_page.next.reading")
        kind = f"typing_{self.view}" if typing else str(self.view)
        return self.ui.text(f"controller_page.next.{kind}")

    def _window(self, shown: ViewName, rows: list[Line], height: int) -> list[Line]:
        top = self._tops[shown] = min(self._tops[shown], max(len(rows) - height, 0))
        return rows[top : top + height]

    def _identity_lines(self, view: View, width: int) -> list[Line]:
        side = self.ui.control.side
        faults = 0 if side is None else side.faults
        machine, found = self.ui.machine.machine, self._identity.found
        rows = identity_lines(found, view.state, machine, faults, self.ui.text, width, self.ui.terminal.client)
        result = self._reading.found
        if result is not None and result.sha256:
            rows += wrap_line(self._hash_words(result), width)
        return [*rows, *wrap_problems(self._identity.problems, self.ui.text, width)]

    def _hash_words(self, result: Result) -> str:
        text, same = self.ui.text, not result.listed
        key = "written" if result.action == "backup" else "same" if same else "differs"
        name = "" if result.path is None else result.path.name
        return text(f"controller_page.hash.{key}", value=result.sha256[:12], name=name)

    def _status_lines(self, view: View, width: int) -> list[Line]:
        found = self._status.found
        if found is None:
            words = self.ui.text("controller_page.unread")
            return [line(dim(words)), *wrap_problems(self._status.problems, self.ui.text, width)]
        rows = status_lines(found, self.ui.text, width, all_bits=self._all_bits)
        return [*wrap_problems(self._status.problems, self.ui.text, width), *rows]

    def _watch_lines(self, view: View, width: int) -> list[Line]:
        rows = watch_lines(self.watch, self.ui.text, view.now_s, width)
        empty = wrap_line(self.ui.text("controller_page.watch.empty"), width, Token.DIM)
        return [*wrap_problems(self.watch.problems, self.ui.text, width), *(rows or empty)]

    def _configuration_lines(self, width: int, height: int | None) -> list[Line]:
        from console.tui.controller.configuration import backup_lines, doing_lines, result_lines

        text, found = self.ui.text, self._reading.found
        rows = [line((text("controller_page.backups", count=len(self._backups)), Token.TITLE))]
        rows += backup_lines(self._backups, self._chosen, text, width, BACKUP_ROWS if height else 1_000)
        rows.append(BLANK)
        if self._reading.running and self.ui.control.side is not None:
            return [*rows, *doing_lines(self._action, self._reading, self.ui.control.side, text, width)]
        rows += wrap_problems(self._reading.problems, self.ui.text, width)
        below = [] if found is None or self._reading.problems else result_lines(found, text, width)
        if found is None and not self._reading.problems:
            below = wrap_line(text("controller_page.nothing_read"), width, Token.DIM)
        if height is None:
            return [*rows, *below]
        return [*rows, *self._window(ViewName.CONFIGURATION, below, max(height - len(rows), 1))]
