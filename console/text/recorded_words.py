"""Words for a recorded run: the same in the log, the command, the page Records and the report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from datetime import datetime
from enum import StrEnum
from typing import TYPE_CHECKING

from console.session.stages import Stage
from console.session.station.commands import Command
from console.text.catalogue import Catalogue
from drivers.cutting.strategy import Strategy
from profiles.files import printable
from profiles.problem import Problem

if TYPE_CHECKING:
    from console.session.data.run_facts import RunFact
    from console.session.data.run_rows import RunEnding
    from console.session.data.run_story import AlarmStory, RunEvent, RunStory
    from console.session.part_identity import PartIdentity

COMMANDS = {each.__name__: each.logged for each in Command.__subclasses__()}
"""Every command by its name, and whether it is an order of the operator."""

LONGEST = 1000
DONE = "done"  # of `How`, which takes the reader of records with it
OPEN = "…"  # in the place of a fact that was not recorded


def command_words(name: str, text: Catalogue) -> str:
    """Return a command in words; an unknown one by its name in the record."""
    return text(f"command.{name}") if name in COMMANDS else printable(name, 40)


def order_words(name: str, text: Catalogue) -> str:
    """Return a command of the operator as one, for a list of events."""
    words = command_words(name, text)
    return text("records.order", words=words) if COMMANDS.get(name, True) else words


def problem_words(problem: Problem, text: Catalogue) -> str:
    """Return the sentence of a recorded problem."""
    return printable(text.problem(problem), LONGEST)


def alarm_words(code: str, text: Catalogue) -> str:
    """Return the case of an alarm known by its code alone, without the remedy."""
    return problem_words(Problem(code=code, key=OPEN, value=OPEN, limit=OPEN), text).partition(";")[0]


def reason_words(ending: RunEnding, text: Catalogue) -> str:
    """Return why a run ended: the problems of an early end, the name of a stop, or a sentence as it is."""
    if ending.problems:
        return "; ".join(problem_words(each, text) for each in ending.problems)
    return printable(text.reason(ending.reason), LONGEST)


def is_plain(strategy: str) -> bool:
    """Whether a recorded cut has no compensation; an unknown strategy is taken to have one."""
    return strategy in [each.value for each in Strategy if not each.traits.follows_lobe]


def plain_cut_words(strategy: str, stage: str, text: Catalogue, family: str = "stage") -> str:
    """Return how a plain cut was made; "" for any other."""
    said = strategy_words(strategy, text), stage_words(strategy, stage, text, family)
    return ", ".join(filter(None, said)) if is_plain(strategy) else ""


def strategy_words(strategy: str, text: Catalogue) -> str:
    """Return the strategy of a cut; a plain one has none."""
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


class Layout(StrEnum):
    """Layout in which a fact of a run is shown."""

    PAGE = "page"
    COMMAND = "command"
    REPORT = "report"


_ENDED = {
    Layout.PAGE: "records_page.ending",
    Layout.COMMAND: "records.how",
    Layout.REPORT: "report.ended",
}


def ending_words(ended: RunEnding, text: Catalogue, layout: Layout) -> str:
    """Return how a run ended: after which turn, why, and by whom."""
    how, by = text(f"{_ENDED[layout]}.{ended.how}"), ended.by
    turn = "" if ended.turn is None else f"{ended.turn:.1f}"
    why = reason_words(ended, text) if ended.reason else ""
    if layout is Layout.REPORT:
        facts = {"after": {"turns": turn}, "by": {"name": by}, "for": {"reason": why}}
        known = [text(f"report.ended_{key}", **each) for key, each in facts.items() if any(each.values())]
        return "; ".join((how, *known)) + "."
    turn = turn and text("records.turn", turn=turn)
    if layout is Layout.PAGE:
        return " · ".join(filter(None, (how, turn, why, printable(by, 40))))
    how = f"{how} ({turn})" if turn and ended.how != DONE else how
    return ": ".join(filter(None, (how, ", ".join(filter(None, (why, by))))))


_DIGITS = {"N": (1, 0, 1), "deg": (2, 2, 2), "mm": (3, 3, 4)}
"""Of a fact by its kind, in the order of the layouts."""

SHORT_HASH = 16


def fact_rows(facts: Iterable[RunFact], text: Catalogue, layout: Layout) -> list[tuple[str, str]]:
    """Return name and value of each fact; the report lists those not recorded, others omit them."""
    rows = [(fact_name(each, text, layout), fact_words(each, text, layout)) for each in facts]
    unknown = text("report.not_recorded") if layout is Layout.REPORT else ""
    return [(name, value or unknown) for name, value in rows if value or unknown]


def fact_name(fact: RunFact, text: Catalogue, layout: Layout) -> str:
    """Return the name of a fact in a layout."""
    return text.first_sentence(f"fact.{fact.key}.{layout}", f"fact.{fact.key}")


def fact_words(fact: RunFact, text: Catalogue, layout: Layout) -> str:
    """Return the value of a fact with unit, time and notes; "" for none."""
    value = fact.value
    if isinstance(value, str):
        shown = value[:SHORT_HASH] if fact.kind == "hash" and layout is Layout.COMMAND else printable(value, 100)
    elif value is None:
        shown = ""
    else:
        digits = _DIGITS[fact.kind][[*Layout].index(layout)]
        if fact.kind == "mm" and layout is Layout.PAGE:
            shown = f"R {text.units.show(value, 'mm', digits)}"
        else:
            shown = f"{value:z.{digits}f} {fact.kind}"
            shown = shown if layout is Layout.COMMAND else shown.replace(" deg", "°")
    if shown and fact.at:
        at = printable(fact.at, 20)
        shown = text("report.taken_at", value=shown, at=at) if layout is Layout.REPORT else f"{shown} ({at})"
    return " · ".join(filter(None, (shown, *(text(each) for each in fact.notes))))


def identity_rows(identity: PartIdentity, text: Catalogue) -> list[tuple[str, str]]:
    """Return name and value of what is stated of a part."""
    stated = ((key, value) for key, value in asdict(identity).items() if value not in ("", None))
    return [
        (text(f"identity.{key}"), value if isinstance(value, str) else f"{value:g} °C") for key, value in stated
    ]


def identity_words(identity: PartIdentity, text: Catalogue) -> str:
    """Return what is stated of a part on one line."""
    return " · ".join(f"{name} {value}" for name, value in identity_rows(identity, text))


def timed_words(story: RunStory, text: Catalogue) -> dict[str, list[tuple[str, str]]]:
    """Return alarms and commands of a run, each with its time."""
    return {
        "alarms": [(clock(each.raised), story_alarm_words(each, text)) for each in story.alarms],
        "commands": [(clock(each.at), story_command_words(each, text)) for each in story.commands],
    }


def story_command_words(event: RunEvent, text: Catalogue) -> str:
    """Return a recorded command with its values, and who gave it."""
    data = event.data
    plain = {k: v for k, v in data.items() if k not in ("command", "by") and not isinstance(v, list | dict)}
    values = printable(", ".join(f"{key} {value}" for key, value in plain.items()), LONGEST)
    by = printable(str(data.get("by") or ""), 30)
    return "  ".join(filter(None, (command_words(str(data.get("command", "")), text), values, by)))


def story_alarm_words(alarm: AlarmStory, text: Catalogue) -> str:
    """Return a recorded alarm with when it was acknowledged, and when it ended."""
    stamps = {"acknowledged": alarm.acknowledged, "ended": alarm.ended}
    told = [f"({text(f'alarms_page.{name}', at=clock(at))})" for name, at in stamps.items() if at is not None]
    return " ".join([text.problem(alarm.problem), *told])


def local(date: datetime) -> str:
    """Return a date in local time, to the minute; a dash for a damaged one."""
    return "–" if date.year < 2 else date.astimezone().strftime("%Y-%m-%d %H:%M")


def clock(date: datetime) -> str:
    """Return the time of a date, local, to the second; a dash for a damaged one."""
    return "–" if date.year < 2 else date.astimezone().strftime("%H:%M:%S")
