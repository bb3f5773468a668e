"""A session of the school at the screens: a lesson, a practice or an instructor, and what is kept of it."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import SystemRandom
from typing import TYPE_CHECKING

from console.school.instructing.instructor_access import serve_instructor
from console.school.training.attempt import Attempt
from console.school.training.unfinished_try import keep_left
from console.session.station.state import Activity, StationState
from console.text.catalogue import Catalogue
from console.tui.ui_context import UiContext
from drivers.link.address import SimulatedAddress

if TYPE_CHECKING:
    from console.school.practice_lathe import TakenUp
    from console.school.training.attempt import Attempt
    from console.school.training.event import LessonEvent
    from console.school.training.lesson import Lesson
    from console.session.station.commands import Control
    from console.session.station.link_thread import LinkThread
    from console.session.station.state import SessionStart
    from console.session.work import Work
    from console.tui.app import ConsoleApp
    from drivers.simulator.hosts.control_address import ControlAddress
    from profiles.store import LoadedMachine

ANEW = ("n", "ㅜ")
MOST_QUESTIONS = 10


def follow_lesson(ui: UiContext) -> None:
    """Take the newest state; keep the try on disk after a step, whatever ends this console."""
    if not isinstance(before := ui.attempt, Attempt):
        return
    ui.attempt = after = follow_attempt(before, ui.control)
    if after.step > before.step:
        with ui.answering():
            keep_left(ui.data, after, ui.control.now_s())


@dataclass(frozen=True, kw_only=True)
class Schooling:
    """A session of the school: its machine, simulated lathe and job replace those of the screens where given.

    `practice` holds the files of a practice until the end.
    """

    attempt: Attempt | None = None
    instructor: ControlAddress | None = None
    machine: LoadedMachine | None = None
    address: SimulatedAddress | None = None
    begins: SessionStart | None = None
    work: Work | None = None
    practice: TakenUp | None = None

    @contextmanager
    def attend(self, app: ConsoleApp, link: LinkThread, data: Path) -> Iterator[None]:
        """Follow the screens, until they end.

        Raises:
            LinkError: `link.cannot_listen`, the address of the instructor.
            ProfileError: `file.not_writable`, his token cannot be kept.
        """
        app.ui.attempt, app.ui.work = self.attempt, self.work
        if self.attempt is not None:
            app.followers.append(lambda: follow_lesson(app.ui))
        with serve_instructor(self.instructor, app, link, data):
            yield

    def keep(self, app: ConsoleApp) -> None:
        """Keep the try of a lesson that is left, so that it can be continued. Raises ProfileError."""
        if isinstance(app.ui.attempt, Attempt):
            keep_left(app.ui.data, app.ui.attempt, app.ui.control.now_s())


def taken_up(options: Namespace, data: Path, text: Catalogue) -> Schooling:
    """Return the practice of `--from`. Raises ProblemError: as `practising.taken_up`."""
    from console.school.practice_lathe import taken_up as practice_of  # not for the first paint

    taken = practice_of(options, data, text)
    return Schooling(
        attempt=taken.attempt,
        instructor=options.instructor,
        machine=taken.machine,
        address=taken.address,
        begins=taken.begins,
        work=taken.work,
        practice=taken,
    )


def begin_attempt(options: Namespace, data: Path, text: Catalogue) -> Attempt:
    """Return a try of a lesson that begins now, or is continued.

    Raises ProfileError: the lesson is unknown, or cannot be read, or the try that was left.
    """
    import random

    from console.school.training.lesson import load_lesson, own_folder
    from console.school.training.tries import check_trainee
    from drivers.simulator.plant.presets import SEEDS

    trainee = options.trainee or ""
    check_trainee(trainee)
    lesson = load_lesson(options.lesson, own_folder(data))
    if (left := _continue_attempt(data, trainee, lesson, text)) is not None:
        return left
    seed = random.SystemRandom().randrange(SEEDS) if lesson.seed is None else lesson.seed
    return Attempt(lesson=lesson, began_s=time.monotonic(), seed=seed, trainee=trainee)


def _continue_attempt(data: Path, trainee: str, lesson: Lesson, text: Catalogue) -> Attempt | None:
    """Return the try that was left, where there is one that can be continued and is to be."""
    from dataclasses import replace

    from console.school.training.unfinished_try import continue_try, is_the_same, read_left

    left = read_left(data, trainee, lesson.name)
    if left is None:
        return None
    attempt = continue_try(left, lesson, time.monotonic())
    minutes, seconds = divmod(int(left.took_s), 60)
    facts = {"made": len(left.reached), "steps": len(lesson.steps), "kept": attempt.continued if attempt else 0}
    if attempt is None:
        why = "lost" if is_the_same(left, lesson) else "changed"
        print(text(f"lesson_start.{why}", time=f"{minutes}:{seconds:02d}", **facts))
        _answer(text("lesson_start.anew"))
        return None
    print(text("lesson_start.left", time=f"{minutes}:{seconds:02d}", **facts))
    if _answer(text("lesson_start.ask")):
        return None
    return replace(attempt, began_s=time.monotonic() - left.took_s)  # reading the question takes none of its time


def _answer(question: str) -> str:
    """Ask on the terminal; return "" for Enter, or n. A terminal that ends interrupts."""
    for _ in range(MOST_QUESTIONS):
        try:
            answer = input(question).strip().lower()
        except EOFError:
            break
        if answer in ("", *ANEW):
            return answer
    sys.stdout.flush()
    raise KeyboardInterrupt


def schooling(options: Namespace, data: Path, text: Catalogue) -> Schooling:
    """Return the lesson of `--lesson`, if any, and the instructor. Raises ProfileError: as `begin_attempt`."""
    if options.lesson is None:
        return Schooling(instructor=options.instructor)
    attempt = begin_attempt(options, data, text)
    lesson = attempt.lesson
    address = SimulatedAddress(plant=lesson.plant_of(attempt.seed), seed=attempt.seed, blind=lesson.blind)
    return Schooling(attempt=attempt, instructor=options.instructor, address=address)


def follow_attempt(attempt: Attempt, control: Control) -> Attempt:
    """Return the try up to now; the simulated lathe has got the faults that were due."""
    now_s = control.now_s()
    attempt = attempt.see_state(control.state, now_s)
    for number in attempt.due_events(now_s):
        from console.session.station.commands import InjectFault  # not for the first page

        event = attempt.lesson.events[number]
        if event.console and not _may_be_taken(control.state):
            continue
        for line in (event.fault,) if event.fault else _claim(event, control.state.holder):
            control.post(InjectFault(line=f"inject {line}"))
        attempt = attempt.gave(number, now_s)
    return attempt


def _may_be_taken(state: StationState) -> bool:
    """Whether another console may take control: at rest, as the rule is (docs/ownership.md)."""
    snapshot = state.snapshot
    return state.controls and state.activity is Activity.READY and snapshot is not None and snapshot.at_rest


def _claim(event: LessonEvent, holder: int) -> tuple[str, ...]:
    """Return how another host takes control from the holder, and signs as consoles do."""
    from drivers.lathe.console_role import Signature
    from drivers.lathe.ownership import HIGHEST, exchange_line, signing_line

    name, _, host = event.console.partition("@")
    number = SystemRandom().randint(1, HIGHEST)
    signature = Signature(number=number, name=name, host=host, minute=int(time.time() // 60))
    lines = (exchange_line(holder, number), signing_line(signature))
    return tuple(f"stranger-writes 'line={line}'" for line in lines)
