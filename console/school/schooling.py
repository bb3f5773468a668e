"""A session of the school at the screens: a lesson, a practice or an instructor, and what is kept of it."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from console.school.instructing.with_instructor import instructed
from console.school.lesson_start import begun
from console.school.page.followed_lesson import follow_lesson
from console.school.training.attempt import Attempt
from console.text.catalogue import Catalogue
from drivers.link.address import SimulatedAddress

if TYPE_CHECKING:
    from console.school.practising import TakenUp
    from console.session.station.begins import Begins
    from console.session.station.link_thread import LinkThread
    from console.session.work import Work
    from console.tui.app import ConsoleApp
    from drivers.simulator.hosts.control_address import ControlAddress
    from profiles.store import LoadedMachine


@dataclass(frozen=True, kw_only=True)
class Schooling:
    """What the screens begin with where it is not theirs: a machine, a simulated lathe, a job.

    `practice` holds the files of a practice until the end.
    """

    attempt: Attempt | None = None
    instructor: ControlAddress | None = None
    machine: LoadedMachine | None = None
    address: SimulatedAddress | None = None
    begins: Begins | None = None
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
        with instructed(self.instructor, app, link, data):
            yield

    def keep(self, app: ConsoleApp) -> None:
        """Keep the try of a lesson that is left, so that it can be continued. Raises ProfileError."""
        from console.school.training.left import keep_left

        if isinstance(app.ui.attempt, Attempt):
            keep_left(app.ui.data, app.ui.attempt, app.ui.control.now_s())


def taken_up(options: Namespace, data: Path, text: Catalogue) -> Schooling:
    """Return the practice of `--from`. Raises ProblemError: as `practising.taken_up`."""
    from console.school.practising import taken_up as practice_of  # not for the first paint

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


def schooling(options: Namespace, data: Path, text: Catalogue) -> Schooling:
    """Return the lesson of `--lesson`, if any, and the instructor. Raises ProfileError: as `begun`."""
    if options.lesson is None:
        return Schooling(instructor=options.instructor)
    attempt = begun(options, data, text)
    lesson = attempt.lesson
    address = SimulatedAddress(plant=lesson.plant_of(attempt.seed), seed=attempt.seed, blind=lesson.blind)
    return Schooling(attempt=attempt, instructor=options.instructor, address=address)
