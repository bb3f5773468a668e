"""What the first page needs is painted before anything heavy is loaded, and before garbage is looked for."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from console.__main__ import main
from console.tui.keymap import PageName
from tests.tui.scenes import application, played, scene_of

HEAVY = (
    *(
        "numpy",
        "scipy",
        "control",
        "plotext",
        "textual_plotext",
        "serial",
        "sqlite3",
        "tomlkit",
        "secrets",
        "json",
    ),
    *("drivers.pmac", "profiles.rules", "console.session.station.commands"),
)
FIRST_PAGE = "import console.__main__, console.screens.start, console.tui.pages.jobs"


def test_the_first_page_imports_nothing_heavy() -> None:
    show = f"{FIRST_PAGE}; import sys; print(*(name for name in {HEAVY!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, timeout=30)
    assert (done.stdout.strip(), done.stderr) == ("", "")


async def test_garbage_is_collected_from_the_first_picture_on(tmp_path: Path) -> None:
    """A console that did not would grow over the shift."""
    scene = scene_of(PageName.JOBS)
    app, _ = application(scene, tmp_path)
    gc.disable()
    try:
        async with played(app, scene, (80, 24)):
            assert gc.isenabled()
    finally:
        gc.enable()
    assert app.fault is None


def test_garbage_is_collected_after_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0 and main(["jobs", "--help"]) == 0
    assert gc.isenabled()
