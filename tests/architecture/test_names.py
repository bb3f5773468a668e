"""Names: a class name stands once in the tree, and a participle alone names neither a function nor a class."""

import ast
import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("console", "drivers", "profiles")
REGULAR = re.compile(r"[A-Z]?[a-z]+(ed|en)")
IRREGULAR = frozenset(
    "begun bent bound built chosen done due fed felt found gone grown heard held kept known laid led left lost "
    "made met risen said seen sent shown stood taught told took understood withheld worn none nothing other "
    "others ours same after before beside between beyond".split()
)
# `speed` and the like are nouns or verbs; `Interrupted` is an exception, the last two are messages of Textual.
ALLOWED = frozenset("feed flatten listen need seed speed token interrupted scanned written".split())

Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def definitions() -> list[tuple[str, Definition]]:
    """Return the public classes, and the public functions outside of classes, each with its place."""
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return [
        (f"{path.relative_to(ROOT)}:{node.lineno}", node)
        for path in paths
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        and not node.name.startswith("_")
    ]


def test_a_class_name_stands_once() -> None:
    classes = [(node.name, place) for place, node in definitions() if isinstance(node, ast.ClassDef)]
    counts = Counter(name for name, _ in classes)
    assert len(classes) > 1000
    assert [each for each in classes if counts[each[0]] > 1] == []


def is_participle(name: str) -> bool:
    word = name.lower()
    return word not in ALLOWED and (word in IRREGULAR or REGULAR.fullmatch(name) is not None)


def test_no_function_and_no_class_is_named_by_a_participle_alone() -> None:
    assert is_participle("listed") and is_participle("Seen") and not is_participle("list_runs")
    assert [f"{place} {node.name}" for place, node in definitions() if is_participle(node.name)] == []
