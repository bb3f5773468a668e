"""The result of one check, as facts without words of any language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum, auto

from profiles.findings import Severity


class Group(StrEnum):
    """Groups of checks, in the order in which they are shown."""

    CARD = auto()
    TOOL = auto()
    SPINDLE = auto()
    CARRIAGE = auto()
    SYSTEM = auto()
    SAFETY = auto()
    STOPS = auto()
    PROGRAMS = auto()
    PROOFS = auto()
    COMPUTER = auto()


@dataclass(frozen=True, slots=True)
class Check:
    """One judged setting. Not a `Finding`: it belongs to a group, and exists also when it passes.

    `code` names the sentence. Its arguments are `facts`, language-neutral texts with units.

    `setting` is the name of a setting (`drivers.commissioning.setting_names`), `variable` its number such as
    I115, `found` and `wanted` its values with units. `subject` is what it belongs to: tool, spindle, carriage,
    or a text such as `motor 5`.
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


def severity(holds: bool, otherwise: Severity = Severity.REFUSAL) -> Severity:
    """Return the severity of a check that holds, or not."""
    return Severity.OK if holds else otherwise
