"""The dates that a record gives its runs and events, as a test wants them."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from console.session.data import records
from console.session.data.kept_files import RunDates


def set_dates(patch: pytest.MonkeyPatch, now: Callable[[], str]) -> None:
    """Have each date of a run, and of what is added to it after its end, come from `now`."""
    patch.setattr(RunDates, "now", lambda self: now())
    patch.setattr(records, "utc_now", now)
