"""A typed target of an axis: how it is understood, its way, its time and its speed."""

from __future__ import annotations

from console.session.station.durations import jog_s
from console.session.station.jogging import setup_speed, step_speed
from console.session.station.targets import distance_to, target_problems, target_range
from console.session.typed_length import typed_length
from console.text.catalogue import Catalogue
from console.tui.align.asked import AXES, UNITS, Answer, Asked, Question, entry_row, range_of, range_words
from console.tui.lines import BLANK, NOTHING, Line, dim, line, wrapped
from console.tui.theme import Token
from drivers.lathe.snapshot import Snapshot
from profiles.problem import Problem, ProfileError


def target_answer(question: Question) -> Answer:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if not question.typed.strip():
        return Answer()
    axis = AXES[question.asked]
    low, high = target_range(question.machine, axis)
    try:
        unit = UNITS[question.asked]
        value = typed_length(question.typed, axis, range_words(question, low, high), unit, question.units)
    except ProfileError as error:
        return Answer(problems=tuple(error.problems))
    if question.state.snapshot is None:
        return Answer(value=value, problems=(Problem(code="screen.nothing_known"),))
    against = target_problems(question.state.snapshot, question.machine, question.alignment, axis, value)
    return Answer(value=value, problems=against)


def target_lines(text: Catalogue, question: Question, width: int) -> list[Line]:
    """Return the panel of an entry: its row, the range, how it is understood."""
    axis, snapshot = AXES[question.asked], question.state.snapshot
    low, high = target_range(question.machine, axis)
    now = NOTHING if snapshot is None else _at(question, snapshot)
    ends = range_of(question, low, high)
    rows = [
        entry_row(text(f"align_page.axis.{axis}"), question),
        line(dim(text("align_page.target_range", now=now, low=ends[0], high=ends[1]))),
        BLANK,
    ]
    answer = target_answer(question)
    if answer.value is None or answer.problems or snapshot is None:
        return rows
    return [*rows, *_echo(text, question, snapshot, answer.value, width)]


def _at(question: Question, snapshot: Snapshot) -> str:
    if question.asked is Asked.Z:
        return question.units.figure(
            snapshot.carriage.position / question.machine.carriage.counts_per_mm, "mm", 3, "z"
        )
    turns = snapshot.spindle.position / question.machine.spindle.counts_per_rev
    return f"{360.0 * (turns % 1.0):.2f}"


def _echo(text: Catalogue, question: Question, snapshot: Snapshot, value: float, width: int) -> list[Line]:
    """Return the target as understood, with its way, its time and its speed."""
    axis, machine = AXES[question.asked], question.machine
    distance = distance_to(snapshot, machine, axis, value)
    speed, most = step_speed(machine, axis, distance), setup_speed(axis)
    decimals, unit = (2, "°") if question.asked is Asked.C else (3, "mm")
    way = (
        ("forward" if distance >= 0.0 else "backward")
        if question.asked is Asked.C
        else ("to_chuck" if distance >= 0.0 else "to_tail")
    )
    rate, units = "rpm" if question.asked is Asked.C else "mm/s", question.units
    words = text(
        f"align_page.target_{way}",
        way=units.show(abs(distance), unit, decimals),
        time=f"{jog_s(machine, axis, distance):.1f} s",
    )
    return [
        line(("→ ", Token.OK), (units.show(value, unit, decimals), Token.STRONG)),
        *wrapped(words, width),
        line(
            dim(
                text("align_page.target_speed", speed=units.figure(speed, rate, 1), most=units.show(most, rate, 1))
            )
        ),
    ]
