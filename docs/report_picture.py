"""Take the picture of a run report, from a real run, with the browser that is installed (chromium).

python -m docs.report_picture
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from html import escape
from pathlib import Path

from console.session.operator import VARIABLE

PICTURE = Path(__file__).with_name("pictures") / "report.png"
JOB = "lee-2001-experiment-1"
WIDTH, HEIGHT, SCALE = 700, 920, "0.7"
QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--hide-scrollbars",
)


def console(*words: str) -> None:
    """Run a command of the console; CalledProcessError where it fails."""
    environment = {**os.environ, VARIABLE: "operator"}
    command = [sys.executable, "-m", "console", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)


def beside_each_other(page: str) -> str:
    """Return a page that shows the report twice: from its head, and from what was measured."""
    size = f'width="{WIDTH}" height="{HEIGHT}" style="border: 1px solid #999; margin: 4px"'
    frames = "".join(f'<iframe {size} srcdoc="{escape(page)}"></iframe>' for _ in range(2))
    script = "onload = () => frames[1].document.getElementById('measured').scrollIntoView()"
    return f'<body style="margin: 0; display: flex; background: #ddd">{frames}<script>{script}</script>'


def main(arguments: Sequence[str]) -> None:
    """Cut a part on a realistic simulated lathe, report on it, and photograph the report."""
    browser = shutil.which("chromium")
    if browser is None:
        raise SystemExit("chromium is not installed")
    picture = Path(arguments[0]) if arguments else PICTURE
    with tempfile.TemporaryDirectory() as folder:
        data, report, both = (Path(folder) / name for name in ("data", "report.html", "both.html"))
        cut = ("--sim", "--yes", "--plant", "steady", "--strategy", "cam", "--learn", "2")
        console("run", JOB, *cut, "--data", str(data))
        console("report", "--data", str(data), "--output", str(report))
        both.write_text(beside_each_other(report.read_text(encoding="utf-8")), encoding="utf-8")
        size = f"--window-size={2 * WIDTH + 20},{HEIGHT + 10}"
        look = (f"--user-data-dir={folder}/browser", f"--force-device-scale-factor={SCALE}", size)
        shot = f"--screenshot={picture.resolve()}"
        subprocess.run([browser, *QUIET, *look, "--virtual-time-budget=3000", shot, both.as_uri()], check=True)
    print(f"written: {picture.name}")


if __name__ == "__main__":
    main(sys.argv[1:])
