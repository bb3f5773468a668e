"""Reasons of stops by somebody at the keys; the controller and the console stop by themselves, too."""

from __future__ import annotations

KEYS = frozenset({"space", "escape", "f9", "f12", "page", "unbound", "change", "unreadable", "paste"})
"""Each before a space."""


def is_by_key(reason: str) -> bool:
    """Whether a stop for this reason was by somebody at the keys."""
    return reason.partition(" ")[0] in KEYS
