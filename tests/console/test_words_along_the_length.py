"""Words on a part along its length: from what is kept, whatever state that is in."""

from __future__ import annotations

import pytest

from console.text.along_length import form_words, section_rows, stretch_words
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


FORM = {
    "sections": [
        {"z_mm": z, "RONt_um": um, "mean_um": 1.0 - um} for z, um in ((22.8, 5.125), (26.0, 1.25), (29.2, 2.5))
    ],
    "CYLt_um": 7.0,
    "taper_um": -0.75,
}


def test_the_worst_section_is_named_and_marked() -> None:
    text = LiveCatalogue("en")
    assert form_words(FORM, text) == (
        "CYLt 7.00 um (MZCY, 3 sections, Z 22.8 … 29.2 mm), worst at Z 22.8 mm: RONt 5.12 um; taper -0.8 um"
    )
    assert section_rows(FORM, text) == [
        ("Z, mm", "RONt, um", "mean, um", ""),
        ("29.2", "2.50", "-1.5", ""),
        ("26.0", "1.25", "-0.2", ""),
        ("22.8", "5.12", "-4.1", "◂ worst"),
    ]


def test_of_one_section_its_z_is_said_and_of_an_older_record_nothing() -> None:
    text = LiveCatalogue("en")
    assert form_words({"section_z_mm": 26.0}, text) == "section at Z 26.00 mm"
    older: tuple[dict[str, object], ...] = (
        {},
        {"sections": []},
        {"sections": 3.0},
        {**FORM, "sections": [{"z_mm": 1.0}]},
    )
    for kept in older:
        assert (form_words(kept, text), section_rows(kept, text)) == ("", [])
