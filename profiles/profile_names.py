"""Names under which profiles are saved: the names of their files without `.toml`."""

from __future__ import annotations

from profiles.problem import Problem

MOST_CHARACTERS = 60
_MOST_BYTES = 200


def unfit_name(name: str) -> Problem | None:
    """Return why nothing can be saved under this name: `file.name_unfit`, `file.name_long`."""
    beyond = not name.strip() or not name.isprintable() or "/" in name or "\\" in name
    if beyond or name.startswith((".", "-", "~")) or name.lower().endswith(".toml"):
        return Problem(code="file.name_unfit", value=name or '""')
    if len(name) > MOST_CHARACTERS or len(name.encode()) > _MOST_BYTES:
        return Problem(code="file.name_long", value=str(len(name)), limit=f"<= {MOST_CHARACTERS}")
    return None
