"""What the controller's numbers mean is known in few places: nobody above the drivers reads one by its name."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
READERS = {"profiles/axis/servo_gains.py"}
"""The gains of the sampled loop, and the two limits of the tool, which a notebook has without any driver."""


def reads_a_variable(path: Path) -> bool:
    """Whether a file looks one of the controller's variables up, as in `variables["I116"]`."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Subscript) and ast.unparse(node.value).endswith("variables"):
            return True
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("variables.get"):
            return True
    return False


def test_no_number_of_the_controller_is_read_above_the_drivers() -> None:
    paths = [path for tree in ("profiles", "console") for path in sorted((ROOT / tree).rglob("*.py"))]
    assert {str(path.relative_to(ROOT)) for path in paths if reads_a_variable(path)} == READERS
