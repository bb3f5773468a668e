"""What a measured part says, in the words of the operator: what is left of the lobe, and what to press."""

from __future__ import annotations

from console.session.guide.measured_part import in_scatter, is_elsewhere, is_kept, jaw_explains
from console.session.learning.learning_steps import LearningOutcome, LeftHarmonic
from console.session.learning.part_learning import PartLearning
from console.session.stages import Stage
from console.session.work import Work
from console.text.catalogue import Catalogue
from profiles.compensations.path import expected

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
    if taught.stage is Stage.PARTIAL:
        return f"{text('inspect_page.plain.half', left=_um(lobe, text))} {_half_words(taught, text)}"
    if is_kept(learning, work):
        return text("inspect_page.plain.accepted", left=_um(lobe, text))
    if lobe is not None and lobe.learned:
        scatter = text.units.figure(taught.step.expected_half_width_um_pp, "um", 1)
        word = "correct"
        if is_elsewhere(taught):
            word = "elsewhere"
        elif in_scatter(taught):
            word = "may_scatter" if failed else "scatter"
        elif failed and jaw_explains(taught):
            word = "jaw"
        return text(f"inspect_page.plain.{word}", left=_um(lobe, text), scatter=scatter)
    others = [each for each in taught.harmonics if each.learned]
    if not others:
        return text("inspect_page.plain.noise")
    most = max(others, key=lambda each: each.left_um_pp)
    return text("inspect_page.plain.other", n=most.order, left=_um(most, text))


def _half_words(taught: LearningOutcome, text: Catalogue) -> str:
    part = taught.step.next.part
    whole_um_pp = 0.0 if part is None else 2.0 * part.target.amplitude_um / taught.stage.fraction
    left = expected(whole_um_pp, taught.stage.fraction)
    right, wrong = (text.units.figure(each, "um", 1) for each in (left.right_um_pp, left.wrong_um_pp))
    return text("inspect_page.half_left", right=right, wrong=wrong)


def _lobe(taught: LearningOutcome) -> LeftHarmonic | None:
    order = taught.step.next.path.target.lobes
    return next((each for each in taught.harmonics if each.order == order), None)


def _um(harmonic: LeftHarmonic | None, text: Catalogue) -> str:
    return text.units.figure(0.0 if harmonic is None else harmonic.left_um_pp, "um", 1)
