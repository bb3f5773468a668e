"""A particle depends on the sound before it, which a value does not have: no Korean sentence may need one."""

from __future__ import annotations

import re

from console.text.catalogue import words_of

HEDGED = re.compile(r"\([은는이가을를으]\)")
AFTER_A_VALUE = re.compile(r"\} ?(은|는|이|가|을|를|와|과|로|으로)(?![가-힣])")


def test_no_particle_hangs_on_a_value() -> None:
    hanging = {k: s for k, s in words_of("ko").items() if HEDGED.search(s) or AFTER_A_VALUE.search(s)}
    assert hanging == {}
