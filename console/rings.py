"""Rings around the core: packages that the console works without. The core imports none; it finds them by name."""

from __future__ import annotations

from importlib.util import find_spec

SCHOOL, SITE = "console.school", "console.site"
RINGS = (SCHOOL, SITE)


def is_installed(module: str) -> bool:
    """Return whether the ring of a module is here; a module of the core always is."""
    ring = ".".join(module.split(".")[:2])
    return ring not in RINGS or find_spec(ring) is not None
