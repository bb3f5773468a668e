"""Start and end of the screens: from the command line to the first page, and out with the machine at rest."""

from __future__ import annotations

import math
import os
import signal
import sys
import time
from argparse import Namespace
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext, suppress
from dataclasses import replace
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Protocol

from console.cli.library import along_as_there, data_of, machine_of, simulated_address
from console.escaping import CELLS
from console.flight.notes import Inbox, NoteKind
from console.flight.recorded_control import RecordedControl
from console.rings import SCHOOL
from console.session.alarm_notes import AlarmNotes
from console.session.appearance import Appearance, appearance_of
from console.session.configuration import KEYS, Configuration
from console.session.data.calibrated_chuck import calibrated_or_stated
from console.session.ending_signal import has_come
from console.session.errors import SessionError
from console.session.station.link_thread import LinkThread
from console.session.station.machine_address import address_of
from console.session.station.state import StationState
from console.session.terminal_place import remote_client
from console.text.catalogue import Catalogue
from console.tui.app import ConsoleApp
from console.tui.driver import StopDriver
from console.tui.keymap import PageName
from console.tui.theme import COLOUR, COLOUR_VARIABLE, MONO
from drivers.clock import TrainingClock
from drivers.ending_signals import ENDING_SIGNALS
from drivers.link.address import LinkAddress, SimulatedAddress
from drivers.link.tracing import Tracing
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedMachine

if TYPE_CHECKING:
    from console.flight.recorder import FlightRecorder
    from console.session.feed.observed_state import ObservedState
    from console.session.feed.server import FeedServer
    from console.session.station.link.opening import OpenMachine
    from console.session.station.state import SessionStart
    from console.tui.ui_context import UiContext

WRONG_USAGE = 2
QUIET_S = 2.0  # time after the end of the screen until a wait for the machine is reported
COAST_LIMIT_S = 75.0  # time limit for proving a machine at rest after the screen has ended
ENDING_LIMIT_S = 8.0  # the same after a signal: a supervisor kills this process after ten seconds
WAIT_S = 0.1

SWITCH_INTERVAL_S = 0.0005
"""Longest time for the drawing thread to keep the interpreter while the link waits: watchdog and polls first."""


class SchoolSession(Protocol):
    """A session of the school: what the screens begin with in place of their own, and who follows them."""

    machine: LoadedMachine | None
    address: SimulatedAddress | None
    begins: SessionStart | None

    def attend(self, app: ConsoleApp, link: LinkThread, data: Path) -> AbstractContextManager[None]:
        """Follow the screens, until they end."""

    def keep(self, app: ConsoleApp) -> None:
        """Keep what is left of it."""


class ScreenFeed:
    """The feed of the screens, from `launch`, after the first paint, to `close`; its thread reads by reference."""

    def __init__(self, link: LinkThread, machine: LoadedMachine, data: Path) -> None:
        self._link, self._machine, self._data = link, machine.machine, data
        self._server: FeedServer | None = None

    def launch(self, ui: UiContext, state: Callable[[], StationState]) -> None:
        """Begin to publish; returns at once."""
        from console.session.feed.server import FeedServer  # not for the first paint

        self._server = FeedServer(self._data, lambda: self._observe_state(ui, state()))
        self._server.launch()

    def close(self) -> tuple[Problem, ...]:
        """End it; return why nothing was published, if so."""
        if self._server is None:
            return ()
        self._server.close()
        return self._server.problems

    def _observe_state(self, ui: UiContext, state: StationState) -> ObservedState:
        from console.session.feed.observed_state import ObservedState

        work, standing = ui.work, ui.log.alarms.standing
        return ObservedState(
            state=state,
            machine=self._machine,
            now_s=self._link.now_s(),
            job=None if work is None else work.job.name,
            work=work,
            run_id=self._link.run_id,
            parts=self._link.parts,
            numbers={(entry.problem.code, entry.problem.key): entry.number for entry in standing},
        )


def main(options: Namespace, text: Catalogue) -> int:
    """Run the screen; return the exit code.

    Raises:
        ProblemError: no machine to open, no terminal, or a profile that cannot be used.
    """
    _take_terminal()
    data = data_of(options)
    schooling = None if options.from_file is None else _school().taken_up(options, data, text)
    taken = None if schooling is None else schooling.machine
    machine = calibrated_or_stated(machine_of(options), data) if taken is None else taken
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    address = address_of(machine.machine, options.link, simulated=options.sim)
    trained = None if options.instructor is None else TrainingClock()
    inbox = Inbox(time.monotonic if trained is None else trained.now_s)
    trace = None if options.trace is None else Path(options.trace)
    tracing = Tracing(trace, f"console {machine.machine.name}", inbox.put)
    simulated = isinstance(address, SimulatedAddress)
    requested = simulated_address(options, machine.machine)
    if wrong := _wrong_usage(options, requested, simulated=simulated):
        print(f"console: {text(wrong)}", file=sys.stderr)
        return WRONG_USAGE
    if schooling is None and (options.lesson is not None or options.instructor is not None):
        schooling = _school().schooling(options, data, text)
    # The lathe that was asked for, with its next part: only that of a lesson starts over each time.
    place: LinkAddress = address if requested is None else replace(requested, goes_on=True)
    begins = None
    if schooling is not None:
        place, begins = schooling.address or place, schooling.begins
    machine = along_as_there(machine, place)
    appearance = _appearance(options.configuration, text)
    link = LinkThread(
        machine.machine.name,
        simulated,
        lambda: _open(machine, place, data, tracing, begins, trained),
        clock=trained,
    )
    feed, notes = ScreenFeed(link, machine, data), AlarmNotes(data, machine.machine.name, simulated=simulated)
    looks = (text, appearance, options.configuration)
    app, control = _build_recorded_screens(link, inbox, machine, data, looks, feed, notes)
    with closing(notes), nullcontext() if schooling is None else schooling.attend(app, link, data):
        return _run(link, app, control, tracing, feed, schooling)


def _school() -> Any:
    """Return the school; its options are there only where it is installed."""
    return import_module(f"{SCHOOL}.schooling")


def _run(
    link: LinkThread,
    app: ConsoleApp,
    control: RecordedControl,
    tracing: Tracing,
    feed: ScreenFeed,
    schooling: SchoolSession | None,
) -> int:
    """Run the screens to their end, and leave the machine; return the exit code."""
    ending = _Ending(link, app)
    ending.install()
    link.start()
    try:
        app.run(mouse=False)
    finally:
        if control.recorder is not None:
            control.recorder.leave()
        text = app.ui.text  # in the language that was chosen last
        _keep(schooling, app)
        _leave(link, ending, text)
        if control.recorder is not None:
            control.recorder.close(ending.reason or ("crash" if app.fault is not None else ""))
        for problem in (*tracing.problems, *feed.close()):
            _say(text.problem(problem))
    if app.fault is not None:
        raise app.fault
    return 0 if link.rested and ending.reason is None and app.return_code in (0, None) else 1


def _take_terminal() -> None:
    """Refuse to run without a terminal (`screen.no_terminal`). Pages are written to stderr."""
    if not (sys.stdin.isatty() and sys.stdout.isatty() and sys.stderr.isatty()):
        raise SessionError(Problem(code="screen.no_terminal"))
    if isinstance(sys.__stderr__, TextIOWrapper):
        sys.__stderr__.reconfigure(errors=CELLS)  # a replacement for a missing sign must not shift anything else


def _wrong_usage(options: Namespace, requested: SimulatedAddress | None, *, simulated: bool) -> str:
    """Return the sentence about options of a simulated lathe that exclude others, "" where none do."""
    if (requested is not None or options.lesson is not None) and not simulated:
        return "usage.plant_without_sim"
    if options.trainee is not None and options.lesson is None and options.from_file is None:
        return "usage.trainee_alone"
    return "usage.lesson_alone" if requested is not None and options.lesson is not None else ""


def _keep(schooling: SchoolSession | None, app: ConsoleApp) -> None:
    """Keep what a session of the school leaves."""
    if schooling is None:
        return
    try:
        schooling.keep(app)
    except ProblemError as error:
        for problem in error.problems:
            _say(app.ui.text.problem(problem))


def _appearance(configuration: Configuration, text: Catalogue) -> Appearance:
    """Return how the screens are to look; ProblemError for an own key that no action can have."""
    appearance = appearance_of({key: configuration.value(key) for key in KEYS}, text.language)
    if appearance.keys:
        from console.tui.application.own_keys import faults

        if problems := faults(appearance.keys, text):
            raise SessionError(*problems)
    return appearance


def _build_recorded_screens(
    link: LinkThread,
    inbox: Inbox,
    machine: LoadedMachine,
    data: Path,
    looks: tuple[Catalogue, Appearance, Configuration],
    feed: ScreenFeed,
    notes: AlarmNotes,
) -> tuple[ConsoleApp, RecordedControl]:
    """Return the screens on the link, and their control, which has a recorder after the first paint."""
    control = RecordedControl(link, inbox)
    text, appearance, configuration = looks

    def begin() -> None:
        link.open()
        control.recorder = _recorder(control, app, machine, data, inbox)
        control.recorder.start()
        feed.launch(app.ui, lambda: control.state)
        if app.ui.attempt is not None:
            app.go(PageName.TRAIN)

    app = ConsoleApp(
        text=text,
        palette=MONO if os.environ.get(COLOUR_VARIABLE) else COLOUR,
        control=control,
        machine=machine,
        data=data,
        begin=begin,
        heard=lambda key: inbox.put(NoteKind.KEY, key),
        driver_class=StopDriver,
        appearance=appearance,
        configuration=configuration,
        client=remote_client(os.environ),
        noted=notes,
    )
    return app, control


def _recorder(
    control: RecordedControl, app: ConsoleApp, machine: LoadedMachine, data: Path, inbox: Inbox
) -> FlightRecorder:
    from console.flight.recorded_forms import RecordedMoment, work_of
    from console.flight.recorder import FlightRecorder

    def observed() -> RecordedMoment:
        """Return what is recorded now; all of it is read by reference, in the thread of the recorder."""
        return RecordedMoment(
            state=control.state, page=app.page, work=work_of(app.ui.work), said=app.ui.key_answer
        )

    return FlightRecorder(data, machine, observed, inbox, now_s=control.now_s)


def _open(
    machine: LoadedMachine,
    address: LinkAddress,
    data: Path,
    tracing: Tracing,
    begins: SessionStart | None,
    trained: TrainingClock | None,
) -> OpenMachine:
    """Open the machine in the link thread: its imports take longer than the first paint."""
    from console.session.station.link.opening import open_machine

    return open_machine(machine, address, data, tracing, begins, trained)


class _Ending:
    """Signal that ends the console: the handler itself stops the machine, then the screen is left."""

    def __init__(self, link: LinkThread, app: ConsoleApp) -> None:
        self.reason: str | None = None
        self.came_s = math.inf
        self._link, self._app = link, app
        self._handling = False

    def install(self) -> None:
        for number in ENDING_SIGNALS:
            signal.signal(number, self._handle)

    def ignore(self) -> None:
        for number in ENDING_SIGNALS:  # during interpreter exit they must not change the exit code
            signal.signal(number, signal.SIG_IGN)

    def _handle(self, number: int, _: FrameType | None) -> None:
        if self._handling:
            return  # a signal during this adds nothing, and a series of them would pile up
        self._handling = True
        if self.reason is None:
            self.reason, self.came_s = has_come(number), time.monotonic()
        self._link.end(self.reason, must_leave=True)
        with suppress(RuntimeError):  # the screen has ended already, and its loop is closed
            self._app.leave_soon()
        self._handling = False


def _leave(link: LinkThread, ending: _Ending, text: Catalogue) -> None:
    """Leave the machine at rest; report a wait for it, and the outcome."""
    link.end(ending.reason or "quit")
    began_s, said = time.monotonic(), False
    while not link.join(WAIT_S):
        now_s = time.monotonic()
        if now_s > min(began_s + COAST_LIMIT_S, ending.came_s + ENDING_LIMIT_S):
            break
        if not said and now_s > began_s + QUIET_S:
            said = True
            _say(text("leave.waiting"))
    ending.ignore()
    if ending.reason is not None:
        _say(text("leave.ended_at_rest" if link.rested else "leave.ended", reason=ending.reason))
    if not link.rested:
        _say(text.problem(Problem(code="machine.state_unknown")))


def _say(line: str) -> None:
    with suppress(OSError):  # the terminal is gone; the exit code still reports the result
        print(f"console: {line}", file=sys.stderr)
