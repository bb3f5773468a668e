"""Nothing heavy is loaded before it is needed."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
HEAVY = ("numpy", "scipy", "control", "matplotlib", "textual", "rich", "plotext")

BUILD_THE_PARSER = "import console.__main__; from console.cli.commands import build; " + (
    "from console.text.catalogue import load; build(load('en'))"
)

HELP_OF_EVERY_COMMAND = """
import contextlib, io
from console.__main__ import main
from console.cli.commands import COMMANDS
with contextlib.redirect_stdout(io.StringIO()):
    assert {main([name, "--help"]) for name in COMMANDS} == {0}
"""


@pytest.mark.parametrize(
    ("code", "unwanted"),
    [
        pytest.param(BUILD_THE_PARSER, HEAVY, id="command line"),
        pytest.param(HELP_OF_EVERY_COMMAND, HEAVY, id="help of every command"),
        pytest.param("import profiles.axis.servo", ("scipy", "control", "matplotlib"), id="servo model"),
    ],
)
def test_importing_stays_light(code: str, unwanted: tuple[str, ...]) -> None:
    show = f"import sys\n{code}\nprint(*(name for name in {unwanted!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, cwd=ROOT, timeout=30)
    assert done.stderr == ""
    assert done.stdout.strip() == ""


def imports(tree: ast.AST) -> Iterator[tuple[str, ast.stmt]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module, node


def inside_functions(tree: ast.AST) -> set[ast.AST]:
    return {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for inner in ast.walk(node)
    }


def test_slow_libraries_are_imported_where_they_are_used() -> None:
    users: dict[str, set[str]] = {"control": set(), "scipy": set()}
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        if not any(f"import {library}" in source or f"from {library}" in source for library in users):
            continue
        tree = ast.parse(source)
        sheltered = inside_functions(tree)
        for module, statement in imports(tree):
            library = module.split(".")[0]
            if library in users:
                users[library].add(str(path.relative_to(ROOT)))
                assert statement in sheltered, f"{path.relative_to(ROOT)}:{statement.lineno}"
    assert users["control"] == {"profiles/axis/servo.py"}
    assert users["scipy"]
