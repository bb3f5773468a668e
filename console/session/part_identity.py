"""Identity of a part: by what names its certificate is found, and how warm it was when it was measured.

A run keeps it as an event, the newest one holds. The next part of the job keeps all but the serial number, which
counts up if it ends in digits, and the temperature. A part that is finished in a second run keeps its number.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.typed_number import typed_number
from profiles.fields import Field, FieldType, fault
from profiles.problem import Problem, ProfileError
from profiles.strict_values import from_json

if TYPE_CHECKING:
    from console.session.data.run_story import RunStory

IDENTIFIED = "identified"
"""Kind of the event."""

OF_PART = "of_part"
_LONGEST = 32  # characters, of which a line of the certificate has room for all
_WAIT_S = 1.0
_NEWEST = f"""
SELECT events.data,
    (SELECT count(DISTINCT part) FROM measurements WHERE run_id = runs.run_id AND product = 1),
    runs.stage IS NOT 'air' AND NOT coalesce(json_extract(runs.setup, '$.clamped_at') = ?
        AND julianday(runs.started_utc) > julianday('now') - 1, 0) AND EXISTS (
        SELECT 1 FROM events AS other WHERE other.run_id = runs.run_id AND
        (other.kind = 'started' OR (other.kind = 'step' AND json_extract(other.data, '$.step') = 'cut')))
FROM events JOIN runs USING (run_id)
WHERE events.kind = '{IDENTIFIED}' AND runs.job = ? AND runs.simulated = ?
ORDER BY runs.rowid DESC, events.rowid DESC LIMIT 1
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class PartIdentity:
    """What a part is called, "" where it is not stated, and its temperature, None if not stated."""

    part_name: str = ""
    drawing: str = ""
    order: str = ""
    batch: str = ""
    serial_number: str = ""
    temperature_c: float | None = None

    def counted_up(self, parts: int) -> PartIdentity:
        """Return it for the part that is made so many parts later; a serial number without digits is not known."""
        if not parts:
            return self
        kept = replace(self, temperature_c=None)
        found = re.search("[0-9]+$", self.serial_number)
        if found is None:
            return replace(kept, serial_number="")
        number = f"{int(found[0]) + parts:0{len(found[0])}d}"
        return replace(kept, serial_number=self.serial_number[: found.start()] + number)

    def event(self, of_part: int = 1) -> dict[str, object]:
        """Return it as the record keeps it, stated of the first product of its run or of a later one."""
        return {**asdict(self), OF_PART: of_part}


KEYS = tuple(each.name for each in fields(PartIdentity))
FIELDS: Mapping[str, Field] = {
    **{key: Field(key=key, kind=FieldType.TEXT, default="", longest=_LONGEST) for key in KEYS[:-1]},
    KEYS[-1]: Field(key=KEYS[-1], unit="°C", at_least=-20, at_most=80, optional=True),
}


def identity_values(typed: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of fields as they were typed; an empty one is not stated.

    Raises ProfileError: `value.not_text`, `value.blank`, `value.out_of_range`; as `typed_number`.
    """
    values, problems = dict[str, Any](), list[Problem]()
    for key, words in typed.items():
        field, plain = FIELDS[key], words.strip()
        value: object = plain
        if field.kind is FieldType.NUMBER:
            value = typed_number(plain, key, field.limit) if plain else None
        if value is not None and (code := fault(field, value)):
            problems.append(Problem(code=code, key=key, value=plain, limit=field.limit))
        values[key] = value
    if problems:
        raise ProfileError(*problems)
    return values


def identity_of(story: RunStory, values: Mapping[str, Any] | None = None) -> PartIdentity | None:
    """Return that of the last product of a run, with other `values` where given; None if none is stated."""
    stated = [event.data for event in story.events if event.kind == IDENTIFIED]
    found = _read(stated[-1], products_of(story)) if stated else None
    return replace(found or PartIdentity(), **values) if values else found


def products_of(story: RunStory) -> int:
    """Return how many products of a run were measured, at least 1."""
    return max(len({part.part for part in story.parts if part.product}), 1)


def next_identity(folder: Path, job: str, *, simulated: bool, clamped_at: object = None) -> PartIdentity | None:
    """Return that of the next part of a job; None if none was stated before. sqlite3.Error, SessionError.

    What was begun in the clamping of that stamp, a time of the day, and not measured is still the same part.
    """
    from console.session.data.record_file import rows

    for data, products, begun in rows(folder, _NEWEST, (clamped_at, job, int(simulated)), _WAIT_S):
        found = _read(from_json(data), max(products, 1) + bool(begun or products))
        return replace(found, temperature_c=None)
    return None


def _read(event: Mapping[str, Any], part: int) -> PartIdentity:
    """Return the identity of a part of the run, counted from 1, by what was stated of one."""
    values = {key: event[key] for key in KEYS if key in event and not fault(FIELDS[key], event[key])}
    of_part = event.get(OF_PART)
    return PartIdentity(**values).counted_up(part - of_part if isinstance(of_part, int) else 0)
