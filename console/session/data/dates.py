"""Dates of what the console keeps: clocks are set wrong and set back, so a date is shown and orders nothing."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

TOLERANCE = timedelta(minutes=10)
"""By so much the clocks of two computers with one data folder may differ."""


def utc_now() -> str:
    """Return the date that something gets when it is kept, UTC after ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def is_ahead(date: str, now: str | None = None) -> bool:
    """Return whether a date after ISO 8601 is in the future: a clock was ahead then, or has been set back since.

    One without a zone is UTC; a text that is no date is not in the future.
    """
    now = now or utc_now()
    try:
        return _parsed(date) - _parsed(now) > TOLERANCE
    except OverflowError:  # at either end of what a calendar has
        return date > now
    except ValueError:
        return False


def _parsed(date: str) -> datetime:
    found = datetime.fromisoformat(date)
    return found.replace(tzinfo=UTC) if found.tzinfo is None else found.astimezone(UTC)
