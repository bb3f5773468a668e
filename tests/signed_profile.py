"""Bundled machine profiles as they are once somebody has signed for them at the machine."""

from __future__ import annotations

from pathlib import Path

from profiles.store import load_machine


def signed(text: str) -> str:
    """The text of a bundled profile, signed for the machine."""
    assert text.count('signed_for = "simulator"') == 1
    return text.replace('signed_for = "simulator"', 'signed_for = "machine"')


def signed_copy(name: str, folder: Path) -> Path:
    """Write the bundled machine of that name, signed for the machine, into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    path.write_text(signed(load_machine(name).path.read_text(encoding="utf-8")), encoding="utf-8")
    return path
