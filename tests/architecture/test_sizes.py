"""A file is read in one sitting. Functions are measured by their complexity, by ruff (C901)."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import pytest
from textual._compositor import Compositor
from textual._xterm_parser import XTermParser
from textual.app import App
from textual.driver import Driver
from textual.drivers._writer_thread import WriterThread
from textual.drivers.linux_driver import LinuxDriver
from textual.screen import Screen
from textual_plotext import Plot

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
TREES = (*PACKAGES, "tests")

LONGEST_FILE = 600
LONGEST_TEST_FILE = 500
MOST_MODULES = 25
SMALL = 80
VAGUE_NAMES = ("utils", "util", "helpers", "helper", "manager", "managers", "misc", "common")


def python_files(*trees: str) -> list[Path]:
    return sorted(path for tree in trees for path in (ROOT / tree).rglob("*.py"))


def named(paths: list[Path]) -> list[str]:
    return [str(path.relative_to(ROOT)) for path in paths]


def line_count(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def test_the_trees_are_there() -> None:
    assert all(python_files(tree) for tree in TREES)


def test_no_file_is_too_long() -> None:
    long = [path for path in python_files(*PACKAGES) if line_count(path) > LONGEST_FILE]
    long += [path for path in python_files("tests") if line_count(path) > LONGEST_TEST_FILE]
    assert named(long) == []


def test_no_folder_is_crowded() -> None:
    folders = Counter(path.parent for path in python_files(*PACKAGES) if path.name != "__init__.py")
    crowded = {str(folder.relative_to(ROOT)): count for folder, count in folders.items() if count > MOST_MODULES}
    assert crowded == {}


def test_no_module_hides_behind_a_vague_name() -> None:
    assert named([path for path in python_files(*TREES, "benchmarks") if path.stem in VAGUE_NAMES]) == []


def test_packages_import_nothing_by_themselves() -> None:
    importing = [
        path
        for path in python_files(*PACKAGES)
        if path.name == "__init__.py"
        and any(isinstance(n, ast.Import | ast.ImportFrom) for n in ast.walk(ast.parse(path.read_text("utf-8"))))
    ]
    assert named(importing) == []


def test_test_files_have_names_of_their_own() -> None:
    own = ("conftest.py", "__main__.py")  # names that pytest and Python look for
    names = [path.name for path in python_files("tests") if path.name not in own]
    assert sorted({name for name in names if names.count(name) > 1}) == []
    assert "__init__.py" not in names


def test_no_small_module_has_its_one_importer_beside_it() -> None:
    """It belongs into that one, unless that imports it only when it is called: for the first paint, say."""
    importers: dict[str, set[Path]] = {}
    at_once: set[tuple[str, Path]] = set()
    for path in python_files(*PACKAGES, "docs", "benchmarks"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                for name in (node.module, *(f"{node.module}.{each.name}" for each in node.names)):
                    importers.setdefault(name, set()).add(path)
                    if node in tree.body:
                        at_once.add((name, path))
    alone = []
    for path in python_files(*PACKAGES):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        found = importers.get(name, set())
        if len(found) == 1 and line_count(path) < SMALL:
            (importer,) = found
            if importer.parent == path.parent and (name, importer) in at_once:
                alone.append(path)
    assert named(alone) == []


# What is used of Textual beyond its public interface is there; another major version of it is not taken.


IMPORT = re.compile(r"^from (textual\._\w+) import (\w+)", re.MULTILINE)
SILENCED = re.compile(r"\.(_[a-z]\w*)\b[^\n]*# noqa: SLF001[^\n]*Textual")


def sources() -> dict[Path, str]:
    return {path: path.read_text(encoding="utf-8") for path in (ROOT / "console").rglob("*.py")}


def test_the_private_names_that_are_used_are_these() -> None:
    texts = sources().values()
    assert {found for text in texts for found in IMPORT.findall(text)} == {
        ("textual._keyboard_protocol", "FUNCTIONAL_KEYS"),
        ("textual._xterm_parser", "XTermParser"),
    }
    assert {found for text in texts for found in SILENCED.findall(text)} == {"_compositor"}


def of_self(folder: Path) -> set[str]:
    """The private names that classes read on themselves and nobody in the folder sets: those of a base class."""
    read: set[str] = set()
    made: set[str] = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
                (made if isinstance(node.ctx, ast.Store) else read).add(node.attr)
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                made.add(node.name)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                made.add(node.target.id)
    return {name for name in read - made if name.startswith("_") and not name.startswith("__")}


def test_what_is_read_of_a_base_class_is_there() -> None:
    assert of_self(ROOT / "console" / "tui") == {"_app", "_driver", "_limit_size", "_writer_thread"}
    assert "self._driver" in inspect.getsource(App)
    assert "self._writer_thread" in inspect.getsource(LinuxDriver) and "self._queue" in inspect.getsource(
        WriterThread
    )
    assert callable(Plot()._limit_size)  # type: ignore[attr-defined]
    assert "self._app" in inspect.getsource(Driver)  # of our driver, too, where it is set as well


def test_the_parser_of_the_terminal_has_what_is_overridden() -> None:
    """`console/tui/application/kitty_parser.py` takes event types out of a sequence before it is read."""
    overridden = inspect.signature(XTermParser._sequence_to_key_events)
    assert list(overridden.parameters) == ["self", "sequence", "alt"]
    assert overridden.parameters["alt"].default is False
    assert {"feed", "tick"} <= set(dir(XTermParser))


def test_the_driver_has_what_the_terminal_thread_uses() -> None:
    """`console/tui/driver.py` is a driver of Linux with a reading thread of its own."""
    from console.tui.driver import StopDriver

    assert issubclass(StopDriver, LinuxDriver)
    overridden = {name for name in vars(StopDriver) if hasattr(LinuxDriver, name) and not name.startswith("__")}
    assert overridden >= OVERRIDDEN, f"no longer a method of LinuxDriver: {OVERRIDDEN - overridden}"


OVERRIDDEN = {"process_message", "start_application_mode", "run_input_thread", "disable_input"}


def test_the_screen_has_the_strips_that_an_instructor_sees() -> None:
    assert "render_strips" in dir(Compositor)
    assert "_compositor" in inspect.getsource(Screen)


def test_no_other_major_version_of_textual_is_taken() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (bound,) = [each for each in project["dependencies"] if each.startswith("textual>=")]
    major = int(version("textual").split(".")[0])
    assert bound.endswith(f",<{major + 1}")


# Nothing heavy is loaded before it is needed.


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


# What the controller's numbers mean is known in few places: nobody above the drivers reads one by its name.


READERS = {"profiles/axis/servo_gains.py"}
"""The gains of the sampled loop, and the two limits of the tool, which a notebook has without any driver."""


def reads_a_variable(path: Path) -> bool:
    """Whether a file looks one of the controller's variables up, as in `variables["I116"]`."""
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)) if "variables" in text else ():
        if isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith("variables"):
            return True
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("variables.get"):
            return True
    return False


def test_no_number_of_the_controller_is_read_above_the_drivers() -> None:
    paths = [path for tree in ("profiles", "console") for path in sorted((ROOT / tree).rglob("*.py"))]
    assert {str(path.relative_to(ROOT)) for path in paths if reads_a_variable(path)} == READERS
