"""A file is read in one sitting. Functions are measured by their complexity, by ruff (C901)."""

import ast
import statistics
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
TREES = (*PACKAGES, "tests")

LONGEST_FILE = 600
LONGEST_TEST_FILE = 500
LARGEST_MEDIAN = 150
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


def test_the_usual_file_is_short() -> None:
    lengths = [line_count(path) for path in python_files(*PACKAGES) if path.name != "__init__.py"]
    assert statistics.median(lengths) < LARGEST_MEDIAN


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
