"""Application, composition only: six rows, one page between them, one gate for every key, one tick."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from textual import events
from textual.app import App, ComposeResult
from textual.containers import Container
from textual.driver import Driver

from console.session.station.commands import Control
from console.session.station.session_log import SessionLog
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.alarms.logged_control import LoggedControl
from console.tui.collector import Collector
from console.tui.driver import Scanned, StopSent, TooFast, Written
from console.tui.frame import ROWS, Frame, frame_rows, small_rows
from console.tui.gate import FieldKind, HeldKeys, Situation, Verdict, is_page, is_stray, judge, stop_reason
from console.tui.keymap import READING, TAKE, Action, PageName
from console.tui.layout import CSS, SMALLEST, cramped, is_small
from console.tui.lines import Line, Sheet
from console.tui.list_panel import MESSAGES, PAGE, ListPanel
from console.tui.page import Page
from console.tui.page_class import page_class
from console.tui.palette_keys import PaletteKeys
from console.tui.previewing import ChosenPath, Previewer, fault_of
from console.tui.scanning.scans import Scans
from console.tui.standing_orders import StandingOrders
from console.tui.theme import COLOUR, DARK_THEME, MONO_THEME, Palette
from console.tui.ui_context import UiContext, View
from profiles.files import printable
from profiles.job import Job
from profiles.problem import Problem
from profiles.store import LoadedMachine

TICK_S = 0.1
SETTLED_S = 1.0  # time after the last command until a poll shows whether it causes motion


class ConsoleApp(App[None]):
    """The console of one machine. `begin` is called after the first paint, `heard` with the name of each key.

    The rest is for screenshots.
    """

    CSS = CSS
    ENABLE_COMMAND_PALETTE = False
    HORIZONTAL_BREAKPOINTS = [(0, "-narrow"), (100, "-medium"), (160, "-wide")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-low"), (30, "-mid"), (48, "-tall")]  # noqa: RUF012

    def __init__(
        self,
        *,
        text: Catalogue,
        palette: Palette,
        control: Control,
        machine: LoadedMachine,
        data: Path,
        begin: Callable[[], None] = lambda: None,
        heard: Callable[[str], object] = lambda key: None,
        local_time: Callable[[], datetime] = datetime.now,
        ticking: bool = True,
        driver_class: type[Driver] | None = None,
    ) -> None:
        # Without colour, Textual must know before it chooses its filters to use the terminal's own colours.
        super().__init__(driver_class=driver_class, ansi_color=None if palette is COLOUR else True)
        theme = DARK_THEME if palette is COLOUR else MONO_THEME
        self.register_theme(theme)
        self.theme = theme.name
        self.title = f"SIM {machine.machine.name}" if control.state.simulated else machine.machine.name
        self._logs, self._typed = LoggedControl(control, local_time), False
        self.ui = UiContext(text=text, palette=palette, control=self._logs, machine=machine, data=data, go=self.go)
        self._begin, self._heard = begin, heard
        self._ui_loop: asyncio.AbstractEventLoop | None = None
        self._leaving, self._collector = False, Collector()
        self.fault: Exception | None = None
        self._local_time, self._ticking = local_time, ticking
        self._pages: dict[PageName, Page] = {}
        self._page = PageName.JOBS
        self._given_up: Job | None = None
        self._dismissed: tuple[Problem, ...] = ()
        self._acted_s = float("-inf")
        self._orders = StandingOrders(self.ui)
        self._held, self._scans = HeldKeys(), Scans(self.ui, lambda: self._made(PageName.JOBS))
        self._previewer, self._path = Previewer(), ChosenPath()
        self._rows = {name: Sheet(palette, id=f"row-{name}", classes="row") for name in ROWS}
        self._list = ListPanel(palette, text)
        self._palette = PaletteKeys(self.ui, self._list, self._why_not)
        self._small = Sheet(palette, id="small")

    def compose(self) -> ComposeResult:
        """Return the rows with the first page between them."""
        yield from (self._rows[name] for name in ("state", "alarm", "pages"))
        with Container(id="body"):
            yield self._made(PageName.JOBS)
            yield self._list
        yield from (self._rows[name] for name in ("next", "stop", "keys"))
        yield self._small

    def on_mount(self) -> None:
        """Start the tick timer."""
        self._ui_loop = asyncio.get_running_loop()
        if self._leaving:
            self.exit()
        if self._ticking:
            self.set_interval(TICK_S, self.tick)
        self.tick()
        self.call_after_refresh(self._first_paint)

    def _first_paint(self) -> None:
        self.tick()  # the size of the page is known now
        self.call_after_refresh(self._begin)

    def leave_soon(self) -> None:
        """Leave the screen; may be called from a signal handler, at any moment."""
        self._leaving = True
        if self._ui_loop is not None:
            self._ui_loop.call_soon_threadsafe(self.exit)

    def tick(self) -> None:
        """Show the newest state; the only place where anything live is drawn."""
        ui = self.ui
        ui.control.beat()
        state = ui.control.state
        self._collector.spare(state.may_move)
        if self._list.is_palette and ui.answers(self._orders.why_not("palette")):
            self._list.open(PAGE)
        ui.forget_stale_answer(state)
        ui.log = self.log_of(state)
        # The link thread loads the numerics before it reads the settings; any page but the first needs them.
        loaded = state.alignment.settings is not None or self._page is not PageName.JOBS
        if ui.work is not None and loaded:
            path = self._path.of(ui.work, state.alignment, simulated=state.simulated)
            ui.work = self._previewer.refreshed(ui.work, state.alignment, path=path)
        self.screen.set_class(self._is_small, "small")
        view = View(state=state, work=ui.work, now_s=ui.control.now_s())
        page = self._pages[self._page]
        if self._is_small:
            self._small.show(self.small_rows(state))
            return
        if not self._list.is_open and page.size.area:  # before the first layout no panel knows its room
            page.fit()
            self._safely(lambda: page.show(view))
        self._safely(lambda: self._show_frame(page, view))

    def go(self, name: PageName) -> None:
        """Show another page."""
        before = self._pages[self._page]
        if name is not self._page:
            before.leave()
            before.add_class("-away")
            self._page = name
            page = self._made(name)
            page.remove_class("-away")
            if not page.is_attached:
                self.query_one("#body").mount(page)
        self._list.open(PAGE)
        self.call_after_refresh(self.tick)

    def situation(self) -> Situation:
        """Return what a key is judged by now. Also called from the thread that reads the terminal."""
        state = self.ui.control.state
        return Situation(
            page=self._page,
            field=self._field,
            moving=state.may_move or self.ui.queued,
            small=self._is_small,
            jogging=state.activity is Activity.JOGGING or self.ui.queued,
            jog=self.ui.jog,
            reading=self._list.is_open,
            at_rest=self._is_known_at_rest,
            seeking=self._list.is_palette,
        )

    @property
    def _field(self) -> FieldKind:
        if self._list.is_palette:  # in any doubt about motion Space stops
            return FieldKind.TEXT if self._is_known_at_rest else FieldKind.NONE
        page = self._pages.get(self._page)
        return FieldKind.NONE if page is None else page.field

    @property
    def _is_known_at_rest(self) -> bool:
        """Whether nothing moves, nor will by a command that the machine has not begun yet."""
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        if state.activity is Activity.CONNECTING:
            return True
        settled = now_s - self._acted_s > SETTLED_S and not state.is_stale(now_s)
        return settled and not (state.seen_moving or state.may_move or self.ui.queued)

    def stop_now(self, reason: str) -> None:
        """Stop the machine. Also called from the thread that reads the terminal."""
        self.ui.stop(reason)

    def kill_now(self, reason: str) -> None:
        """Open every loop of the machine. Also called from the thread that reads the terminal."""
        self.ui.kill(reason)

    async def on_event(self, event: events.Event) -> None:
        """Judge every key before any widget sees it."""
        if isinstance(event, events.Key) and not event.is_forwarded:
            written = self._field is FieldKind.TEXT and event.is_printable
            self._heard("…" if written else event.key)  # what is written in free text is nobody's business
            if self._took(event):
                return
        elif isinstance(event, events.Paste) and not event.is_forwarded and self._field is not FieldKind.TEXT:
            self._scans.pasted(moving=self.situation().moving)
            self.call_after_refresh(self.tick)
            return
        await super().on_event(event)

    def on_stop_sent(self, sent: StopSent) -> None:
        """Show a stop at once after it was sent."""
        if sent.action is not None:
            self._say_changed(sent.action)
        self.tick()

    def on_too_fast(self, keys: TooFast) -> None:
        """Handle keys that came too fast to be typed."""
        self._scans.too_fast(written=keys.written, stopped=keys.stopped)
        self.tick()

    def on_scanned(self, scanned: Scanned) -> None:
        """Handle what such keys were."""
        self._safely(lambda: self._scans.take(scanned.scan, small=self._is_small))
        self.tick()

    def action_quit(self) -> None:  # type: ignore[override]
        """Leave, unless something moves."""
        state, work = self.ui.control.state, self.ui.draft or self.ui.work
        unsaved = work is not None and work.edited and work.job is not self._given_up
        if state.moving:
            self.ui.say("screen.quit_moving")
        elif work is not None and unsaved:
            self._given_up = work.job
            self.ui.say("screen.quit_unsaved", value=work.job.name or self.ui.text("setup.new_title"))
        else:
            self.exit()

    @property
    def page(self) -> PageName:
        """The page in front of the operator."""
        return self._page

    @property
    def _is_small(self) -> bool:
        return is_small(self.size)

    def _made(self, name: PageName) -> Page:
        if name not in self._pages:
            self._pages[name] = page_class(name)(self.ui)
        return self._pages[name]

    def _show_frame(self, page: Page, view: View) -> None:
        state = view.state
        if state.refusals is self._dismissed:  # answers to an earlier key
            state = replace(state, refusals=())
        frame = Frame(
            text=self.ui.text,
            state=state,
            machine=self.ui.machine.machine,
            page=self._page,
            field=self.situation().field,
            next_step=page.next_step(view),
            said=self.ui.said,
            clock=self._local_time(),
            now_s=view.now_s,
            job="" if view.work is None else printable(view.work.job.name),
        )
        width = max(self.size.width - 2, 1)
        if self._list.is_palette:
            self._palette.offer(self._page)
        if self._list.is_open:
            self._list.lay_open(frame, page.in_full(view, width), width)
        self._show_rows(self.rows_of(frame))

    def log_of(self, state: StationState) -> SessionLog:
        """Return the log of the session up to this state."""
        return self._logs.followed(state, self.ui.said, typed=self._typed)

    def rows_of(self, frame: Frame) -> dict[str, list[Line]]:
        """Return the rows around the page."""
        return frame_rows(frame, self.size.width, self.size.height)

    def small_rows(self, state: StationState) -> list[Line]:
        """Return what a terminal shows that is too small for a page."""
        return small_rows(self.ui.text, state, SMALLEST, max(self.size.width, 1))

    def _show_rows(self, rows: dict[str, list[Line]]) -> None:
        """Show the rows; a longer or shorter message changes the size of the page, which is filled again."""
        moved = False
        for name, lines in rows.items():
            sheet = self._rows[name]
            if len(lines) != max(len(sheet.lines), 1):
                sheet.styles.height = len(lines)
                moved = True
            sheet.show(lines)
        if moved:
            self.call_after_refresh(self.tick)

    def _took(self, event: events.Key) -> bool:
        """Perform the action of a key; False when the key belongs to the focused field."""
        page = self._pages[self._page]
        now = self.situation()
        self._typed = now.field is FieldKind.TEXT
        verdict, action = judge(event.key, event.character, now)
        page.heard(None if action is None else action.id)
        if event.key in TAKE.keys and self._palette.still_taking():
            verdict, action = Verdict.NOTHING, None
        match verdict:
            case Verdict.FIELD if now.seeking:
                self._palette.write(event.key, event.character)
            case Verdict.FIELD:
                return False
            case Verdict.ACTION if action is TAKE:
                self._palette.take(self._page, lambda taken: self._do(taken, page))
            case Verdict.STOP if isinstance(event, Written) and event.stopped:
                pass  # stopped by the thread that read it; here it is part of the number it interrupts
            case Verdict.STOP if action is None or not is_page(action):
                self.stop_now(stop_reason(event.key, event.character, action))
                if action is not None:
                    self._say_changed(action)
            case Verdict.KILL:
                self.kill_now(event.key)
            case Verdict.ACTION if isinstance(event, Written):
                self.ui.say("screen.entry_over")
            case Verdict.ACTION if action is not None and (action.id == "messages" or action in READING):
                self._list.read(action, event.key)  # what was said stays said: it is to be read
            case Verdict.ACTION | Verdict.STOP if action is not None:
                self.ui.said = ()
                self._dismissed = self.ui.control.state.refusals
                self._do(action, page)
        self.call_after_refresh(self.tick)
        if stray := is_stray(event.key, event.character, now):
            self.ui.say("screen.not_of_a_number", value=event.character or "")
        return not stray

    def _say_changed(self, action: Action) -> None:
        if not is_page(action):
            self.ui.say_until_key(Problem(code="screen.key_in_motion", key=action.shown))

    def _do(self, action: Action, page: Page) -> None:
        now_s = self.ui.control.now_s()
        repeats = self._held.repeats(action, now_s)
        if self.ui.answers(cramped(action, self.size)):
            return
        if repeats:
            self.ui.say("screen.key_repeats")
            return
        match action.id.split("."):
            case ["page", name]:
                self.go(PageName(name))
            case ["palette"]:
                if not self.ui.answers(self._orders.why_not("palette")):
                    self._list.search()
            case ["help"]:
                self._list.step()
            case ["close"]:
                self._list.open(PAGE)
            case ["quit"]:
                self.action_quit()
            case ["recover"]:
                self._acted_s = now_s
                self._orders.recover()
            case ["acknowledge"]:
                self._orders.acknowledge(all_of_them=self._list.shown == MESSAGES, chosen=page.chosen_alarm)
            case ["take_over"]:
                self._orders.take_control()
            case _:
                self._list.open(PAGE)
                self._acted_s = now_s
                self._safely(lambda: page.act(action.id))

    def _why_not(self, action: Action) -> tuple[Problem, ...]:
        """Return why an action cannot be done now: what its key would answer."""
        if action.page is None:
            return self._orders.why_not(action.id)
        return cramped(action, self.size) or self._made(action.page).why_not(action.id, self.ui.view)

    def _safely(self, work: Callable[[], None]) -> None:
        """Run an operation of one page. Its faults stay its own: the rows, the stop and the machine continue."""
        try:
            with self.ui.answering():
                work()
        except Exception as fault:
            self.ui.said = (fault_of(fault),)

    def _handle_exception(self, error: Exception) -> None:
        """Leave without a traceback (Textual has no public hook); `fault` is reported in one line afterwards."""
        self.fault = self.fault or error
        self.exit(return_code=1)
