"""The facts that every layout shows of a recorded run: page, command, report and debrief.

To add one takes a row here and its words, `fact.KEY`; `fact.KEY.LAYOUT` where a layout calls it otherwise.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from console.session.data.run_story import RunStory
from console.session.data.version_control import VERSIONED
from profiles.strict_values import number_or_none

COMMIT_DIGITS = 12


class FactKind(StrEnum):
    """Kind of a value, from which each layout takes unit and digits."""

    TEXT = "text"
    HASH = "hash"
    FORCE_N = "N"
    ANGLE_DEG = "deg"
    RADIUS_MM = "mm"


SETUP = (
    ("force", FactKind.FORCE_N, "force_n", "clamped_at"),
    ("jaw", FactKind.ANGLE_DEG, "jaw_1_deg", "jaw_1_at"),
    ("radius", FactKind.RADIUS_MM, "zero_radius_mm", "touch_off_at"),
)
"""Facts of the set-up: key and kind, then the key of the value in `setup` and that of its time, "" for none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFact:
    """A fact of a run; its value is None if it is not recorded.

    `at` is the time it was taken, "" if not recorded; `notes` are keys of sentences about it.
    """

    key: str
    kind: FactKind
    value: str | float | None
    at: str = ""
    notes: tuple[str, ...] = ()


def setup_facts(story: RunStory) -> tuple[RunFact, ...]:
    """Return how the part was clamped and aligned."""
    setup = story.setup
    return tuple(
        RunFact(key=key, kind=kind, value=_value(setup.get(name), kind), at=_text(setup.get(at)) or "")
        for key, kind, name, at in SETUP
    )


def origin_facts(story: RunStory) -> tuple[RunFact, ...]:
    """Return the versions and hashes by which a run can be found and repeated."""
    python = f"Python {story.python}" if story.python else None
    values = (
        ("run_id", FactKind.TEXT, story.row.run_id),
        ("software", FactKind.TEXT, _join_texts(story.software, python)),
        ("controller", FactKind.TEXT, _join_texts(story.controller, story.family)),
        ("job_hash", FactKind.HASH, story.job_sha256),
        ("machine_hash", FactKind.HASH, story.machine_sha256),
        ("program_hash", FactKind.HASH, program_sha256(story.program)),
    )
    facts = [RunFact(key=key, kind=kind, value=value) for key, kind, value in values]
    versioned = [event.data for event in story.events if event.kind == VERSIONED]
    return (*facts, *map(_commit, versioned[:1]))


def _commit(event: Mapping[str, Any]) -> RunFact:
    """Return the commit of job and machine, with notes on those that differ from it."""
    commit = _text(event.get("commit"))
    notes = [] if commit else ["records.no_commit"]
    notes += [f"records.{name}_differs" for name in ("job", "machine") if event.get(f"{name}_differs")]
    value = None if commit is None else commit[:COMMIT_DIGITS]
    return RunFact(key="commit", kind=FactKind.TEXT, value=value, notes=tuple(notes))


def program_sha256(program: str) -> str:
    """Return the SHA-256 of a program."""
    return hashlib.sha256(program.encode("utf-8", "surrogatepass")).hexdigest()


def _join_texts(*texts: str | None) -> str | None:
    return " · ".join(filter(None, texts)) or None


def _value(value: Any, kind: FactKind) -> str | float | None:
    return _text(value) if kind in (FactKind.TEXT, FactKind.HASH) else number_or_none(value)


def _text(value: Any) -> str | None:
    return value if isinstance(value, str) and value else None
