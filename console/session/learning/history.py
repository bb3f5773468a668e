"""The versions that led to a learned compensation."""

from __future__ import annotations

from profiles.compensations.learned import LearnedCompensation


def history_of(
    version: LearnedCompensation | None, known: tuple[LearnedCompensation, ...]
) -> tuple[LearnedCompensation, ...]:
    """Return the versions that led to one, oldest first; it is the last."""
    by_number = {each.version: each for each in known}
    found: list[LearnedCompensation] = []
    while version is not None:
        found.insert(0, version)
        version = by_number.get(version.parent) if version.parent < version.version else None
    return tuple(found)
