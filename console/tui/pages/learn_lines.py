"""Text of the panel Learn: a part in plain words, its learning step; and how a part is cut, in two words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from typing import Any

from console.session.data.learned_store import NONE
from console.session.data.measured_part import MODEL, MadeWith
from console.session.force_record import ForceCheck
from console.session.guide.measured_part import in_scatter, is_elsewhere, is_kept, jaw_explains
from console.session.learning.learning_steps import LearningOutcome, LeftHarmonic
from console.session.learning.part_learning import PartLearning
from console.session.stages import Stage
from console.session.station.state import MeasuredPart
from console.session.work import Work
from console.text.catalogue import Catalogue
from console.text.part_sentences import along_words, certificate_lines, force_words
from console.text.recorded_words import is_plain, stage_words, strategy_words
from console.text.run_debrief import LEAST_NAMED_UM, fault_words
from console.tui.lines import BLANK, Line, hanging, line, name_in, wrap_line
from console.tui.theme import Token
from profiles.compensations.path import expect_residual
from profiles.files import printable
from profiles.metrology.length_causes import LengthCause

_DATED = re.compile(r"-(\d{4})-?(\d\d)-?(\d\d)T(\d\d):?(\d\d)")
_LONGEST_NAME = 16
_MARK = ("! ", Token.WARNING)
_CAUSE = ("✗ ", Token.WARNING)
NOTHING_LEFT = "learned.nothing"


def learn_title(learning: PartLearning, text: Catalogue) -> str:
    """Return the title: how the part was cut."""
    return text("inspect_page.learn", made=part_words(text, learning.made))


def cut_words(
    text: Catalogue,
    strategy: str,
    compensation: str | None,
    stage: str | None,
    inverted: str | None = None,
    *,
    brief: bool = False,
) -> str:
    """Return how a part was cut: strategy, compensation and stage; unrecorded ones (None) are omitted.

    A plain cut has no compensation. `brief`: without the usual stage.
    """
    said = [strategy_words(strategy, text)]
    if compensation is not None and not is_plain(strategy):
        said.append(compensation_words(text, None if compensation == NONE else compensation, inverted or MODEL))
    if not (brief and stage == Stage.FULL):
        said.append(stage_words(strategy, stage, text, "made"))
    return ", ".join(printable(each, 30) for each in said if each)


def part_words(text: Catalogue, made: MadeWith) -> str:
    """Return how a part was cut."""
    return cut_words(text, made.strategy, made.compensation, made.stage, made.inverted)


def learn_lines(
    learning: PartLearning,
    work: Work | None,
    text: Catalogue,
    width: int,
    *,
    failed: bool = False,
    brief: bool = False,
    along: Sequence[LengthCause] = (),
    marked: bool = False,
) -> list[Line]:
    """Return the part in plain words, its learning step in figures or why it has none, and warnings.

    A part that has `failed` begins with the causes; `brief` shows only the first. Of one that is
    `marked`, which fails by the mark of a stop alone (`along`), nothing else is said.
    """
    how: dict[str, Any] = {"failed": failed, "brief": brief, "along": along, "marked": marked}
    lines = head_lines(learning, work, text, width, **how)
    taught = learning.taught
    if not failed and not brief:
        for words in along_words(along, text):
            lines += hanging(_CAUSE, words, width)
    if taught is not None and not marked:
        lines += wrap_line(_harmonics_words(taught, text), width)
        lines += wrap_line(" · ".join(_facts(taught, work, text)), width)
        for problem in taught.warnings:
            lines += hanging(_MARK, text.problem(problem), width, Token.WARNING)
    return lines


def head_lines(
    learning: PartLearning,
    work: Work | None,
    text: Catalogue,
    width: int,
    *,
    failed: bool,
    brief: bool,
    along: Sequence[LengthCause] = (),
    marked: bool = False,
) -> list[Line]:
    """Return the plain words: causes of a failed part, its residual, the key to press, reasons of a refusal."""
    if marked:
        said = " ".join((text("inspect_page.plain.missed"), *along_words(along, text)))
        return hanging(_CAUSE, said, width, Token.STRONG)
    lines = cause_lines(learning, text, width, brief=brief, along=along) if failed else []
    worse = [text.problem(each) for each in learning.faults.worse]
    words = "".join(worse) or plain_words(learning, work, text, failed=failed)
    lines += wrap_line(words, width, Token.STRONG)
    return [*lines, *reason_lines(learning, text, width)]


def force_lines(part: MeasuredPart, check: ForceCheck | None, text: Catalogue, width: int) -> list[Line]:
    """Return the verdict of the cutting force on a half-stage part."""
    if check is None or not part.is_half or not check.is_of(part.job):
        return []
    token = Token.WARNING if check.found.alarms else Token.TEXT
    return wrap_line(force_words(check.found, text), width, token)


def cause_lines(
    learning: PartLearning, text: Catalogue, width: int, *, brief: bool, along: Sequence[LengthCause]
) -> list[Line]:
    """Return what a part that failed may have: the hypotheses, then what else is on it and `along` its length.

    `brief`: only the first of these.
    """
    likely, words = fault_words(learning.faults.diagnosis, along, text)
    words = [*likely, *([text("diagnosis.alone")] if likely and words else []), *words][: 1 if brief else None]
    said = [" ".join((text("inspect_page.plain.missed"), *words[:1])), *words[1:]]
    return [row for sentence in said for row in hanging(_CAUSE, sentence, width, Token.STRONG)]


def reason_lines(learning: PartLearning, text: Catalogue, width: int) -> list[Line]:
    """Return why nothing is learned from the part, with the remedies."""
    reasons = [text.problem(problem) for problem in learning.reasons]
    return [row for reason in reasons for row in hanging(_MARK, reason, width, Token.WARNING)]


def certified_lines(learning: PartLearning, text: Catalogue, width: int) -> list[Line]:
    """Return the certificate of every order, below a free line; nothing where nothing is learned from the part."""
    if learning.taught is None:
        return []
    step = learning.taught.step
    title, *rows = certificate_lines(step.certificate, step.next.path.target.lobes, text) or [""]
    return [BLANK, *wrap_line(title, width, Token.STRONG), *(line((row, Token.TEXT)) for row in rows)]


def compensation_words(text: Catalogue, version: str | None, inverted: str = MODEL) -> str:
    """Return the compensation of a cut: the learned version, None for the inverse of `inverted`."""
    if version is not None:
        return text("made.learned", version=version)
    return text("made.model") if inverted == MODEL else identified_words(text, inverted)


def made_words(text: Catalogue, version: str | None, stage: str, inverted: str = MODEL) -> str:
    """Return compensation and stage of a cut."""
    return f"{compensation_words(text, version, inverted)}, {text(f'made.{stage}')}"


def identified_words(text: Catalogue, name: str) -> str:
    """Return in short which identified response was inverted: its date, local time, else its name."""
    found, shown = _DATED.search(name), name_in(printable(name), _LONGEST_NAME)
    if found is not None:
        year, month, day, hour, minute = (int(each) for each in found.groups())
        with suppress(ValueError, OverflowError):
            local = datetime(year, month, day, hour, minute, tzinfo=UTC).astimezone()
            shown = local.strftime("%m-%d %H:%M")
    return text("made.identified", date=shown)


def chosen_words(text: Catalogue, work: Work) -> str:
    """Return the choice for the open job; for a version that repeats another one also that."""
    learned = work.compensation
    if learned is None and work.inverts is not None:
        return made_words(text, None, work.stage, work.inverts.name)
    if learned is None or learned.reverts is None:
        return made_words(text, None if learned is None else str(learned.version), work.stage)
    older = text("made.model") if learned.is_model else str(learned.reverts)
    return made_words(text, f"{learned.version} (= {older})", work.stage)


def _harmonics_words(taught: LearningOutcome, text: Catalogue) -> str:
    def um(value: float) -> str:
        return text.units.figure(value, "um", 2)

    if taught.step.reasons:  # no promise for a next part that will not be cut with it
        left = " · ".join(f"{each.order}/rev {um(each.left_um_pp)}" for each in taught.harmonics)
        return text("inspect_page.left", harmonics=left)
    lobe = taught.step.next.path.target.lobes
    scatter, noise = f" ± {um(taught.step.expected_half_width_um_pp)}", text("inspect_page.noise")
    words = []
    for each in taught.harmonics:
        expected_um = f"→ {um(each.expected_um_pp)}{scatter if each.order == lobe else ''}"
        words.append(f"{each.order}/rev {um(each.left_um_pp)} {expected_um if each.learned else noise}")
    return text("inspect_page.left", harmonics=" · ".join(words))


def _facts(taught: LearningOutcome, work: Work | None, text: Catalogue) -> list[str]:
    step = taught.step
    facts = [] if step.reasons else [f"{text('learned.gain')} {step.next.gain:.3g}"]
    if step.contraction is not None:
        found = step.contraction
        factor = f"{found.value:.2f} ± {found.half_width:.2f}"
        facts.append(text(f"inspect_page.verdict.{found.verdict}", factor=factor))
    if work is not None:
        facts.append(text("inspect_page.next_cut_with", made=chosen_words(text, work)))
    return facts


NOTHING_LEFT = "learned.nothing"


def plain_words(learning: PartLearning, work: Work | None, text: Catalogue, *, failed: bool) -> str:
    """Return one or two sentences on the learning step of a part; those of a refusal end in its reasons.

    A part that has `failed` cannot stay, even within clamping scatter.
    """
    taught = learning.taught
    if any(reason.code == NOTHING_LEFT for reason in learning.reasons):
        return text("inspect_page.plain.noise")
    if taught is None or learning.reasons:
        return text("inspect_page.plain.refused")
    lobe = _lobe(taught)
    learned = [each for each in taught.harmonics if each.learned and each.left_um_pp >= LEAST_NAMED_UM]
    if taught.stage is Stage.PARTIAL:
        return f"{text('inspect_page.plain.half', left=_um(lobe, text))} {_half_words(taught, text)}"
    if is_kept(learning, work):
        return text("inspect_page.plain.accepted", left=_um(lobe, text))
    if lobe in learned:
        scatter = text.units.figure(taught.step.expected_half_width_um_pp, "um", 1)
        word = "correct"
        if is_elsewhere(taught):
            word = "elsewhere"
        elif in_scatter(taught):
            word = "may_scatter" if failed else "scatter"
        elif failed and jaw_explains(learning):
            word = "jaw"
        return text(f"inspect_page.plain.{word}", left=_um(lobe, text), scatter=scatter)
    if not learned:
        return text("inspect_page.plain.noise")
    most = max(learned, key=lambda each: each.left_um_pp)
    return text("inspect_page.plain.other", n=most.order, left=_um(most, text))


def _half_words(taught: LearningOutcome, text: Catalogue) -> str:
    part = taught.step.next.part
    whole_um_pp = 0.0 if part is None else 2.0 * part.target.amplitude_um / taught.stage.fraction
    left = expect_residual(whole_um_pp, taught.stage.fraction)
    right, wrong = (text.units.figure(each, "um", 1) for each in (left.right_um_pp, left.wrong_um_pp))
    return text("inspect_page.half_left", right=right, wrong=wrong)


def _lobe(taught: LearningOutcome) -> LeftHarmonic | None:
    order = taught.step.next.path.target.lobes
    return next((each for each in taught.harmonics if each.order == order), None)


def _um(harmonic: LeftHarmonic | None, text: Catalogue) -> str:
    return text.units.figure(0.0 if harmonic is None else harmonic.left_um_pp, "um", 1)
