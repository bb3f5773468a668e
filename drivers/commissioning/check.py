"""One thing that was looked at, and what came of it, as facts without words of any language."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto


class Outcome(StrEnum):
    """How it stands with what was looked at."""

    HOLDS = auto()
    NOTED = auto()
    """Neither right nor wrong: the engineer is to know it."""
    WARNED = auto()
    """The machine can work, with less than it should have."""
    FAILS = auto()


class Group(StrEnum):
    """What is looked at together, in the order in which it is told."""

    CARD = auto()
    TOOL = auto()
    SPINDLE = auto()
    CARRIAGE = auto()
    SYSTEM = auto()
    SAFETY = auto()
    STOPS = auto()
    PROGRAMS = auto()
    PROOFS = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """`code` names the sentence. What a sentence can say is `facts`, texts with units that are of no language.

    `setting` is the name of a setting (`drivers.commissioning.setting_names`), `variable` its number such as
    I115, `found` and `wanted` its values with units. `subject` is whose it is: tool, spindle, carriage, or a text
    such as `motor 5`.
    """

    group: Group
    code: str
    outcome: Outcome
    subject: str = ""
    setting: str = ""
    variable: str = ""
    found: str = ""
    wanted: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)


def worst(checks: Iterable[Check]) -> Outcome:
    """Return the worst outcome; nothing looked at holds."""
    order = list(Outcome)
    return max((check.outcome for check in checks), key=order.index, default=Outcome.HOLDS)
