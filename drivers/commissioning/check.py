"""One thing that was looked at, and what came of it, as facts without words of any language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto

from profiles.findings import Severity


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
    """One judged setting. No `Finding`: it belongs to a group, with its setting and effect, also where it holds.

    `code` names the sentence. What a sentence can say is `facts`, texts with units that are of no language.

    `setting` is the name of a setting (`drivers.commissioning.setting_names`), `variable` its number such as
    I115, `found` and `wanted` its values with units. `subject` is whose it is: tool, spindle, carriage, or a text
    such as `motor 5`.
    """

    group: Group
    code: str
    severity: Severity
    subject: str = ""
    setting: str = ""
    variable: str = ""
    found: str = ""
    wanted: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)
