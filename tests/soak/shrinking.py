"""Shorten a script that fails to one of which no event can be left out (greedy delta debugging)."""

from __future__ import annotations

from collections.abc import Callable

from tests.soak.script import Script


def shrunk(script: Script, fails: Callable[[Script], bool]) -> Script:
    """Return a part of the script, in its order, that still fails, and no longer does without any of its events.

    `fails` must hold for the script as it is. Whole pieces are left out first, then ever shorter ones.
    """
    size = max(1, len(script) // 2)
    while True:
        start, shorter = 0, False
        while start < len(script):
            part = script[:start] + script[start + size :]
            if part != script and fails(part):
                script, shorter = part, True
            else:
                start += size
        if size > 1:
            size //= 2
        elif not shorter:
            return script
