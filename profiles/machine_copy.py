"""A machine profile as the beginning of another one: whoever copies it corrects it for the machine at hand."""

from __future__ import annotations

from pathlib import Path

from profiles.files import parse_toml, write_atomically
from profiles.machine import machine_from_table
from profiles.problem import Problem, ProfileError
from profiles.store import LoadedMachine, load_machine

UNSIGNED = "simulator only: sign again for a real machine"
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


def copy_machine(loaded: LoadedMachine, name: str, folder: Path) -> LoadedMachine:
    """Write a profile into `folder` under another name, comments and all, and return it.

    A signature is one for a machine and does not pass to another: the copy is signed for the simulator only. Its
    link is taken out: it would be that of the other machine. Raises `ProfileError`: `file.name_unfit`,
    `file.name_long`, `file.exists`, `file.not_writable`.
    """
    if problem := unfit_name(name):
        raise ProfileError(problem)
    path = folder / f"{name}.toml"
    content = _text_of_copy(loaded.text, name).encode("utf-8")
    machine_from_table(parse_toml(content, str(path)), where=str(path))
    write_atomically(path, content, overwrite=False, private=True)
    return load_machine(str(path))


def _text_of_copy(text: str, name: str) -> str:
    import tomlkit  # slow to import, and only saving needs it

    document = tomlkit.parse(text.removeprefix("\N{BOM}"))
    document["name"] = name
    document.pop("link", None)
    if "safety" in document:
        safety = document["safety"]
        assert isinstance(safety, dict)
        safety["signed_by"], safety["signed_for"] = UNSIGNED, "simulator"
    return tomlkit.dumps(document)
