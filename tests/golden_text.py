"""Texts that are kept and compared: what the program shows or says, as a person may read it.

`GOLDENS=write` writes them anew. A test that has changed one fails and says so: look at the difference, then run
again without it. Thus a run that writes is never green by itself, wherever the variable was forgotten.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from pathlib import Path

import pytest


def writing() -> bool:
    """Whether the goldens are to be written instead of compared."""
    return os.environ.get("GOLDENS") == "write"


def compare(rows: Sequence[str], golden: Path, *, write: bool) -> None:
    """Fail with a difference that can be read, after writing the golden where that is asked for."""
    now = [row.rstrip() for row in rows]
    kept = golden.read_text(encoding="utf-8").splitlines() if golden.is_file() else []
    if now == kept:
        return
    if write:
        golden.write_text("\n".join(now) + "\n", encoding="utf-8")
        pytest.fail(f"{golden.name} was written: look at it, then run without GOLDENS", pytrace=False)
    difference = difflib.unified_diff(kept, now, f"{golden.name}, kept", f"{golden.name}, now", lineterm="", n=1)
    pytest.fail("\n".join(["it is otherwise than it was", *difference]), pytrace=False)
