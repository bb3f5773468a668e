"""A try that was left: kept on disk with its steps and times, and continued on the same lathe at power-up.

Nothing of the machine is kept. Steps stay made up to the last after which a machine that is set up anew can go on
with the next one: what needs a stop, a hold or a part that is gone has to be made again, with it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from console.school.training.attempt import Attempt, TraineeFindings
from console.school.training.event import LessonEvent
from console.school.training.happenings import Happening, HappeningKind, PartFact
from console.school.training.lesson import Lesson
from console.school.training.tries import LEFT, UNREADABLE, trainee_folder
from console.session.data.kept_files import delete_file, folder_name, make_folder, read_kept_values
from profiles.files import printable, write_atomically
from profiles.strict_values import read_own

SCHEMA = 1

SET_UP = frozenset(
    {"clamped", "drives_on", "homed", "jaw_found", "jaw_by_indicator", "touched_off", "skimmed", "air_cut"}
)
"""Steps whose state a set-up restores."""

OF_A_PART = frozenset({"measured", "measured_plain"})
"""Steps that are over and done with, where the next one begins another part."""

NEED_WHAT_WAS = frozenset(
    "recovered retracted resumed reconnected acknowledged control_back clamped_lighter measured_rounder "
    "answered".split()
)
"""Steps that need more than a set-up machine: a stop, a hold, an alarm, the part before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnfinishedTry:
    """A try as it was left: `took_s` after it began, as the fields of `Attempt`."""

    lesson: str
    trainee: str
    seed: int | None
    took_s: float
    reached: tuple[tuple[str, float], ...]
    happened: tuple[Happening, ...]
    given: tuple[int, ...]
    found: TraineeFindings
    part: PartFact | None
    answer: int | None
    schema: int = SCHEMA


def left_of(attempt: Attempt, now_s: float) -> UnfinishedTry:
    """Return a try as it is kept where it is left now."""
    took_s = now_s - attempt.began_s
    return UnfinishedTry(
        lesson=attempt.lesson.name,
        trainee=attempt.trainee,
        seed=attempt.seed,
        took_s=took_s,
        reached=attempt.reached,
        happened=(*attempt.happened, Happening(at_s=took_s, what=HappeningKind.LEFT)),
        given=tuple(sorted(attempt.given)),
        found=attempt.found,
        part=attempt.part,
        answer=attempt.answer,
    )


def steps_kept(steps: Sequence[str], made: int, events: Sequence[LessonEvent]) -> int:
    """Return how many of the steps that were made stay made at a machine after power-up."""
    resting = [at for at in range(1, made + 1) if _rests(steps, at)]
    number = max(resting, default=0)
    for event in events:
        after = steps.index(event.after) + 1 if event.after else 0
        if number >= after and not any(at > after for at in resting if at <= number):
            # What came by itself was not lived through: it comes again, after its step.
            number = max((at for at in resting if at < after), default=0)
    return number


def _rests(steps: Sequence[str], at: int) -> bool:
    """Whether a machine that is set up can go on after so many steps; the last part is needed for the debrief."""
    last, following = steps[at - 1], set(steps[at : at + 1])
    return (last in SET_UP or (last in OF_A_PART and bool(following))) and not NEED_WHAT_WAS & following


def continue_try(left: UnfinishedTry, lesson: Lesson, now_s: float) -> Attempt | None:
    """Return the try that continues now; None where nothing can be continued, or the lesson is another one now."""
    if not is_the_same(left, lesson):
        return None
    number = steps_kept(lesson.steps, len(left.reached), lesson.events)
    if number == 0:
        return None
    made_again = set(lesson.steps[number:])
    begun = Attempt(lesson=lesson, began_s=now_s - left.took_s, seed=left.seed, trainee=left.trainee)
    given = frozenset(each for each in left.given if lesson.events[each].after not in made_again)
    return replace(
        begun,
        reached=left.reached[:number],
        happened=left.happened,
        given=given,
        found=left.found,
        part=left.part,
        answer=left.answer,
        continued=number,
    )


def is_the_same(left: UnfinishedTry, lesson: Lesson) -> bool:
    """Whether the steps that were made are still those of the lesson."""
    made = tuple(name for name, _ in left.reached)
    return made == lesson.steps[: len(made)]


def left_file(data: Path, trainee: str, lesson: str) -> Path:
    """Return where a try of a lesson is kept that was left."""
    return trainee_folder(data, trainee) / LEFT / f"{folder_name(lesson)}.json"


def keep_left(data: Path, attempt: Attempt, now_s: float) -> None:
    """Keep a try that may be left now, in place of an earlier one. Raises ProfileError: `file.not_writable`."""
    if attempt.ended_s is not None or attempt.step == 0:
        return
    path = left_file(data, attempt.trainee, attempt.lesson.name)
    make_folder(path.parent)
    content = json.dumps(asdict(left_of(attempt, now_s)), ensure_ascii=False, allow_nan=False, indent=2)
    write_atomically(path, f"{content}\n".encode(), overwrite=True, private=True)


def read_left(data: Path, trainee: str, lesson: str) -> UnfinishedTry | None:
    """Return the try that was left, None without one. Raises ProfileError: `training.unreadable`."""
    file = left_file(data, trainee, lesson)
    if not file.exists():
        return None
    return read_own(
        UnfinishedTry,
        read_kept_values(file, UNREADABLE),
        schema=SCHEMA,
        code=UNREADABLE,
        where=printable(str(file)),
    )


def forget_left(data: Path, trainee: str, lesson: str) -> None:
    """Delete a try that was left, where there is one. Raises ProfileError: `file.not_writable`."""
    delete_file(left_file(data, trainee, lesson))
