"""A strategy is one descriptor: nobody else decides by its name, and everything that is said of one is there."""

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.cutting.strategy import INVERTING, Strategy

ROOT = Path(__file__).parents[2]
REGISTERED = ROOT / "drivers" / "cutting" / "strategy.py"
NAMES = {each.value for each in Strategy}


def is_named(node: ast.AST, beside: str) -> bool:
    """Whether a node is a strategy by its name; a bare word is one beside something that is called a strategy."""
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(is_named(each, beside) for each in node.elts)
    if isinstance(node, ast.Attribute):
        return (
            isinstance(node.value, ast.Name) and node.value.id == "Strategy" and node.attr in Strategy.__members__
        )
    return isinstance(node, ast.Constant) and node.value in NAMES and "strategy" in beside.lower()


def decisions(source: str) -> Iterator[int]:
    """Yield the lines that decide by the name of a strategy: comparisons, cases, tables and collections."""
    if "strategy" not in source.lower():
        return
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare):
            operands = [node.left, *node.comparators]
            if any(is_named(each, ast.unparse(node)) for each in operands):
                yield node.lineno
        elif isinstance(node, ast.Match):
            values = [
                each.value for case in node.cases for each in ast.walk(case) if isinstance(each, ast.MatchValue)
            ]
            if any(is_named(each, ast.unparse(node.subject)) for each in values):
                yield node.lineno
        elif isinstance(node, ast.Dict):
            if any(key is not None and is_named(key, "") for key in node.keys):
                yield node.lineno
        elif isinstance(node, ast.Tuple | ast.List | ast.Set) and is_named(node, ""):
            yield node.lineno


def test_nobody_but_its_descriptor_decides_by_the_name_of_a_strategy() -> None:
    paths = sorted(
        path for tree in ("console", "drivers", "profiles", "docs") for path in (ROOT / tree).rglob("*.py")
    )
    found = [
        f"{path.relative_to(ROOT)}:{line}"
        for path in paths
        if path != REGISTERED
        for line in decisions(path.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize(
    "source",
    [
        "plan.strategy is Strategy.CAM",
        "plan.strategy in (Strategy.CAM, Strategy.PVT)",
        "options.strategy != 'paper'",
        "made = {Strategy.NONE: plain}",
        "FOLLOWING = (Strategy.PVT, Strategy.CAM)",
        "match part.strategy:\n    case 'cam' | 'pvt':\n        pass",
        "match part.path:\n    case Strategy.CAM:\n        pass",
    ],
)
def test_a_decision_by_name_is_seen(source: str) -> None:
    assert list(decisions(source))


@pytest.mark.parametrize(
    "source", ["plan_cut(job, machine, Strategy.CAM)", "version == 'none'", "strategy is chosen"]
)
def test_a_choice_is_no_decision(source: str) -> None:
    assert not list(decisions(source))


@pytest.mark.parametrize("language", ["en", "ko"])
@pytest.mark.parametrize("strategy", Strategy)
def test_every_strategy_has_words(strategy: Strategy, language: str) -> None:
    path = ROOT / "console" / "text" / language / "strategies.toml"
    said = {key.removeprefix(f"strategy.{strategy}.") for key in tomllib.loads(path.read_text(encoding="utf-8"))}
    assert {"help", "how", "named"} <= said
    assert strategy not in INVERTING or ("path" in said and {"measured", "composed"} & said)


@pytest.mark.parametrize("strategy", Strategy)
def test_every_strategy_is_described(strategy: Strategy) -> None:
    assert f"\n| `{strategy}` | " in (ROOT / "docs" / "strategies.md").read_text(encoding="utf-8")
