"""What is used of Textual beyond its public interface is there; another major version of it is not taken."""

from __future__ import annotations

import ast
import inspect
import re
import tomllib
from importlib.metadata import version
from pathlib import Path

from textual._compositor import Compositor
from textual._xterm_parser import XTermParser
from textual.app import App
from textual.driver import Driver
from textual.drivers._writer_thread import WriterThread
from textual.drivers.linux_driver import LinuxDriver
from textual.screen import Screen
from textual_plotext import Plot

ROOT = Path(__file__).parents[2]
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
