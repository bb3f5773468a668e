"""Dates of stored data: for display only, because clocks are set wrong and set back."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

TOLERANCE = timedelta(minutes=10)
"""Allowed clock difference of two computers that share a data folder."""


def utc_now() -> str:
    """Return the date for newly stored data, UTC after ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def is_ahead(date: str, now: str | None = None) -> bool:
    """Return whether an ISO 8601 date is in the future: a clock was ahead then, or has been set back since.

    A date without a zone is UTC; a text that is no date is not in the future.
    """
    now = now or utc_now()
    try:
        return _parsed(date) - _parsed(now) > TOLERANCE
    except OverflowError:  # at either end of the calendar's range
        return date > now
    except ValueError:
        return False


def _parsed(date: str) -> datetime:
    found = datetime.fromisoformat(date)
    return found.replace(tzinfo=UTC) if found.tzinfo is None else found.astimezone(UTC)
