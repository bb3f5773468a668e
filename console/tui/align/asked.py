"""Numbers that the page Align asks for: how an entry is understood, and what it would do. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from console.session.cut.alignment import Alignment
from console.session.station.durations import jog_s
from console.session.station.jogging import setup_speed, step_speed
from console.session.station.state import StationState
from console.session.station.targets import distance_to, target_problems, target_range
from console.session.typed_number import typed_number
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, clipped, dim, hanging, line, wrapped
from console.tui.pages.fields import named
from console.tui.theme import Token
from drivers.lathe.snapshot import AxisName, Snapshot
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

ENTRY_COLUMN, ENTRY_WIDTH = 12, 12
"""Where the entry is in its panel: after the label, before the unit."""


class Asked(StrEnum):
    """What is asked for."""

    NOTHING = "nothing"
    Z = "z"
    C = "c"


AXES = {Asked.Z: AxisName.CARRIAGE, Asked.C: AxisName.SPINDLE}
UNITS = {Asked.Z: "mm", Asked.C: "°"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What an entry is judged by."""

    asked: Asked
    typed: str
    state: StationState
    job: Job | None
    machine: MachineProfile

    @property
    def alignment(self) -> Alignment:
        """What is known of the machine."""
        return self.state.alignment


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """How an entry was understood: a value, and what is against it. None without a number."""

    value: float | None = None
    problems: tuple[Problem, ...] = ()


def answered(question: Question) -> Answer:
    """Return how the entry is understood; nothing typed is no problem yet."""
    if not question.typed.strip():
        return Answer()
    axis = AXES[question.asked]
    low, high = target_range(question.machine, axis)
    try:
        value = typed_number(question.typed, axis, f"{low:.3f} to {high:.3f} {UNITS[question.asked]}")
    except ProfileError as error:
        return Answer(problems=tuple(error.problems))
    if question.state.snapshot is None:
        return Answer(value=value, problems=(Problem(code="screen.nothing_known"),))
    against = target_problems(question.state.snapshot, question.machine, question.alignment, axis, value)
    return Answer(value=value, problems=against)


def asked_title(text: Catalogue, asked: Asked) -> str:
    """Return the title of the panel of an entry."""
    return text(f"align_page.asked.{asked}")


def asked_lines(text: Catalogue, question: Question, width: int, height: int) -> list[Line]:
    """Return the panel of an entry: its row, the range, how it is understood, what to press."""
    axis, unit = AXES[question.asked], UNITS[question.asked]
    low, high = target_range(question.machine, axis)
    label = text(f"align_page.axis.{axis}")
    head: Line = (dim(label), dim(" " * (ENTRY_COLUMN + ENTRY_WIDTH + 1 - len(label))), dim(unit))
    answer = answered(question)
    snapshot = question.state.snapshot
    now = NOTHING if snapshot is None else _at(question, snapshot)
    rows = [head, line(dim(text("align_page.target_range", now=now, low=f"{low:.3f}", high=f"{high:.3f}"))), BLANK]
    for problem in answer.problems:
        rows += hanging(("✗ ", Token.WARNING), text.problem(named(problem, text)), width)
    if answer.value is not None and not answer.problems and snapshot is not None:
        rows += _echo(text, question, snapshot, answer.value, width)
    rows += [BLANK, *wrapped(text("align_page.target_keys"), width, Token.DIM)]
    return clipped(rows, height, text("panel.more"))


def _at(question: Question, snapshot: Snapshot) -> str:
    if question.asked is Asked.Z:
        return f"{snapshot.carriage.position / question.machine.carriage.counts_per_mm:z.3f}"
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
    rate = "rpm" if question.asked is Asked.C else "mm/s"
    words = text(
        f"align_page.target_{way}",
        way=f"{abs(distance):.{decimals}f} {unit}",
        time=f"{jog_s(machine, axis, distance):.1f} s",
    )
    return [
        line(("→ ", Token.OK), (f"{value:.{decimals}f} {unit}", Token.STRONG)),
        *wrapped(words, width),
        line(dim(text("align_page.target_speed", speed=f"{speed:.1f}", most=f"{most:.1f} {rate}"))),
    ]
