"""A lesson: a simulated lathe, a job, what to reach and what counts on it, a question, words. A TOML file each.

Bundled lessons are in `lessons/` beside this module; a file of the same form in the folder `lessons` of the data
folder is one of the user's own, and goes before a bundled one of its name.

A lesson asks for milestones: things that happen at the lathe, told from two states of the station in a row. A
milestone stays reached, whatever is lost again afterwards. The right answer to its question is a number in the
file, or the place of the lathe that was drawn for the try.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import Any, TypeAlias

from console.school.training.event import LessonEvent, read_events
from console.session.stages import Stage
from console.session.station.state import Activity, StationState
from drivers.lathe.console_role import ConsoleRole
from drivers.simulator.plant.presets import PLANTS, SEEDS, plant_problems
from profiles.fields import Field, FieldType, read_fields, schema_problem
from profiles.files import printable, read_toml
from profiles.problem import Problem, ProfileError
from profiles.words.sentences import LANGUAGES

FOLDER = Path(__file__).parent / "lessons"
ENGLISH = "en"  # in place of a language in which a lesson has no words
EVENTS = "event"  # tables of them
WORDS_CAP = 400
STEP = "answered"
LEAST_ANSWERS, MOST_ANSWERS = 2, 6
QUESTION_CAP, ANSWER_CAP = 120, 70

QUESTION_FIELDS = (
    Field(key="lathes", kind=FieldType.TEXTS, default=()),
    Field(key="answer", kind=FieldType.WHOLE, at_least=1, at_most=MOST_ANSWERS, optional=True),
)
"""Of the lesson: files of lathes of which one is drawn, or the number of the right answer."""

QUESTION_WORDS = (
    Field(key="question", kind=FieldType.TEXT, default="", longest=QUESTION_CAP),
    Field(key="answers", kind=FieldType.TEXTS, default=(), longest=ANSWER_CAP),
)
"""Of each language."""


class Item(StrEnum):
    """What counts, in the order of the debrief."""

    STEPS = "steps"
    MET = "met"
    NEAR = "near"
    CONTACT = "contact"
    ROUND = "round"
    DIAMETER = "diameter"
    JAW = "jaw"
    TOUCH_OFF = "touch_off"
    STOPS = "stops"
    ANSWER = "answer"
    ALARMS = "alarms"
    REACTION = "reaction"
    TIME = "time"


def question_problems(
    values: Mapping[str, Any], words: Mapping[str, Mapping[str, Any]], where: str
) -> list[Problem]:
    """Return what is wrong with a question: it goes with its step, and with as many answers in each language."""
    if STEP not in values["steps"]:
        given = [f"{language}.question" for language, said in words.items() if said["question"] or said["answers"]]
        return [Problem(code="lesson.no_question", where=where, key=key, limit=STEP) for key in given]
    lathes, answer = values["lathes"], values["answer"]
    problems = []
    if (answer is None) == (not lathes):
        problems.append(Problem(code="lesson.right_answer", where=where, key="answer", limit="lathes | answer"))
    least, most = (len(lathes),) * 2 if lathes else (max(answer or 0, LEAST_ANSWERS), MOST_ANSWERS)
    for language, said in words.items():
        if not said["question"]:
            problems.append(Problem(code="key.missing", where=where, key=f"{language}.question"))
        if not least <= len(said["answers"]) <= most:
            value, limit = str(len(said["answers"])), f"{least} - {most}" if most > least else str(least)
            key = f"{language}.answers"
            problems.append(Problem(code="lesson.answers", where=where, key=key, value=value, limit=limit))
    return problems


def lathe_files(names: Sequence[str], folder: Path) -> tuple[tuple[str, ...], list[Problem]]:
    """Return the files of lathes beside a lesson, and why those cannot be used that cannot."""
    files = tuple(str(folder / f"{name}.toml") for name in names)
    return files, [problem for file in files for problem in plant_problems(file)]


def drawn_number(seed: int | None, lathes: Sequence[str]) -> int:
    """Return which of the lathes a try is on, from 0."""
    return Random(f"{seed} lathe of the lesson").randrange(len(lathes))


@dataclass(frozen=True, slots=True, kw_only=True)
class StateChange:
    """Two states, one after the other; `stage` is that of the cut that was armed last.

    `answered` is whether the question of the lesson is.
    """

    before: StationState
    now: StationState
    stage: Stage | None = None
    answered: bool = False

    def has_ended(self, activity: Activity) -> bool:
        """Whether the station was busy with this, and is no longer."""
        return self.before.activity is activity is not self.now.activity


Reached = Callable[[StateChange], bool]
_CUT = "cut"  # of `CutStage`, which is not there for the first page


def _cut_ended_in(stage: Stage) -> Reached:
    """Return whether a cut of this stage has come to its end."""

    def reached(change: StateChange) -> bool:
        cut, whole = change.now.cut, change.now.stop is None
        return (
            change.has_ended(Activity.CUTTING)
            and whole
            and change.stage is stage
            and cut is not None
            and cut.fraction >= 1.0
        )

    return reached


def _by_indicator(change: StateChange) -> bool:
    jaw = change.now.alignment.jaw
    return jaw is not None and jaw.spread_deg is not None


def _is_skimmed(change: StateChange) -> bool:
    touch_off = change.now.alignment.touch_off
    return touch_off is not None and touch_off.skimmed


def _in_cut(change: StateChange) -> bool:
    cut = change.now.cut
    return change.now.activity is Activity.CUTTING and cut is not None and cut.stage == _CUT


def _clamped_lighter(change: StateChange) -> bool:
    clamping, plain = change.now.alignment.clamping, change.now.uncompensated
    return clamping is not None and plain is not None and clamping.force_n < plain.job.chucking_force_n


def _measured_rounder(change: StateChange) -> bool:
    before, now = change.before.uncompensated, change.now.uncompensated
    if before is None or now is None or now is before:
        return False
    return now.result.ront_um < before.result.ront_um


def _all_acknowledged(change: StateChange) -> bool:
    new = [alarm for alarm in change.before.alarms if not alarm.acknowledged]
    return bool(new) and all(alarm.acknowledged for alarm in change.now.alarms)


MILESTONES: Mapping[str, Reached] = MappingProxyType(
    {
        "clamped": lambda change: change.now.alignment.clamping is not None,
        "drives_on": lambda change: change.now.alignment.drives_on,
        "homed": lambda change: change.now.alignment.homed,
        "jaw_found": lambda change: change.now.alignment.jaw is not None,
        "jaw_by_indicator": _by_indicator,
        "touched_off": lambda change: change.now.alignment.touch_off is not None,
        "skimmed": _is_skimmed,
        "armed": lambda change: change.now.armed is not None,
        "in_cut": _in_cut,
        "air_cut": _cut_ended_in(Stage.AIR),
        "half_cut": _cut_ended_in(Stage.PARTIAL),
        "full_cut": _cut_ended_in(Stage.FULL),
        "measured": lambda change: change.now.measured is not None,
        "measured_plain": lambda change: change.now.uncompensated is not change.before.uncompensated,
        "held": lambda change: change.now.paused,
        "resumed": lambda change: change.before.paused and not change.now.paused and change.now.moving,
        "stopped": lambda change: change.now.stop is not None,
        "stopped_in_cut": lambda change: change.now.stop is not None and change.now.stop.of_cut,
        "retracted": lambda change: change.has_ended(Activity.RETRACTING) and change.now.stop is None,
        "recovered": lambda change: change.before.stop is not None and change.now.stop is None,
        "link_lost": lambda change: change.now.activity is Activity.LOST or change.now.lost_link is not None,
        "reconnected": lambda change: change.before.lost_link is not None and change.now.lost_link is None,
        "acknowledged": _all_acknowledged,
        "clamped_lighter": _clamped_lighter,
        "measured_rounder": _measured_rounder,
        "ousted": lambda change: change.now.standing is ConsoleRole.OUSTED,
        "control_back": lambda change: change.before.standing is not ConsoleRole.OWNER and change.now.controls,
        "answered": lambda change: change.answered,
    }
)
"""Every milestone by the name that lessons use, in the order in which they usually come."""


_FIELDS = (
    Field(key="schema", kind=FieldType.WHOLE, default=1, at_least=1, at_most=1),
    Field(key="place", kind=FieldType.WHOLE, default=100, at_least=1, at_most=1000),
    Field(key="minutes", unit="min", at_least=1.0, at_most=60.0),
    Field(key="plant", kind=FieldType.CHOICE, default="mounted", choices=PLANTS),
    Field(key="seed", kind=FieldType.WHOLE, at_least=0, at_most=SEEDS - 1, optional=True),
    Field(key="blind", kind=FieldType.CHOICE, default="no", choices=("yes", "no")),
    Field(key="job", kind=FieldType.TEXT, default="lee-2001-experiment-1"),
    Field(key="steps", kind=FieldType.TEXTS, choices=tuple(MILESTONES)),
    Field(key="counts", kind=FieldType.TEXTS, choices=tuple(Item), default=tuple(Item)),
    *QUESTION_FIELDS,
)
_WORDS = (
    Field(key="title", kind=FieldType.TEXT, longest=60),
    Field(key="goal", kind=FieldType.TEXT, longest=WORDS_CAP),
    Field(key="hints", kind=FieldType.TEXTS, longest=WORDS_CAP),
    *QUESTION_WORDS,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """A lesson in one language: a hint for each of its steps; its question with the answers, "" without one."""

    title: str
    goal: str
    hints: tuple[str, ...]
    question: str = ""
    answers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lesson:
    """A lesson, at its `place` in lists. `steps` are names of `MILESTONES` in the order in which they are reached.

    `plant` and `seed` say which simulated lathe it is on, another each time without a seed; a `blind` one shows
    dials instead of the truth. `job` is a saved job. `counts` are the items of its score, names of `Item`;
    `events` come by themselves. One of `lathes` (files) is drawn for each try, in place of `plant`. The right
    answer to its question is `answer`, from 1, or else the place of the lathe which was drawn.
    """

    name: str
    place: int
    minutes: float
    plant: str
    seed: int | None
    blind: bool
    job: str
    steps: tuple[str, ...]
    counts: tuple[str, ...]
    events: tuple[LessonEvent, ...]
    words: Mapping[str, Words]
    lathes: tuple[str, ...] = ()
    answer: int | None = None

    def plant_of(self, seed: int | None) -> str:
        """Return the name or the file of the plant of a try."""
        return self.lathes[drawn_number(seed, self.lathes)] if self.lathes else self.plant

    def right_answer(self, seed: int | None) -> int:
        """Return the number of the right answer, from 0."""
        return drawn_number(seed, self.lathes) if self.answer is None else self.answer - 1


def lesson_of(table: Mapping[str, Any], name: str, where: str, folder: Path = FOLDER) -> Lesson:
    """Return the lesson of a table; `folder` is that of its file.

    Raises ProfileError with everything that is wrong in it.
    """
    if refusal := schema_problem(table, where=where):
        raise ProfileError(refusal)
    top = {key: value for key, value in table.items() if key not in (*LANGUAGES, EVENTS)}
    values, problems = read_fields(_FIELDS, top, where=where)
    events, found = read_events(table.get(EVENTS, []), values.get("steps") or (), where)
    problems += found
    words, found = _words(table, where)
    problems += found
    if not problems:
        values["lathes"], problems = lathe_files(values["lathes"], folder)
        for language, said in words.items():
            problems += _hints(language, said["hints"], values["steps"], where)
        problems += question_problems(values, words, where)
    if problems:
        raise ProfileError(*problems)
    del values["schema"]
    values["blind"] = values["blind"] == "yes"
    spoken = {language: Words(**words.get(language, words[ENGLISH])) for language in LANGUAGES}
    return Lesson(name=name, words=spoken, events=events, **values)


def _words(table: Mapping[str, Any], where: str) -> tuple[dict[str, dict[str, Any]], list[Problem]]:
    """Return the words of each language that the lesson has, and everything that is wrong with them."""
    words: dict[str, dict[str, Any]] = {}
    problems: list[Problem] = []
    for language in (each for each in LANGUAGES if each in table or each == ENGLISH):
        given = table.get(language, {})
        if not isinstance(given, dict):
            given = {"title": given}
        words[language], found = read_fields(_WORDS, given, where=where, prefix=f"{language}.")
        problems += found
    return words, problems


def _hints(language: str, hints: tuple[str, ...], steps: tuple[str, ...], where: str) -> list[Problem]:
    """Return the refusal of hints that are not one for each step."""
    if len(hints) == len(steps):
        return []
    value, limit = str(len(hints)), str(len(steps))
    return [Problem(code="lesson.hints", where=where, key=f"{language}.hints", value=value, limit=limit)]


def load_lesson(name_or_path: str, own: Path) -> Lesson:
    """Return a lesson by its name, or by the path of a file that ends in `.toml`; `own` is the user's folder.

    Raises:
        ProfileError: `lesson.unknown`, with the names that there are; a file that cannot be read, or is no lesson.
    """
    paths = {path.stem: path for path in lesson_paths(own)}
    path = Path(name_or_path) if name_or_path.endswith(".toml") else paths.get(name_or_path)
    if path is None:
        value, limit = printable(name_or_path, 60), " | ".join(paths)
        raise ProfileError(Problem(code="lesson.unknown", value=value, limit=limit))
    _, table = read_toml(path)
    return lesson_of(table, path.stem, printable(str(path)), path.parent)


def lesson_paths(own: Path) -> tuple[Path, ...]:
    """Return the files of all lessons: the bundled ones, then the user's own, which replace their namesakes."""
    bundled = {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}
    mine = {path.stem: path for path in sorted(own.glob("*.toml"))}
    return tuple({**bundled, **mine}.values())


Shelved: TypeAlias = tuple[str, Lesson | tuple[Problem, ...]]
"""The name of a lesson with it, or with why it cannot be read."""


def own_folder(data: Path) -> Path:
    """Return where a user's own lessons are, in the data folder."""
    return data / "lessons"


def lessons(own: Path) -> tuple[Shelved, ...]:
    """Return all lessons, in the order of their places; those that cannot be read at the end."""
    found = [_load_lesson_file(path) for path in lesson_paths(own)]
    return tuple(sorted(found, key=lambda each: (_place(each), each[0])))


def _load_lesson_file(path: Path) -> Shelved:
    try:
        return path.stem, load_lesson(str(path), path.parent)
    except ProfileError as error:
        return path.stem, tuple(error.problems)


def _place(shelved: Shelved) -> int:
    lesson = shelved[1]
    return lesson.place if isinstance(lesson, Lesson) else 10_000
