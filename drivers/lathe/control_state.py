"""Who a console is to the machine, for everybody who shows or asks it."""

from __future__ import annotations

from enum import StrEnum, auto

NOBODY = 0
"""The number of a console where there is none."""


class Standing(StrEnum):
    """What this console is to the machine."""

    OBSERVER = auto()
    OWNER = auto()
    OUSTED = auto()
    """It was the owner, and somebody else has written another number: whatever was armed or moves is not ours."""
    CHANGING = auto()
    """A claim, a take-over or a release is on its way: only its answer tells whose the machine is."""
