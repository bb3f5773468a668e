"""Name of the operator, as the records have it."""

from __future__ import annotations

import os
from functools import cache

from console.session.data.home import account_name

VARIABLE = "TRILOBE_OPERATOR"
"""Set from the configuration at the start of a command, unless it was set before."""


def operator_name() -> str:
    """Return the configured name of the operator, else the login name of this account."""
    return os.environ.get(VARIABLE) or _login(os.getuid())


@cache
def _login(uid: int) -> str:
    """Return the login name of an account, asked once: a cut must not wait for the server of the accounts."""
    return account_name()
