"""docs/api.md is the page of who works in a notebook: each of its blocks runs, and prints what stands below it."""

import contextlib
import io
import re
from pathlib import Path

DOCUMENT = Path(__file__).parents[2] / "docs" / "api.md"
BLOCKS = re.compile(r"^```python\n(.*?)^```\n(?:\n```\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


def test_each_block_prints_what_stands_below_it() -> None:
    blocks = BLOCKS.findall(DOCUMENT.read_text(encoding="utf-8"))
    notebook: dict[str, object] = {}
    assert len(blocks) > 5
    for script, printed in blocks:
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(script, str(DOCUMENT), "exec"), notebook)
        assert said.getvalue() == printed, script
        assert set(re.findall(r"^(?:from|import) (\w+)", script, re.MULTILINE)) <= {"profiles", "numpy"}
