"""Text of the panel Learn: the learning step of a part; and how a part is cut, in two words."""

from __future__ import annotations

from dataclasses import replace

from console.session.learning.learning_steps import Taught
from console.session.learning.part_learning import PartLearning
from console.session.stages import Stage
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.text.causes import cause_words
from console.tui.lines import Line, hanging, wrapped
from console.tui.theme import Token
from profiles.compensations.path import expected

_MARK = ("! ", Token.WARNING)
_CAUSE = ("✗ ", Token.WARNING)


def learn_title(learning: PartLearning, text: Catalogue) -> str:
    """Return the title: how the part was cut."""
    made = learning.made
    return text("inspect_page.learn", made=f"{made.strategy}, {made_words(text, made.version, made.stage)}")


def learn_lines(
    learning: PartLearning,
    work: Work | None,
    text: Catalogue,
    width: int,
    *,
    failed: bool = False,
    brief: bool = False,
) -> list[Line]:
    """Return the learning step or why none; a part that has `failed` cannot stay, even within clamping scatter.

    Of the causes of its failure only the largest is shown where it is to be `brief`.
    """
    lines = cause_lines(learning, text, width, brief=brief) if failed else []
    lines += reason_lines(learning, text, width)
    taught = learning.taught
    if taught is not None:
        if taught.stage is Stage.PARTIAL:
            lines += wrapped(_half_words(taught, text), width, Token.STRONG)
        lines += wrapped(_harmonics_words(taught, text), width, Token.STRONG)
        lines += wrapped(" · ".join(_facts(taught, work, text)), width)
        if in_scatter(taught) and not learning.reasons and not is_kept(learning, work):
            scatter = f"{taught.step.expected_half_width_um_pp:.2f}"
            words = text("inspect_page.may_scatter" if failed else "inspect_page.in_scatter", scatter=scatter)
            lines += hanging(_MARK, words, width, Token.WARNING)
        for problem in taught.warnings:
            lines += hanging(_MARK, text.problem(problem), width, Token.WARNING)
    return lines


def cause_lines(learning: PartLearning, text: Catalogue, width: int, *, brief: bool) -> list[Line]:
    """Return why a part that failed is not round, largest first; the largest alone where it is to be `brief`."""
    causes = () if learning.taught is None else learning.taught.causes
    shown = causes[:1] if brief else causes
    return [row for cause in shown for row in hanging(_CAUSE, cause_words(cause, text), width, Token.STRONG)]


def reason_lines(learning: PartLearning, text: Catalogue, width: int) -> list[Line]:
    """Return why nothing is learned from the part, and what helps."""
    reasons = [text.problem(problem) for problem in learning.reasons]
    return [row for reason in reasons for row in hanging(_MARK, reason, width, Token.WARNING)]


def is_kept(learning: PartLearning | None, work: Work | None) -> bool:
    """Whether the next cut uses this part's learning step."""
    used = None if work is None else work.compensation
    if learning is None or learning.taught is None or used is None:
        return False
    return used == replace(learning.taught.step.next, version=used.version)


def in_scatter(taught: Taught) -> bool:
    """Whether the remaining lobe is within the scatter of clamping and gauge."""
    lobe = taught.step.next.path.target.lobes
    wrong = [abs(each.left_um_pp - each.expected_um_pp) for each in taught.harmonics if each.order == lobe]
    return max(wrong, default=0.0) < taught.step.expected_half_width_um_pp


def made_words(text: Catalogue, compensation: str | None, stage: str) -> str:
    """Return compensation and stage; `compensation` is the learned version, None the model."""
    what = text("made.model") if compensation is None else text("made.learned", version=compensation)
    return f"{what}, {text(f'made.{stage}')}"


def chosen_words(text: Catalogue, work: Work) -> str:
    """Return the choice for the open job; for a version that repeats another one also that."""
    learned = work.compensation
    if learned is None or learned.reverts is None:
        return made_words(text, None if learned is None else str(learned.version), work.stage)
    older = text("made.model") if learned.is_model else str(learned.reverts)
    return made_words(text, f"{learned.version} (= {older})", work.stage)


def _half_words(taught: Taught, text: Catalogue) -> str:
    part = taught.step.next.part
    whole_um_pp = 0.0 if part is None else 2.0 * part.target.amplitude_um / taught.stage.fraction
    left = expected(whole_um_pp, taught.stage.fraction)
    return text("inspect_page.half_left", right=f"{left.right_um_pp:.1f}", wrong=f"{left.wrong_um_pp:.1f}")


def _harmonics_words(taught: Taught, text: Catalogue) -> str:
    if taught.step.reasons:  # no promise for a next part that will not be cut with it
        left = " · ".join(f"{each.order}/rev {each.left_um_pp:.2f}" for each in taught.harmonics)
        return text("inspect_page.left", harmonics=left)
    lobe = taught.step.next.path.target.lobes
    scatter, noise = f" ± {taught.step.expected_half_width_um_pp:.2f}", text("inspect_page.noise")
    words = []
    for each in taught.harmonics:
        expected_um = f"→ {each.expected_um_pp:.2f}{scatter if each.order == lobe else ''}"
        words.append(f"{each.order}/rev {each.left_um_pp:.2f} {expected_um if each.learned else noise}")
    return text("inspect_page.left", harmonics=" · ".join(words))


def _facts(taught: Taught, work: Work | None, text: Catalogue) -> list[str]:
    step = taught.step
    facts = [] if step.reasons else [f"{text('learned.gain')} {step.next.gain:g}"]
    if step.contraction is not None:
        found = step.contraction
        factor = f"{found.value:.2f} ± {found.half_width:.2f}"
        facts.append(text(f"inspect_page.verdict.{found.verdict}", factor=factor))
    if work is not None:
        facts.append(text("inspect_page.next_cut_with", made=chosen_words(text, work)))
    return facts
