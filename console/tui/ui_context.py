"""UI context of all pages: the texts, the colours, the machine's control, the open job; and answers to keys."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from console.session.appearance import Appearance
from console.session.configuration import Configuration
from console.session.guide.waiting import wait_problems
from console.session.station.history.session_log import SessionLog
from console.session.station.state import Activity, StationState
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.tui.application.far_terminal import FarTerminal
from console.tui.application.key_releases import KeyReleases, Stroke
from console.tui.keymap import ACTIONS, PageName
from console.tui.theme import Palette
from profiles.job import Job
from profiles.problem import Problem, ProblemError
from profiles.store import LoadedMachine

if TYPE_CHECKING:
    from console.session.station.commands import Control  # not for the first paint

Moment = tuple[Activity, bool, bool]
"""Activity of the machine, whether a cut is armed, whether a stop is in force: what most answers refer to."""

KEYS = {action.id: action.shown for action in ACTIONS}  # the written name of each action's key


class LessonTry(Protocol):
    """The try of a lesson, as far as pages know it."""

    @property
    def asks(self) -> bool:
        """Whether the trainee is still to say what is wrong with the part."""


@dataclass(kw_only=True, eq=False)
class UiContext:
    """The single UI context. `work` is replaced, never changed; `key_answer` is the answer to the last key.

    `draft` is a new job that is being filled in: while it is, no job is open. `copying` asks the page Set-up for
    the name of a copy of the open job. `go` shows another page. `data` is the operator's folder. `jog` is the
    action that requested the last jog step, `queued` whether steps of it are still to be made: the machine may
    rest between two of them. `log` is that of this session, up to the last tick. `appearance` is what the
    operator has set, and `appear` sets another; `configuration` says where a setting comes from. `stroke` is
    what the terminal says of the last key, and `releases` what is known of its reports, both None where it has
    none. `terminal` says where it is. `jobs` are the names of all saved jobs, as the page Jobs has read them.
    `attempt` is the try of a lesson, in a session that has one.
    """

    text: Catalogue
    palette: Palette
    control: Control
    machine: LoadedMachine
    data: Path
    go: Callable[[PageName], None]
    work: Work | None = None
    draft: Work | None = None
    copying: bool = False
    jobs: tuple[str, ...] = ()
    jog: str | None = None
    queued: bool = False
    attempt: LessonTry | None = None
    log: SessionLog = field(default_factory=SessionLog)
    appearance: Appearance = field(default_factory=Appearance)
    appear: Callable[[Appearance], None] = lambda appearance: None
    configuration: Configuration | None = None
    stroke: Stroke | None = None
    releases: KeyReleases | None = None
    terminal: FarTerminal = field(default_factory=FarTerminal)
    _said: tuple[Problem, ...] = ()
    _said_at: Moment | None = None

    @property
    def key_answer(self) -> tuple[Problem, ...]:
        """The answer to the last key."""
        return self._said

    @key_answer.setter
    def key_answer(self, problems: tuple[Problem, ...]) -> None:
        self._said, self._said_at = problems, _moment(self.control.state)

    @property
    def job(self) -> Job | None:
        """The open job, None without one."""
        return None if self.work is None else self.work.job

    def say(self, code: str, *, key: str = "", value: str = "", limit: str = "") -> None:
        """Answer the last key with a problem."""
        self.key_answer = (Problem(code=code, key=key, value=value, limit=limit),)

    @contextmanager
    def answering(self) -> Iterator[None]:
        """Answer the last key with the problems of what fails inside."""
        try:
            yield
        except ProblemError as error:
            self.key_answer = tuple(error.problems)

    def refuses(self, action: str) -> bool:
        """Whether the station cannot take the command of this action now; the answer says why."""
        return self.answers(refusal(self.control.state, action))

    def answers(self, reasons: tuple[Problem, ...]) -> bool:
        """Whether there are reasons against the action of the last key; they are its answer."""
        if reasons:
            self.key_answer = reasons
        return bool(reasons)

    @property
    def view(self) -> View:
        """What the pages are shown now."""
        return View(state=self.control.state, work=self.work, now_s=self.control.now_s())

    def stop(self, reason: str) -> None:
        """Stop the machine; no step of a jog key follows. Also called from the thread that reads the terminal."""
        self.control.stop(reason)
        self.queued = False

    def kill(self, reason: str) -> None:
        """Open every loop of the machine, as `stop`."""
        self.control.kill(reason)
        self.queued = False

    def say_until_key(self, problem: Problem) -> None:
        """Show until the next key a text that holds in any state, such as why the machine is being stopped."""
        self._said, self._said_at = (problem,), None

    def forget_stale_answer(self, state: StationState) -> None:
        """Drop an answer that was given in another state of the machine: it may no longer be true."""
        if self._said_at is not None and self._said_at != _moment(state):
            self._said, self._said_at = (), None


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Input of a page at one tick: the newest state, the work, and machine time to compute ages."""

    state: StationState
    work: Work | None
    now_s: float

    @property
    def job(self) -> Job | None:
        """The open job, None without one."""
        return None if self.work is None else self.work.job


def refusal(state: StationState, action: str) -> tuple[Problem, ...]:
    """Return why the station cannot take the command of an action now, empty where it can."""
    return wait_problems(state, KEYS[action])


def find_job_lock(state: StationState, moving: str, armed: str) -> Problem | None:
    """Return why the job cannot be changed now, one of two codes; None when it can."""
    if state.moving:
        return Problem(code=moving)
    if state.armed is not None or state.activity is Activity.ARMING:
        return Problem(code=armed)
    return None


def _moment(state: StationState) -> Moment:
    return state.activity, state.armed is not None, state.stop is not None
