"""Words on a part along its length: from what is kept, whatever state that is in."""

from __future__ import annotations

import pytest

from console.text.along_length import stretch_words
from console.text.catalogue import LiveCatalogue


def stretches(*errors_um: object) -> dict[str, object]:
    rows = [
        {"from_z_mm": 30.0 - 2.0 * n, "to_z_mm": 28.0 - 2.0 * n, "error_um": um} for n, um in enumerate(errors_um)
    ]
    return {"stretches": rows}


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en", "from the free end: 1.0 · 2.5 · – um; worst 2.5 um at Z 28.0 … 26.0 mm"),
        ("ko", "자유단부터: 1.0 · 2.5 · – um; 최대 2.5 um, Z 28.0 … 26.0 mm"),
    ],
)
def test_the_worst_stretch_is_named_with_its_z(language: str, words: str) -> None:
    assert stretch_words(stretches(1.0, 2.5, None), LiveCatalogue(language)) == words


@pytest.mark.parametrize(
    "kept",
    [{}, {"stretches": None}, {"stretches": ["2.5"]}, stretches(None, None), stretches("2.5", float("nan"))],
)
def test_of_a_cut_without_them_nothing_is_said(kept: dict[str, object]) -> None:
    assert stretch_words(kept, LiveCatalogue("en")) == ""
