"""Name of the operator, as the records have it."""

from __future__ import annotations

import os
import pwd
from functools import cache

_named: list[str] = []


def name_operator(name: str | None) -> None:
    """Set the name of whoever works with this console, as the configuration has it; None leaves the login."""
    _named[:] = [] if name is None else [name]


def operator_name() -> str:
    """Return the name of the operator: as configured, else the login of the account, else its number."""
    return _named[0] if _named else _login(os.getuid())


@cache
def _login(uid: int) -> str:
    # Once: the directory of accounts may be on another computer, which may not answer while a cut runs.
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:  # an account that is in no directory, as in some containers
        return str(uid)
