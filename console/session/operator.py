"""This account: its home folder, below which its own files are, its login name, and the operator of records."""

from __future__ import annotations

import os
import pwd
from collections.abc import Mapping
from functools import cache


def home_of(environment: Mapping[str, str]) -> str | None:
    """Return the absolute path of the home folder, from HOME or the system; None for an account without one."""
    home = environment.get("HOME", "")
    if os.path.isabs(home):
        return home
    try:
        return pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:
        return None


def account_name() -> str:
    """Return the login name of this account, its number where the system has no name for it.

    Not at start-up: the system may ask a server for it.
    """
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())


VARIABLE = "TRILOBE_OPERATOR"
"""Set from the configuration at the start of a command, unless it was set before."""


def operator_name() -> str:
    """Return the configured name of the operator, else the login name of this account."""
    return os.environ.get(VARIABLE) or _login(os.getuid())


@cache
def _login(uid: int) -> str:
    """Return the login name of an account, asked once: a cut must not wait for the server of the accounts."""
    return account_name()
