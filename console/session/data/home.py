"""This account: its home folder, below which its own files are, and its login name."""

from __future__ import annotations

import os
import pwd
from collections.abc import Mapping


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
