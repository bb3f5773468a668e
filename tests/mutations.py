"""Rules that are broken on purpose, one at a time, to see that a test notices each.

`python -m tests.mutations [WORD ...]` breaks those whose rule has one of the words in it, or all, in a copy of the
checkout, and runs the tests that stand beside them. `GOLDENS=write pytest tests/architecture/test_mutations.py`
writes tests/mutations.md anew.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.broken_rules import GROUPS, Mutation

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "tests" / "mutations.md"
COPIED = ("console", "drivers", "profiles", "tests", "docs", "benchmarks")
TIMEOUT_S = 600.0
PASSED, FAILED = 0, 1
"""What pytest says of its tests by its exit code; anything else is no verdict."""

_HEAD = """# Rules that are broken on purpose

Each of these rules is broken, one at a time, in a copy of the checkout, and the tests beside it must notice:

```
.venv/bin/python -m tests.mutations
```

A test of every run checks that what is broken is still there to be broken.
"""


def page() -> str:
    """Return tests/mutations.md."""
    lines = [_HEAD]
    for group, mutations in GROUPS.items():
        lines += [f"\n## {group}\n\n| rule | broken in | noticed by |\n|---|---|---|\n"]
        lines += [f"| {each.rule} | `{each.file}` | `{each.test}` |\n" for each in mutations]
    return "".join(lines)


def notices(mutation: Mutation, checkout: Path) -> bool:
    """Whether the tests beside a rule fail where it is broken. `checkout` is a copy; it is put right again.

    Raises RuntimeError: they say nothing, because they did not run.
    """
    path = checkout / mutation.file
    whole = path.read_text(encoding="utf-8")
    path.write_text(whole.replace(mutation.old, mutation.new), encoding="utf-8")
    try:
        return _verdict(checkout, mutation.test) == FAILED
    finally:
        path.write_text(whole, encoding="utf-8")


def _verdict(checkout: Path, *tests: str) -> int:
    words = ("-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", *tests)
    # The sources of the copy come before those that are installed. Bytecode goes by the second of a change.
    environment = {**os.environ, "PYTHONPATH": str(checkout), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, *words], cwd=checkout, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S
    )
    if done.returncode not in (PASSED, FAILED):
        raise RuntimeError(f"{' '.join(tests)}: {done.stdout}{done.stderr}")
    return done.returncode


def _copy(checkout: Path) -> None:
    for name in COPIED:
        shutil.copytree(ROOT / name, checkout / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, checkout / name)


def main(words: Sequence[str]) -> int:
    """Break the rules; return how many are not noticed."""
    chosen = [
        each
        for mutations in GROUPS.values()
        for each in mutations
        if not words or any(word in each.rule for word in words)
    ]
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        checkout = Path(folder)
        _copy(checkout)
        if _verdict(checkout, *dict.fromkeys(each.test for each in chosen)) != PASSED:
            raise SystemExit("a test fails before anything is broken")
        for each in chosen:
            noticed = notices(each, checkout)
            missed += not noticed
            print(f"{'noticed' if noticed else 'MISSED '}  {each.rule}", flush=True)
    return missed


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
