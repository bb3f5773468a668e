"""The panel of indicator readings of a clamping: which reading is asked for, and what all of them show."""

from __future__ import annotations

from console.text.catalogue import Catalogue
from console.tui.align.asked import Answer, Asked, Question, entry_row, number_of
from console.tui.align.clamp_typing import MOST_TYPED
from console.tui.lines import BLANK, Line, dim, line, wrapped
from console.tui.theme import Token
from profiles.fingerprint.readings import LEAST_PLACES
from profiles.problem import Problem, ProfileError

MOST_TYPED_UM = 2000.0


def clamp_answer(question: Question) -> Answer:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if question.asked is Asked.INDICATED:
        return Answer()
    if question.asked is Asked.READING:
        return number_of(question, "indicator_um", -MOST_TYPED_UM, MOST_TYPED_UM, decimals=0)
    least, _ = _least(question)
    answer = number_of(question, "places", least, MOST_TYPED, decimals=0)
    if answer.value is not None and not answer.problems and answer.value != round(answer.value):
        limit = f"{least}, {least + 1} … {MOST_TYPED}"
        return Answer(
            value=answer.value,
            problems=(Problem(code="screen.number_out_of_range", value=question.typed, limit=limit),),
        )
    return answer


def clamp_lines(text: Catalogue, question: Question, width: int) -> list[Line]:
    """Return the panel: what to read where, or what the readings show."""
    typing = question.clamp
    if question.asked is Asked.PLACES:
        low, both = _least(question)
        advice = text("align_page.clamp_places", low=low, high=MOST_TYPED, both=both)
        return [entry_row(text("align_page.places"), question), *wrapped(advice, width, Token.DIM)]
    if question.asked is Asked.INDICATED:
        return _shown(text, question, width)
    state = text("align_page.full_force" if typing.full else "align_page.finger_tight")
    where = text("align_page.clamp_place", place=typing.place + 1, of=typing.places, angle=f"{typing.angle_deg:g}")
    rows: list[Line] = [
        entry_row(text("align_page.reads"), question),
        line((state, Token.STRONG)),
        line(where),
    ]
    if typing.full:
        rows.append(
            line(
                dim(
                    text(
                        "align_page.clamp_before",
                        value=text.units.show(typing.values[typing.place], "um", 1, "+z"),
                    )
                )
            )
        )
    return [*rows, *_simulated(text, question)]


def _least(question: Question) -> tuple[int, int]:
    """Return how many places show the height of the lobe, and how many its angle, too."""
    from profiles.fingerprint.deflection import places_needed

    lobes = question.job.jaws if question.job is not None else question.machine.chuck.jaws
    return places_needed(lobes), max(LEAST_PLACES, 2 * lobes + 1)


def _simulated(text: Catalogue, question: Question) -> list[Line]:
    """Return what the indicator of the simulated lathe reads there."""
    found, typing = question.state.indicated, question.clamp
    if found is None or len(found.angle_deg) != typing.places:
        return []
    value = (found.full_um if typing.full else found.finger_um)[typing.place]
    return [
        line(
            ("SIM", Token.SIM),
            dim(" " + text("align_page.clamp_sim", value=text.units.show(value, "um", 0, "+z"))),
        )
    ]


def _shown(text: Catalogue, question: Question, width: int) -> list[Line]:
    """Return the deflection that all readings show, with its confidence, or why they show none."""
    from console.session.learning.fingerprint import expected_of
    from profiles.fingerprint.deflection import deflection_of

    units = question.units
    job, typing = question.job, question.clamp
    rows: list[Line] = [BLANK, line((text("align_page.clamp_all", count=2 * typing.places), Token.STRONG))]
    if job is None:
        return rows
    try:
        readings = typing.readings(simulated=question.state.simulated, inch=units.is_inch)
        shown, unlikely = deflection_of(readings, job), expected_of(readings, job, question.machine)
    except ProfileError as refused:
        said = [text.problem(each) for each in refused.problems]
        return [*rows, *(row for each in said for row in wrapped(each, width, Token.WARNING))]
    lobe = 2.0 * abs(shown.coefficients_um[job.jaws])
    limit = 2.0 * shown.limit_um(job.jaws)
    words = text(
        "align_page.clamp_lobe", n=job.jaws, lobe=units.figure(lobe, "um", 1), limit=units.figure(limit, "um", 1)
    )
    rows.append(line(("→ ", Token.OK), (words, Token.STRONG)))
    if shown.upright:
        rows += wrapped(text("align_page.clamp_upright"), width, Token.DIM)
    return [*rows, *(row for each in unlikely for row in wrapped(text.problem(each), width, Token.WARNING))]
