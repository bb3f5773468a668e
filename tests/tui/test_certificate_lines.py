"""The certificate of a part as key w shows it on Inspect, kept as a text in both languages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from console.text.catalogue import LiveCatalogue, load
from console.text.part_sentences import certificate_lines
from console.tui.lines import width_of
from console.tui.pages.learn_lines import certified_lines
from profiles.compensations.certificate import Certified, Standing
from tests.golden_text import compare, writing
from tests.tui.stage import LANGUAGES

FOLDER = Path(__file__).parent / "certificates"
WIDTH = 78

PART = tuple(
    Certified(
        order=order,
        gain=gain,
        factor=abs(1.0 - gain),
        bound=bound,
        bound_gain_1=bound,
        on_part_um=left_um,
        left_um=0.5 * left_um,
        standing=standing,
    )
    for order, gain, bound, left_um, standing in (
        (2, 1.0, 0.30, 1.86, Standing.ONE_PART),
        (3, 0.93, 0.37, 7.185, Standing.LEARNED),
        (4, 1.0, 0.45, 0.012, Standing.NOISE),
        (5, 0.5, 0.71, 0.4, Standing.VARIES),
        (6, 1.0, 0.6, 0.77, Standing.GREW),
        (13, 1.0, 1.42, 0.05, Standing.NO_PROMISE),
    )
)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_standing_is_shown_with_its_promise(language: str) -> None:
    learning = cast(Any, SimpleNamespace(taught=SimpleNamespace(step=SimpleNamespace(certificate=PART))))
    rows = certified_lines(learning, load(language), WIDTH)
    assert all(width_of(row) <= WIDTH for row in rows)
    shown = ["".join(text for text, _ in row) for row in rows]
    assert "7.185" not in "".join(shown) and any("14.37" in row for row in shown), "peak to peak"
    compare(shown, FOLDER / f"{language}.txt", write=writing())


def test_on_a_screen_in_inches_it_is_in_millionths_of_an_inch() -> None:
    """14.37 um p-p are 565.7 uin."""
    text = LiveCatalogue("en")
    text.measure("inch")
    learning = cast(Any, SimpleNamespace(taught=SimpleNamespace(step=SimpleNamespace(certificate=PART))))
    rows = ["".join(words for words, _ in row) for row in certified_lines(learning, text, WIDTH)]
    assert any("565.7" in row for row in rows) and "uin p-p" in "".join(rows)
    assert "um p-p" not in "".join(rows)


def rows_of(*certificate: Certified) -> list[list[str]]:
    return [row.split() for row in certificate_lines(certificate, load("en"))[2:]]


def test_what_is_on_the_part_is_shown_beside_the_error_of_its_tool() -> None:
    """An oval blank has bent the tool by 11.66 um p-p; 10.96 are on the part, though learning has left 0.74."""
    oval = replace(PART[1], order=2, on_part_um=5.48, left_um=0.37, tool_off_um=5.83)
    beyond = replace(PART[-1], on_part_um=None, left_um=None)
    shown, unseen = rows_of(oval, beyond)
    assert shown[:3] == ["2", "10.96", "11.66"]
    assert unseen[:3] == ["13", "1.42", "too"], "no height, and the bound that was judged"
    assert "tool error" not in certificate_lines(PART, load("en"))[1], "a part alone does not show it"


def test_an_order_that_the_tool_hardly_follows_is_not_called_too_uncertain() -> None:
    (row,) = rows_of(replace(PART[-1], bound=0.5, bound_gain_1=0.5))
    assert "uncertain" not in row and row[-2:] == ["hardly", "follows"]
