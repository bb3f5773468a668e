"""The lock file pins everything by hash and names no server."""

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PINNED = re.compile(r"([a-z0-9][a-z0-9._-]*)==[^ ;\\]+")
HASH = re.compile(r"--hash=sha256:[0-9a-f]{64}")


def lock() -> str:
    return (ROOT / "requirements.lock").read_text(encoding="utf-8")


def requirements() -> dict[str, list[str]]:
    """Each pinned distribution with its hashes."""
    found: dict[str, list[str]] = {}
    name = ""
    for line in lock().splitlines():
        if line.startswith((" ", "#")):
            found.setdefault(name, []).extend(HASH.findall(line))
        else:
            match = PINNED.match(line)
            assert match, line
            name = match[1]
    return found


def normal(requirement: str) -> str:
    return re.split(r"[<>=!~;\[ ]", requirement)[0].lower().replace("_", "-").replace(".", "-")


def test_no_address_and_no_option_in_the_lock() -> None:
    text = lock()
    assert "://" not in text
    assert "--index" not in text and "--find-links" not in text and "--extra-index" not in text
    assert not re.search(r"(^|\s)/\w", text), "a path of some machine"


def test_every_requirement_has_a_hash() -> None:
    assert len(requirements()) > 20
    assert [name for name, hashes in requirements().items() if not hashes] == []


def test_every_direct_dependency_is_locked() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [item for items in project["optional-dependencies"].values() for item in items]
    target = {normal(item) for item in (*project["dependencies"], *extras)}
    assert sorted(target - set(requirements())) == []


def test_the_compiled_build_brings_the_packages_whose_types_it_reads() -> None:
    """mypyc checks the types of each module that a compiled one imports, in an environment of its own."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    hook = tool["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]
    untyped = {name.split(".")[0] for each in tool["mypy"]["overrides"] for name in each["module"]}
    found: set[str] = set()
    seen, asked = set(), [ROOT / each for each in hook["modules"]]
    while asked:
        path = asked.pop()
        if path in seen:
            continue
        seen.add(path)
        for name in imported(path):
            place = ROOT.joinpath(*name.split("."))
            asked += [each for each in (place.with_suffix(".py"), place / "__init__.py") if each.is_file()]
            found.add(name.split(".")[0])
    foreign = found - sys.stdlib_module_names - {"console", "drivers", "profiles"} - untyped
    assert foreign, "the trajectories are computed with numpy"
    assert sorted(foreign - {normal(each) for each in hook["dependencies"]}) == []


def imported(path: Path) -> set[str]:
    """Each module that a file imports, and each name of it, which may be a module."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    return names
