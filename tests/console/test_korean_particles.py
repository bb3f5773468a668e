"""A particle depends on the sound before it, which a value does not have: no Korean sentence may need one."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import console

HEDGED = re.compile(r"\([은는이가을를으]\)")
AFTER_A_VALUE = re.compile(r"\} ?(은|는|이|가|을|를|와|과|로|으로)(?![가-힣])")


def test_no_particle_hangs_on_a_value() -> None:
    (folder,) = console.__path__
    files = sorted((Path(folder) / "text" / "ko").glob("*.toml"))
    assert files
    sentences = {key: s for file in files for key, s in tomllib.loads(file.read_text(encoding="utf-8")).items()}
    hanging = {k: s for k, s in sentences.items() if HEDGED.search(s) or AFTER_A_VALUE.search(s)}
    assert hanging == {}
