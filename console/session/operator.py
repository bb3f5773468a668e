"""Name of the operator, as the records have it."""

from __future__ import annotations

import os
import pwd


def operator_name() -> str:
    """Return the name of the operator: the login of the account that runs this console, else its number."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:  # an account that is in no directory, as in some containers
        return str(os.getuid())
