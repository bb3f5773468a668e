"""A file is read in one sitting and a function at one glance."""

import ast
import statistics
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
TREES = (*PACKAGES, "tests")

LONGEST_FILE = 600
LONGEST_TEST_FILE = 500
LARGEST_MEDIAN = 150
LONGEST_FUNCTION = 40
LONGEST_TEST = 60
MOST_MODULES = 25
VAGUE_NAMES = ("utils", "util", "helpers", "helper", "manager", "managers", "misc", "common")


def python_files(*trees: str) -> list[Path]:
    return sorted(path for tree in trees for path in (ROOT / tree).rglob("*.py"))


def named(paths: list[Path]) -> list[str]:
    return [str(path.relative_to(ROOT)) for path in paths]


def line_count(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def statements(tree: ast.Module) -> Iterator[ast.AST]:
    """Every statement, without what is in its expressions: no function stands in one."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            inner = getattr(node, name, ())
            waiting += inner if isinstance(inner, list) else ()


def functions(path: Path) -> Iterator[tuple[str, int]]:
    """Every function with its length in lines, decorators and docstring apart."""
    for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0]
            documented = ast.get_docstring(node) is not None
            docstring = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
            yield node.name, (node.end_lineno or 0) - node.lineno + 1 - docstring


def test_the_trees_are_there() -> None:
    assert all(python_files(tree) for tree in TREES)


def test_no_file_is_too_long() -> None:
    long = [path for path in python_files(*PACKAGES) if line_count(path) > LONGEST_FILE]
    long += [path for path in python_files("tests") if line_count(path) > LONGEST_TEST_FILE]
    assert named(long) == []


def test_the_usual_file_is_short() -> None:
    lengths = [line_count(path) for path in python_files(*PACKAGES) if path.name != "__init__.py"]
    assert statistics.median(lengths) < LARGEST_MEDIAN


@pytest.mark.parametrize("tree", TREES)
def test_no_function_is_too_long(tree: str) -> None:
    limit = LONGEST_TEST if tree == "tests" else LONGEST_FUNCTION
    long = [
        f"{path.relative_to(ROOT)}: {name}, {length} lines"
        for path in python_files(tree)
        for name, length in functions(path)
        if length > limit
    ]
    assert long == []


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
