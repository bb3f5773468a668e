"""Application, composition only: six rows, one page between them, one gate for every key, one tick."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from textual import events
from textual.app import ComposeResult
from textual.containers import Container
from textual.driver import Driver

from console.session.appearance import Appearance
from console.session.configuration import Configuration
from console.session.errors import fault_problem
from console.session.station.history.session_log import LogEntry, SessionLog
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.application.bell import Bell, LastDrawing
from console.tui.application.far_terminal import FarTerminal
from console.tui.application.key_releases import ReportedKey
from console.tui.application.listening import ListeningApp
from console.tui.application.logged_control import LoggedControl
from console.tui.application.pointing import point
from console.tui.application.scans import Scans
from console.tui.driver import Written
from console.tui.frame import Frame, small_rows
from console.tui.frame_rows import FrameRows, MadeRows
from console.tui.gate import (
    FieldKind,
    HeldKeys,
    KeyDecision,
    KeySituation,
    is_page,
    is_stray,
    judge,
    known_at_rest,
    stop_reason,
)
from console.tui.keymap import MODULES, MOTION_PAGES, NUMBERED, READING, TAKE, Action, PageName
from console.tui.lines import Line, Sheet
from console.tui.list_panel import MESSAGES, PAGE, ListPanel
from console.tui.page import CSS, SMALLEST, Page, find_size_problems, is_small
from console.tui.palette_keys import PaletteKeys
from console.tui.previewing import ChosenPath, Previewer
from console.tui.standing_orders import StandingOrders
from console.tui.theme import Palette
from console.tui.ui_context import UiContext, View
from profiles.files import printable
from profiles.problem import Problem
from profiles.store import LoadedMachine

if TYPE_CHECKING:
    from console.session.station.commands import Control  # not for the first paint

TICK_S = 0.1
NEVER = 1_000_000_000


def page_class(name: PageName) -> type[Page]:
    """Return `JobsPage` for jobs; pages with a digit are in `pages`, most others in `further`."""
    module = MODULES.get(name, f"console.tui.{'pages' if name in NUMBERED else 'further'}.{name}")
    found: type[Page] = getattr(import_module(module), f"{name.capitalize()}Page")
    return found


class GarbageCollector:
    """Collect only young objects while something moves: a full collection would delay a key by 0.1 s.

    What is there when the motion begins is set aside; what outlives the young ones is collected when it has ended.
    """

    def __init__(self) -> None:
        self._spared = False
        self._thresholds = gc.get_threshold()

    def begin(self) -> None:
        """Collect from now on: the first picture is there, up to which `console.__main__` has switched it off."""
        gc.enable()

    def spare(self, may_move: bool) -> None:
        """Take notice of whether something may move."""
        if may_move is self._spared:
            return
        self._spared = may_move
        if may_move:
            gc.freeze()
            gc.set_threshold(*self._thresholds[:2], NEVER)
        else:
            gc.unfreeze()
            gc.set_threshold(*self._thresholds)


class ConsoleApp(ListeningApp):
    """The console of one machine. `begin` is called after the first paint, `heard` with the name of each key.

    `client` is the address that its terminal comes from by SSH, "" for one at this computer. `noted` gets the new
    entries of its log. `onlookers` are called before each timed tick, whatever becomes of it; `followers` with
    each new state.
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
        appearance: Appearance | None = None,
        configuration: Configuration | None = None,
        client: str = "",
        noted: Callable[[Sequence[LogEntry]], None] = lambda entries: None,
    ) -> None:
        appearance = appearance or Appearance(language=text.language)
        super().__init__(palette, appearance, driver_class)
        text, palette = self.look.text, self.look.palette
        self.title = f"SIM {machine.machine.name}" if control.state.simulated else machine.machine.name
        self.logs, self._typed = LoggedControl(control, local_time, noted), False
        self.onlookers, self.followers = list[Callable[[], None]](), list[Callable[[], None]]()
        self.ui = UiContext(text=text, palette=palette, control=self.logs, machine=machine, data=data, go=self.go)
        self.ui.appearance, self.ui.appear, self.ui.configuration = appearance, self.appear, configuration
        self.ui.terminal = FarTerminal(client)
        self._begin, self.heard = begin, heard
        self._collector, self._calm, self._bell = GarbageCollector(), LastDrawing(), Bell()
        self._local_time, self._ticking = local_time, ticking
        self._pages: dict[PageName, Page] = {}
        self._page = PageName.JOBS
        self._dismissed: tuple[Problem, ...] = ()
        self._acted_s = float("-inf")
        self._orders = StandingOrders(self.ui)
        self._held, self.scans = HeldKeys(), Scans(self.ui, lambda: self._make_page(PageName.JOBS))
        self._previewer, self._path = Previewer(), ChosenPath()
        self._rows, self._made_rows = FrameRows(palette), MadeRows()
        self._list = ListPanel(palette, text)
        self._palette = PaletteKeys(self.ui, self._list, self._why_not)
        self._small = Sheet(palette, id="small")

    def compose(self) -> ComposeResult:
        """Return the rows with the first page between them."""
        yield from self._rows.find_sheets(FrameRows.ABOVE)
        with Container(id="body"):
            yield self._make_page(PageName.JOBS)
            yield self._list
        yield from self._rows.find_sheets(FrameRows.BELOW)
        yield self._small

    def on_mount(self) -> None:
        """Start the tick timer."""
        super().on_mount()
        if self._ticking:
            self.set_interval(TICK_S, self._timed_tick)
        self.tick()
        self.call_after_refresh(self._first_paint)

    def _first_paint(self) -> None:
        self._collector.begin()
        self.tick()  # the size of the page is known now
        self.call_after_refresh(self._begin)

    def _timed_tick(self) -> None:
        for each in self.onlookers:
            self.safely(each)
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        shown = (self._page, self._list.shown, self.ui.key_answer, self.size)
        if self.ui.appearance.calm == "off" or self._calm.is_due(state, now_s, shown):
            self.tick()
        else:
            self.ui.control.beat()

    def tick(self) -> None:
        """Show the newest state; the only place where anything live is drawn."""
        ui = self.ui
        ui.control.beat()
        state = ui.control.state
        self._collector.spare(state.may_move)
        self.offer_mouse(self.ui.appearance.mouse == "on" and self._is_known_at_rest)
        if self._bell.rings(state.alarms, ui.control.now_s()) and ui.appearance.bell == "on":
            self.bell()
        ui.releases = self.offer_releases(self._page is PageName.ALIGN and not self._is_small)
        if self._list.is_palette and ui.answers(self._orders.why_not("palette")):
            self._list.open(PAGE)
        ui.forget_stale_answer(state)
        if self._page in MOTION_PAGES:
            self.say_slow_line(getattr(self._driver, "age", None))
        ui.log = self.log_of(state)
        for each in self.followers:
            each()
        # The link thread loads the numerics before it reads the settings; any page but the first needs them.
        loaded = state.alignment.settings is not None or self._page is not PageName.JOBS
        if ui.work is not None and loaded:
            path = self._path.path_for(ui.work, state.alignment, simulated=state.simulated)
            ui.work = self._previewer.refresh_work(ui.work, state.alignment, path=path)
        self.screen.set_class(self._is_small, "small")
        view = View(state=state, work=ui.work, now_s=ui.control.now_s())
        page = self._pages[self._page]
        if self._is_small:
            self._small.show(self.small_rows(state))
            return
        if not self._list.is_open and page.size.area:  # before the first layout no panel knows its room
            page.fit()
            self.safely(lambda: page.show(view))
        self.safely(lambda: self._show_frame(page, view))

    def go(self, name: PageName) -> None:
        """Show another page."""
        before = self._pages[self._page]
        if name is not self._page:
            before.leave()
            before.add_class("-away")
            self._page = name
            page = self._make_page(name)
            page.remove_class("-away")
            if not page.is_attached:
                self.query_one("#body").mount(page)
        self._list.open(PAGE)
        self.call_after_refresh(self.tick)

    def appear(self, appearance: Appearance) -> None:
        """Show everything in another appearance, from now on; pages in another language or unit are made again."""
        before, self.ui.appearance = self.ui.appearance, appearance
        if (appearance.language, appearance.units) != (before.language, before.units):
            for name in [name for name in self._pages if name is not self._page]:
                self._pages.pop(name).remove()
        self.dress(appearance)
        self.call_after_refresh(self.tick)

    def situation(self) -> KeySituation:
        """Return what a key is judged by now. Also called from the thread that reads the terminal."""
        state = self.ui.control.state
        return KeySituation(
            page=self._page,
            field=self._field,
            moving=state.may_move or self.ui.queued,
            small=self._is_small,
            jogging=state.activity is Activity.JOGGING or self.ui.queued,
            jog=self.ui.jog,
            reading=self._list.is_open,
            at_rest=self._is_known_at_rest,
            seeking=self._list.is_palette,
            own=self.ui.appearance.keys,
        )

    @property
    def _field(self) -> FieldKind:
        if self._list.is_palette:  # in any doubt about motion Space stops
            return FieldKind.TEXT if self._is_known_at_rest else FieldKind.NONE
        page = self._pages.get(self._page)
        return FieldKind.NONE if page is None else page.field

    @property
    def _is_known_at_rest(self) -> bool:
        state, now_s = self.ui.control.state, self.ui.control.now_s()
        return known_at_rest(state, now_s, self._acted_s, queued=self.ui.queued)

    def put_down(self) -> None:
        """Take back what the page in front was enabled or armed for."""
        self._pages[self._page].leave()
        self.ui.queued = False

    def action_quit(self) -> None:  # type: ignore[override]
        """Leave, unless something moves."""
        if self._orders.may_quit():
            self.exit()

    def perform_click(self, event: events.MouseEvent) -> None:
        """Do what a click or the wheel asks for."""
        page, now = self._pages[self._page], self.situation()
        self.safely(lambda: point(event, self.screen, page, now, self._press))

    @property
    def page(self) -> PageName:
        """The page in front of the operator."""
        return self._page

    @property
    def _is_small(self) -> bool:
        return is_small(self.size)

    def _make_page(self, name: PageName) -> Page:
        if name not in self._pages:
            self._pages[name] = page_class(name)(self.ui)
        return self._pages[name]

    def _show_frame(self, page: Page, view: View) -> None:
        state = view.state
        if state.refusals and state.refusals is self._dismissed:  # answers to an earlier key
            state = replace(state, refusals=())
        frame = Frame(
            text=self.ui.text,
            state=state,
            machine=self.ui.machine.machine,
            page=self._page,
            field=self._field,
            next_step=page.next_step(view),
            said=self.ui.key_answer,
            clock=self._local_time(),
            now_s=view.now_s,
            job="" if view.work is None else printable(view.work.job.name),
            jobs=self.ui.jobs,
            own=self.ui.appearance.keys,
            silent=self.ui.appearance.bell == "off",
            client=self.ui.terminal.client,
            keys=page.keys,
        )
        width = max(self.size.width - 2, 1)
        if self._list.is_palette:
            self._palette.offer(self._page)
        if self._list.is_open:
            self._list.lay_open(frame, page.in_full(view, width), width)
        if self._rows.show(self.rows_of(frame)):
            self.call_after_refresh(self.tick)  # the page is filled again

    def log_of(self, state: StationState) -> SessionLog:
        """Return the log of the session up to this state."""
        return self.logs.follow_state(state, self.ui.key_answer, typed=self._typed)

    def rows_of(self, frame: Frame) -> dict[str, list[Line]]:
        """Return the rows around the page."""
        return self._made_rows.frame_lines(frame, self.size.width, self.size.height)

    def small_rows(self, state: StationState) -> list[Line]:
        """Return what a terminal shows that is too small for a page."""
        return small_rows(self.ui.text, state, SMALLEST, max(self.size.width, 1))

    def perform_key(self, event: events.Key) -> bool:
        """Perform the action of a key; False when the key belongs to the focused field."""
        page = self._pages[self._page]
        now = self.situation()
        self._typed = now.field is FieldKind.TEXT
        self.ui.stroke = event.stroke if isinstance(event, ReportedKey) else None
        verdict, action = judge(event.key, event.character, now)
        page.note_action(None if action is None else action.id)
        if event.key in TAKE.keys and self._palette.still_taking():
            verdict, action = KeyDecision.NOTHING, None
        if verdict is KeyDecision.FIELD and not now.seeking:
            self._held.note_typed_character()
            return False
        self._answer(event, verdict, action)
        self.call_after_refresh(self.tick)
        if stray := is_stray(event.key, event.character, now):
            self.ui.say("screen.not_of_a_number", value=event.character or "")
        return not stray

    def _answer(self, event: events.Key, verdict: KeyDecision, action: Action | None) -> None:
        match verdict:
            case KeyDecision.FIELD:
                self._palette.write(event.key, event.character)
            case KeyDecision.ACTION if action is TAKE:
                page = self._pages[self._page]
                self._palette.take(self._page, lambda taken: self._do(taken, page))
            case KeyDecision.STOP if isinstance(event, Written) and event.stopped:
                pass  # stopped by the thread that read it; here it is part of the number it interrupts
            case KeyDecision.STOP if action is None or not is_page(action):
                self.stop_now(stop_reason(event.key, event.character, action))
                if action is not None:
                    self.say_changed(action)
            case KeyDecision.KILL:
                self.kill_now(event.key)
            case KeyDecision.ACTION if isinstance(event, Written):
                self.ui.say("screen.entry_over")
            case KeyDecision.ACTION if action is not None and (action.id == "messages" or action in READING):
                self._list.read(action, event.key)  # what was said stays said: it is to be read
            case KeyDecision.ACTION | KeyDecision.STOP if action is not None:
                self._press(action)

    def _press(self, action: Action) -> None:
        """Perform the action of a key or of the mouse, which is answered anew."""
        if action in READING:
            self._list.read(action)
            return
        self.ui.key_answer = ()
        self._dismissed = self.ui.control.state.refusals
        self._do(action, self._pages[self._page])

    def _do(self, action: Action, page: Page) -> None:
        now_s = self.ui.control.now_s()
        repeats = self._held.repeats(action, now_s)
        if self.ui.answers(find_size_problems(action, self.size)):
            return
        if repeats:
            self.ui.say("screen.key_repeats")
            return
        orders, reading = self._orders, self._list.shown == MESSAGES
        of_any_page: dict[str, Callable[[], object]] = {
            "palette": self._search,
            "help": self._list.step,
            "close": lambda: self._list.open(PAGE),
            "quit": self.action_quit,
            "recover": orders.recover,
            "acknowledge": lambda: orders.acknowledge(all_of_them=reading, chosen=page.chosen_alarm),
            "take_over": orders.take_control,
        }
        if action.id == "recover" or not (action.id in of_any_page or is_page(action)):
            self._acted_s = now_s
        if action.id in of_any_page:
            of_any_page[action.id]()
        elif is_page(action):
            self.go(PageName(action.id.removeprefix("page.")))
        else:
            self._list.open(PAGE)
            self.safely(lambda: page.act(action.id))

    def _search(self) -> None:
        if not self.ui.answers(self._orders.why_not("palette")):
            self._list.search()

    def _why_not(self, action: Action) -> tuple[Problem, ...]:
        """Return why an action cannot be done now: what its key would answer."""
        if action.page is None:
            return self._orders.why_not(action.id)
        return find_size_problems(action, self.size) or self._make_page(action.page).why_not(
            action.id, self.ui.view
        )

    def safely(self, work: Callable[[], None]) -> None:
        """Run an operation of one page. Its faults stay its own: the rows, the stop and the machine continue."""
        try:
            with self.ui.answering():
                work()
        except Exception as fault:
            self.ui.key_answer = (fault_problem(fault),)
