"""SAVE: how long the controller is deaf over it, and how long a host has to wait for its answer.

The settings are copied into a flash memory. The manuals say several seconds, up to 10; public clients wait 3 s for
other lines and twice as long for this one, so that it ends within 6.
"""

from __future__ import annotations

import re
from functools import lru_cache

SAVE_S = 4.0  # what the simulated controller takes
LONGEST_SAVE_S = 10.0  # what a controller may take
SAVE_TIMEOUT_S = 2.0 * LONGEST_SAVE_S  # of a host

_QUOTED = re.compile(r'"[^"]*"?|;.*')
_SAVE = re.compile(r"S\s*A\s*V\s*E(?![A-Z])")


@lru_cache(maxsize=512)
def saves(line: str) -> bool:
    """Return whether a line has the command SAVE."""
    return "V" in line.upper() and _SAVE.search(_QUOTED.sub("", line.upper())) is not None
