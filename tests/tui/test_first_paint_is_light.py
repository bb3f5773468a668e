"""What the first page needs is painted before anything heavy is loaded."""

from __future__ import annotations

import subprocess
import sys

HEAVY = ("numpy", "scipy", "control", "plotext", "textual_plotext", "serial", "sqlite3", "tomlkit")
FIRST_PAGE = "import console.__main__, console.tui.start, console.tui.pages.jobs"


def test_the_first_page_imports_nothing_heavy() -> None:
    show = f"{FIRST_PAGE}; import sys; print(*(name for name in {HEAVY!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, timeout=30)
    assert (done.stdout.strip(), done.stderr) == ("", "")
