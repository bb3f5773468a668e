"""Words for what is recorded of a run: the same in the log, the command, the page Records and the report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from console.session.stages import Stage
from console.session.station.commands import Command
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import Strategy
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.session.data.run_rows import Ending

COMMANDS = {each.__name__: each.logged for each in Command.__subclasses__()}
"""Every command by its name, and whether it is an order of the operator."""

LONGEST = 1000
OPEN = "…"  # in the place of a fact that was not recorded


def command_words(name: str, text: Catalogue) -> str:
    """Return a command in words; one of another version of the console by its name in the record."""
    return text(f"command.{name}") if name in COMMANDS else printable(name, 40)


def order_words(name: str, text: Catalogue) -> str:
    """Return a command with who gave it, where it stands among what else has happened."""
    words = command_words(name, text)
    return text("records.order", words=words) if COMMANDS.get(name, True) else words


def problem_words(problem: Problem, text: Catalogue, alarms: Iterable[Problem] = ()) -> str:
    """Return the sentence of a recorded problem.

    An older console kept the code alone: the rest is then that of the last of the `alarms` with it, or open.
    """
    if not (problem.key or problem.value or problem.limit):
        bare = replace(problem, key=OPEN, value=OPEN, limit=OPEN)
        problem = ([bare, *(each for each in alarms if each.code == problem.code)])[-1]
    return printable(text.problem(problem), LONGEST)


def alarm_words(code: str, text: Catalogue) -> str:
    """Return what was the case in an alarm of which the code alone is known, without what to do."""
    return problem_words(Problem(code=code), text).partition(";")[0]


def reason_words(ending: Ending, text: Catalogue, alarms: Iterable[Problem] = ()) -> str:
    """Return why a run ended: the problems of an early end, the name of a stop, or a sentence as it is."""
    if ending.problems:
        known = tuple(alarms)
        return "; ".join(problem_words(each, text, known) for each in ending.problems)
    return printable(text.reason(ending.reason), LONGEST)


def is_plain(strategy: str) -> bool:
    """Whether a recorded cut has no compensation; an unknown strategy is taken to have one."""
    return strategy in [each.value for each in Strategy if not each.traits.follows_lobe]


def plain_cut_words(strategy: str, stage: str, text: Catalogue, family: str = "stage") -> str:
    """Return how a plain cut was made; empty of any other."""
    said = strategy_words(strategy, text), stage_words(strategy, stage, text, family)
    return ", ".join(filter(None, said)) if is_plain(strategy) else ""


def strategy_words(strategy: str, text: Catalogue) -> str:
    """Return the strategy of a cut, which a plain one does not have."""
    return text("strategy.none.how") if is_plain(strategy) else printable(strategy, 30)


def stage_words(strategy: str, stage: str | None, text: Catalogue, family: str = "stage") -> str:
    """Return the stage of a cut; empty if it is not recorded, and of a plain cut: it has no compensation."""
    if stage is None or (is_plain(strategy) and stage != Stage.AIR):
        return ""
    return text(f"{family}.{stage}") if stage in set(Stage) else printable(stage, 30)


def part_words(name: str, text: Catalogue) -> str:
    """Return a recorded part of a run, such as `after` or `part 2`, in words; "" for none."""
    word, _, number = name.partition(" ")
    said = text(f"part.{word}")
    return " ".join((word if said == f"part.{word}" else said, number)).strip()
