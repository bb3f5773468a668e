"""Every bundled lesson at a real terminal of 80 x 24, by three scripted trainees, in both languages.

`python -m tests.school.walk_lessons` walks them all, some at the same time, and prints a table of the scores; with
`--write` the scores are put into docs/training.md. Names choose lessons, `--trainee` and `--lang` the others.
Each takes as long as a trainee: a minute or two.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tempfile
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from console.school.training.lesson import FOLDER, Lesson, load_lesson
from console.school.training.tries import tries
from drivers.simulator.plant.presets import plant_named
from profiles.store import load_job, load_machine
from tests.compact import save_compact
from tests.school.lesson_plays import PLAYS, careless
from tests.school.lesson_pupil import Pupil
from tests.terminal import Terminal

LANGUAGES = ("en", "ko")
PERFECT, CARELESS, LUCKY, UNLUCKY = "perfect", "careless", "lucky", "lucky, seed 3"
TRAINEES = (PERFECT, CARELESS, LUCKY, UNLUCKY)
OF_LUCK = ("feed-hold", "thin-ring", "read-a-plot")
"""Lessons in which it counts where jaw 1 is, or what is wrong: they tell luck from skill."""

PAGE = Path(__file__).parents[2] / "docs" / "training.md"
BEGIN, END = "<!-- scores -->", "<!-- end of scores -->"
CUTS_MM = {"lee-2001-experiment-1": 3.0, "thin-ring-3-jaws": 2.0}
WHOLE = ("drive-fails", "no-answer", "cable-cut")
"""Lessons in which something happens some seconds after the cut has begun: the jobs as they are."""

WIDE_MM = 33.0  # where the tool is homed, for the jobs that are wider than those of the compact lathe


@dataclass(frozen=True, slots=True)
class Walk:
    """One lesson by one trainee in one language."""

    lesson: str
    trainee: str
    language: str

    @property
    def seed(self) -> int:
        """Which lathe: luck is what one knows about the first."""
        return 3 if self.trainee == UNLUCKY else 1


def prepared(data: Path, walk: Walk) -> tuple[Lesson, list[str]]:
    """Save the lesson on the lathe of the walk, its jobs shorter; return it, and the command that begins it."""
    own = data / "lessons"
    shutil.copytree(FOLDER / "lathes", own / "lathes")
    text = (FOLDER / f"{walk.lesson}.toml").read_text(encoding="utf-8")
    (own / f"{walk.lesson}.toml").write_text(f"seed = {walk.seed}\n{text}", encoding="utf-8")
    machine = save_compact(data)
    lesson = load_lesson(walk.lesson, own)
    if lesson.job == "thin-ring-3-jaws":
        file = data / "machines" / "lee-2001-lathe.toml"
        near = file.read_text(encoding="utf-8")
        file.write_text(near.replace("home_radius_mm = 29.0", f"home_radius_mm = {WIDE_MM}"), encoding="utf-8")
    (data / "jobs").mkdir()
    for name, cut_mm in () if walk.lesson in WHOLE else CUTS_MM.items():
        job = load_job(name).path.read_text(encoding="utf-8")
        shorter = re.sub(r"(?m)^cut_length_mm = [\d.]+", f"cut_length_mm = {cut_mm}", job)
        (data / "jobs" / f"{name}.toml").write_text(shorter, encoding="utf-8")
    command = [sys.executable, "-m", "console", "--sim", "--lesson", walk.lesson, "--data", str(data), *machine]
    return lesson, [*command, "--lang", walk.language, "--trainee", walk.trainee.partition(",")[0]]


def known_deg(lesson: Lesson) -> float:
    """Return where jaw 1 of the first lathe is: what a lucky trainee knows by heart."""
    true = plant_named(lesson.plant_of(1), load_machine("lee-2001-lathe").machine, 1, mounted_by_hand=True)
    assert true.jaw_1_deg is not None
    return true.jaw_1_deg


def score(walk: Walk) -> int:
    """Walk a lesson to its debrief; return the score on the screen."""
    with tempfile.TemporaryDirectory() as folder:
        lesson, command = prepared(Path(folder), walk)
        with Terminal(command, columns=80, rows=24) as terminal:
            pupil = Pupil(terminal, walk.language)
            pupil.sees("train_page.hint", 60.0)
            pupil.sees("activity.ready", 60.0)
            if walk.trainee == CARELESS:
                careless(pupil, lesson.steps)
            else:
                luck = walk.trainee in (LUCKY, UNLUCKY)
                pupil.jaw_1_deg = known_deg(lesson) if luck else None
                asked = "answered" in lesson.steps
                PLAYS[walk.lesson](pupil, lesson.right_answer(1 if luck else walk.seed) if asked else 0)
            found = ended(pupil, all_made=walk.trainee != CARELESS)
        (one,) = tries(Path(folder))
        lost = {mark["item"]: round(mark["lost"], 1) for mark in one.marks if mark["lost"]}
        print(f"{walk}: lost {lost}", file=sys.stderr, flush=True)
        return found


def ended(pupil: Pupil, *, all_made: bool) -> int:
    """End the lesson, read the score, leave."""
    pupil.press("9")
    time.sleep(1.5)
    if all_made:
        pupil.sees("train_page.next.done")
    else:
        pupil.press("enter")
        time.sleep(1.5)
    pupil.press("enter")
    number = re.search(r"\d+", pupil.sees("debrief.score", 30.0)[0])
    assert number is not None
    pupil.press("ctrl+q")
    with suppress(AssertionError):
        pupil.terminal.wait_exit(5.0)
        return int(number[0])
    pupil.press("ctrl+q")  # a job that was edited and not saved is asked about
    pupil.terminal.wait_exit(30.0)
    return int(number[0])


def tried(walk: Walk) -> tuple[Walk, int | None]:
    """Walk, and tell on stderr how it went; None where the lesson was not walked to its end."""
    began_s = time.monotonic()
    try:
        found = score(walk)
    except Exception:  # what is wrong with one walk is told, and the others go on
        print(f"{walk}: NOT walked\n{traceback.format_exc()}", file=sys.stderr, flush=True)
        return walk, None
    print(f"{walk}: {found}, {time.monotonic() - began_s:.0f} s", file=sys.stderr, flush=True)
    return walk, found


def walks(lessons: list[str], trainees: list[str], languages: list[str]) -> list[Walk]:
    """Return what is to be walked, the longest first."""
    found = [
        Walk(lesson, trainee, language)
        for lesson in reversed(lessons)
        for trainee in trainees
        for language in languages
        if trainee in (PERFECT, CARELESS) or lesson in OF_LUCK
    ]
    return sorted(found, key=lambda walk: walk.trainee == CARELESS)


def table(found: dict[Walk, int | None], lessons: list[str]) -> str:
    """Return the scores as a table, "en / ko" in each cell; "-" where there is no walk."""
    rows = ["| lesson | " + " | ".join(TRAINEES) + " |", "|---" * (1 + len(TRAINEES)) + "|"]
    for lesson in lessons:
        cells = []
        for trainee in TRAINEES:
            scores = [found.get(Walk(lesson, trainee, language)) for language in LANGUAGES]
            cells.append(" / ".join("-" if each is None else str(each) for each in scores))
        rows.append(f"| `{lesson}` | " + " | ".join("-" if each == "- / -" else each for each in cells) + " |")
    return "\n".join(rows)


def scores_in(shown: str) -> dict[Walk, int | None]:
    """Return the scores of a table."""
    head, _, *rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in shown.strip().splitlines()]
    return {
        Walk(lesson.strip("`"), trainee, language): int(score)
        for lesson, *cells in rows
        for trainee, cell in zip(head[1:], cells, strict=True)
        for language, score in zip(LANGUAGES, cell.split(" / "), strict=False)
        if score != "-"
    }


def main() -> int:
    """Walk; return 1 where a lesson was not walked to its end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("lessons", nargs="*", choices=[[], *PLAYS], help="names of lessons; all without one")
    parser.add_argument("--trainee", action="append", choices=TRAINEES)
    parser.add_argument("--lang", action="append", choices=LANGUAGES)
    parser.add_argument("--jobs", type=int, default=3, help="walks at the same time")
    parser.add_argument("--write", action="store_true", help="put the scores into the table of docs/training.md")
    options = parser.parse_args()
    lessons = options.lessons or list(PLAYS)
    planned = walks(lessons, options.trainee or list(TRAINEES), options.lang or list(LANGUAGES))
    with ThreadPoolExecutor(options.jobs) as pool:
        found = dict(pool.map(tried, planned))
    print(table(found, lessons))
    if options.write:
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        was, after = rest.split(END)
        shown = table(scores_in(was) | found, list(PLAYS))
        PAGE.write_text(f"{before}{BEGIN}\n\n{shown}\n\n{END}{after}", encoding="utf-8")
    return 1 if None in found.values() else 0


if __name__ == "__main__":
    sys.exit(main())
