"""A particle depends on the sound before it, which a value does not have: no Korean sentence may need one."""

from __future__ import annotations

import re
from pathlib import Path

import console
from profiles.words.sentences import entries_in, words_of

HEDGED = re.compile(r"\([은는이가을를으]\)")
AFTER_A_VALUE = re.compile(r"\} ?(은|는|이|가|을|를|와|과|로|으로)(?![가-힣])")


def test_no_particle_hangs_on_a_value() -> None:
    (folder,) = console.__path__
    sentences = {**words_of("ko"), **entries_in(Path(folder) / "text" / "ko")}
    hanging = {k: s for k, s in sentences.items() if HEDGED.search(s) or AFTER_A_VALUE.search(s)}
    assert hanging == {}
