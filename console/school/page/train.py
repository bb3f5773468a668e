"""Page Train: the lesson of this session with its steps, a hint for the one that is due, and the time; or all."""

from __future__ import annotations

from collections.abc import Sequence

from console.school.training.attempt import Attempt
from console.school.training.debrief import Debrief, debrief_of
from console.school.training.happenings import HappeningKind
from console.school.training.lesson import Lesson, Shelved, Words, lessons, own_folder
from console.school.training.tries import keep_try, tries, try_of
from console.school.training.unfinished_try import forget_left
from console.school.words.debrief import clock, happening_words, mark_words
from console.text.catalogue import Catalogue
from console.tui.keymap import PageName, RowKey
from console.tui.lines import BLANK, Line, Sheet, clip_lines, dim, hanging, justify_line, line, wrap_line
from console.tui.page import Page
from console.tui.theme import Token
from console.tui.ui_context import UiContext, View, refusal
from drivers.simulator.plant.workshop_view import Truth
from profiles.problem import Problem

_DONE, _CURRENT, _OPEN = "✓", "●", "○"
_STEPS = {"train.up": -1, "train.down": 1}
_ANSWER_KEYS = (
    RowKey(action="train.up", shown="↑↓", words="key.list.choose", doubled=True),
    RowKey(action="train.end", shown="Enter", words="key.train.answer"),
)
_CHOSEN, _OTHER = ("▸ ", Token.KEY), dim("  ")


def score_lines(
    debrief: Debrief, scores: Sequence[int], text: Catalogue, width: int, answers: Sequence[str]
) -> list[Line]:
    """Return the score, each mark with the points that it cost, and the trend over all tries.

    `answers` are those to the question of the lesson.
    """
    rows = [line((text("debrief.score", score=debrief.score), Token.STRONG))]
    for mark in debrief.marks:
        good = mark.lost < 0.5
        points = () if good else (dim(f"-{mark.lost:.0f}"),)
        sign = ("✓ ", Token.OK) if good else ("✗ ", Token.WARNING)
        rows += hanging(sign, mark_words(mark, text, answers), width, beside=points)
    if len(scores) > 1:
        shown = " ".join(str(score) for score in scores[-12:])
        rows += [BLANK, *wrap_line(text("debrief.trend", scores=shown), width, Token.DIM)]
    return rows


def advice_lines(debrief: Debrief, text: Catalogue, width: int) -> list[Line]:
    """Return what to do next time, about what cost most."""
    worst = debrief.worst
    return wrap_line(text("debrief.next.none" if worst is None else f"debrief.next.{worst.item}"), width)


def happened_lines(attempt: Attempt, text: Catalogue, width: int) -> list[Line]:
    """Return what happened when, oldest first."""
    rows: list[Line] = []
    for each in attempt.happened:
        token = Token.DIM if each.what is HappeningKind.STEP else Token.TEXT
        rows += hanging(dim(f"{clock(each.at_s)} "), happening_words(each, text), width, token)
    return rows


def question_lines(words: Words, choice: int, width: int) -> list[Line]:
    """Return the question, and each answer; the one of the number `choice`, from 0, is marked."""
    rows = [*wrap_line(words.question, width, Token.STRONG), BLANK]
    for number, answer in enumerate(words.answers):
        chosen = number == choice
        rows += hanging(_CHOSEN if chosen else _OTHER, answer, width, Token.STRONG if chosen else Token.TEXT)
    return rows


class TrainPage(Page):
    """Nothing on it moves anything."""

    name_ = PageName.TRAIN

    DEFAULT_CSS = """
    TrainPage { layout: horizontal; }
    TrainPage Sheet { border: round $secondary; border-title-color: $foreground; height: 1fr; width: 1fr;
        padding: 0 1; }
    TrainPage #train-hint { display: none; }
    TrainPage.-lesson #train-hint { display: block; }
    """

    def __init__(self, ui: UiContext) -> None:
        super().__init__(ui)
        self._steps = Sheet(ui.palette, id="train-steps")
        self._hint = Sheet(ui.palette, id="train-hint")
        self.panels = (self._steps, self._hint)
        self._shelf: tuple[Shelved, ...] | None = None
        self._over: tuple[Debrief, tuple[int, ...]] | None = None
        self._asked = False
        self._choice = 0  # of the answers, while the question of the lesson is due
        self._best: dict[str, int] = {}

    @property
    def _attempt(self) -> Attempt | None:
        return self.ui.attempt if isinstance(self.ui.attempt, Attempt) else None

    def show(self, view: View) -> None:
        """Show how far the lesson has come, or which lessons there are."""
        attempt = self._attempt
        self.set_class(attempt is not None, "-lesson")
        size = self._steps.size
        if attempt is None:
            rows = clip_lines(self._list(max(size.width, 1)), size.height, self.ui.text("panel.more"))
            self._steps.show(rows, self.ui.text("train_page.lessons"))
            return
        words = attempt.lesson.words[self.ui.text.language]
        if attempt.ended_s is not None and view.state.truth is not None:
            self._show_debrief(attempt, view.state.truth, view.now_s)
            return
        rows = clip_lines(
            self._progress(attempt, words, view, max(size.width, 1)), size.height, self.ui.text("panel.more")
        )
        self._steps.show(rows, words.title)
        self._hint.show(
            self._hints(attempt, words, max(self._hint.size.width, 1)), self.ui.text("train_page.hint")
        )

    def act(self, action: str) -> None:
        """Answer the question that is due, or end the lesson; one that is not done asks again."""
        attempt = self._attempt
        if self.ui.answers(self.why_not(action, self.ui.view)) or attempt is None:
            return
        if attempt.asks_now:
            self._answer(attempt, action)
            return
        if not attempt.done and not self._asked:
            self._asked = True
            self.ui.say("training.end_again")
            return
        from console.session.station.commands import AskTruth  # not for the first page

        if self.ui.control.post(AskTruth()):
            self.ui.attempt = attempt.end_attempt(self.ui.control.now_s())

    def _answer(self, attempt: Attempt, action: str) -> None:
        """Choose an answer, or give the chosen one: that is possible once."""
        if action in _STEPS:
            self._choice = (self._choice + _STEPS[action]) % len(self._answers(attempt))
        else:
            self.ui.attempt = attempt.answer_question(self._choice)

    @property
    def keys(self) -> tuple[RowKey, ...]:
        """Those of a question that is due."""
        attempt = self._attempt
        return _ANSWER_KEYS if attempt is not None and attempt.asks_now else ()

    def why_not(self, action: str, view: View) -> tuple[Problem, ...]:
        """Return why no lesson can be ended now, or nothing answered."""
        attempt = self._attempt
        if attempt is not None and attempt.asks_now:
            return ()
        if action in _STEPS:
            return (Problem(code="training.no_question"),)
        if attempt is None or attempt.ended_s is not None:
            return (Problem(code="training.none" if attempt is None else "training.over"),)
        return refusal(view.state, action)

    def _show_debrief(self, attempt: Attempt, truth: Truth, now_s: float) -> None:
        """Show the debrief; the first time, keep the try."""
        if self._over is None:
            self._over = self._keep_try(attempt, debrief_of(attempt, truth, now_s), now_s)
        (debrief, scores), text, size = self._over, self.ui.text, self._steps.size
        rows = score_lines(debrief, scores, text, max(size.width, 1), self._answers(attempt))
        self._steps.show(clip_lines(rows, size.height, text("panel.more")), text("debrief.title"))
        width = max(self._hint.size.width, 1)
        rows = [*advice_lines(debrief, text, width), BLANK, *happened_lines(attempt, text, width)]
        self._hint.show(clip_lines(rows, self._hint.size.height, text("panel.more")), text("debrief.next_time"))

    def _answers(self, attempt: Attempt) -> tuple[str, ...]:
        return attempt.lesson.words[self.ui.text.language].answers

    def _keep_try(self, attempt: Attempt, debrief: Debrief, now_s: float) -> tuple[Debrief, tuple[int, ...]]:
        """Keep the try; return the debrief with the scores of all tries of this lesson, the newest last."""
        scores: tuple[int, ...] = (debrief.score,)
        with self.ui.answering():
            keep_try(self.ui.data, try_of(attempt, debrief, now_s))
            forget_left(self.ui.data, attempt.trainee, attempt.lesson.name)
            found = tries(self.ui.data, attempt.trainee, attempt.lesson.name)
            scores = tuple(each.score for each in found)
        return debrief, scores

    def next_step(self, view: View) -> Line:
        """Return the step that is due."""
        attempt, text = self._attempt, self.ui.text
        if attempt is None:
            return line((text("train_page.next.none"), Token.ACTION))
        if attempt.ended_s is not None:
            return line((text("train_page.next.over"), Token.ACTION))
        if attempt.done:
            return line((text("train_page.next.done"), Token.ACTION))
        if attempt.asks_now:
            return line((text("train_page.next.answer"), Token.ACTION))
        step = text(f"train_page.step.{attempt.lesson.steps[attempt.step]}")
        return line((text("train_page.next.step", step=step), Token.ACTION))

    def in_full(self, view: View, width: int) -> list[Line]:
        """Return the whole lesson: goal, and every hint."""
        attempt = self._attempt
        if attempt is None:
            return self._list(width)
        if self._over is not None:
            debrief, scores = self._over
            said = score_lines(debrief, scores, self.ui.text, width, self._answers(attempt))
            advice = advice_lines(debrief, self.ui.text, width)
            return [*said, BLANK, *advice, BLANK, *happened_lines(attempt, self.ui.text, width)]
        words = attempt.lesson.words[self.ui.text.language]
        hints = [row for hint in words.hints for row in (*wrap_line(hint, width), BLANK)]
        if attempt.asks_now:
            hints = [*question_lines(words, self._choice, width), BLANK, *hints]
        return [*self._progress(attempt, words, view, width), BLANK, *hints]

    def _progress(self, attempt: Attempt, words: Words, view: View, width: int) -> list[Line]:
        text = self.ui.text
        job = (dim(text("train_page.job", job=attempt.lesson.job)),)
        rows: list[Line] = [*wrap_line(words.goal, width), job, BLANK]
        for number, name in enumerate(attempt.lesson.steps):
            said = text(f"train_page.step.{name}")
            if number < attempt.step:
                at = dim(clock(attempt.reached[number][1]))
                rows.append(justify_line(line((f"{_DONE} ", Token.OK), said), (at,), width))
            elif number == attempt.step:
                rows.append(line((f"{_CURRENT} {said}", Token.STRONG)))
            else:
                rows.append((dim(f"{_OPEN} {said}"),))
        left_s = attempt.left_s(view.now_s)
        known = "train_page.left" if left_s >= 0.0 else "train_page.over"
        rows += [BLANK, line(text(known, time=clock(abs(left_s))))]
        facts = text("train_page.facts", stops=attempt.stops, collisions=len(attempt.collision_kinds))
        return [*rows, (dim(facts),)]

    def _hints(self, attempt: Attempt, words: Words, width: int) -> list[Line]:
        if attempt.done:
            return wrap_line(self.ui.text("train_page.done"), width)
        if attempt.asks_now:
            return [
                *question_lines(words, self._choice, width),
                BLANK,
                *wrap_line(words.hints[attempt.step], width),
            ]
        hint = wrap_line(words.hints[attempt.step], width)
        if attempt.step == attempt.continued > 0:
            return [*wrap_line(self.ui.text("train_page.continued"), width, Token.STRONG), BLANK, *hint]
        return hint

    def _list(self, width: int) -> list[Line]:
        """Return all lessons, each with how it is begun; read once while the page is there."""
        text = self.ui.text
        if self._shelf is None:
            self._shelf = lessons(own_folder(self.ui.data))
            self._best = self._best_scores()
        rows: list[Line] = [*wrap_line(text("train_page.begin"), width), BLANK]
        for name, lesson in self._shelf:
            if isinstance(lesson, Lesson):
                minutes = dim(text("train_page.minutes", minutes=f"{lesson.minutes:g}"))
                best = self._best.get(name)
                score = () if best is None else (dim(text("train_page.best", score=best)), dim("  "))
                rows.append(justify_line(line((name, Token.STRONG)), (*score, minutes), width))
                rows += wrap_line(lesson.words[text.language].title, width, Token.DIM)
            else:
                rows.append(line((name, Token.STRONG)))
                rows += [
                    row for problem in lesson for row in wrap_line(text.problem(problem), width, Token.WARNING)
                ]
        return rows

    def _best_scores(self) -> dict[str, int]:
        """Return the best score of each lesson that was tried, whoever did; a try that cannot be read is told."""
        best: dict[str, int] = {}
        with self.ui.answering():
            for each in tries(self.ui.data):
                best[each.lesson] = max(each.score, best.get(each.lesson, 0))
        return best

    def leave(self) -> None:
        """Read the lessons anew the next time."""
        self._shelf, self._asked = None, False
