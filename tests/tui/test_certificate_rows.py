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
from profiles.compensations.certificate import CertifiedOrder, OrderStatus, certify_push
from tests.golden_text import compare, writing
from tests.tui.stage import LANGUAGES

FOLDER = Path(__file__).parent / "certificates"
WIDTH = 78

PART = tuple(
    CertifiedOrder(
        order=order,
        gain=gain,
        factor=abs(1.0 - gain),
        bound=bound,
        bound_gain_1=bound,
        on_part_um=left_um,
        left_um=0.5 * left_um,
        most_um=1.33 if standing is OrderStatus.LEARNED else None,
        standing=standing,
    )
    for order, gain, bound, left_um, standing in (
        (2, 1.0, 0.30, 1.86, OrderStatus.ONE_PART),
        (3, 0.93, 0.37, 7.185, OrderStatus.LEARNED),
        (4, 1.0, 0.45, 0.012, OrderStatus.NOISE),
        (5, 0.5, 0.71, 0.4, OrderStatus.VARIES),
        (6, 1.0, 0.6, 0.77, OrderStatus.GREW),
        (13, 1.0, 1.42, 0.05, OrderStatus.NO_PROMISE),
    )
)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_standing_is_shown_with_its_promise(language: str) -> None:
    path = SimpleNamespace(target=SimpleNamespace(lobes=3))
    step = SimpleNamespace(certificate=PART, next=SimpleNamespace(path=path))
    learning = cast(Any, SimpleNamespace(taught=SimpleNamespace(step=step)))
    rows = certified_lines(learning, load(language), WIDTH)
    assert all(width_of(row) <= WIDTH for row in rows)
    shown = ["".join(text for text, _ in row) for row in rows]
    assert "7.185" not in "".join(shown) and any("14.37" in row for row in shown), "peak to peak"
    compare(shown, FOLDER / f"{language}.txt", write=writing())


def test_on_a_screen_in_inches_it_is_in_millionths_of_an_inch() -> None:
    """14.37 um p-p are 565.7 uin."""
    (text := LiveCatalogue("en")).measure("inch")
    path = SimpleNamespace(target=SimpleNamespace(lobes=3))
    step = SimpleNamespace(certificate=PART, next=SimpleNamespace(path=path))
    learning = cast(Any, SimpleNamespace(taught=SimpleNamespace(step=step)))
    rows = ["".join(words for words, _ in row) for row in certified_lines(learning, text, WIDTH)]
    assert any("565.7" in row for row in rows) and "uin p-p" in "".join(rows)
    assert "um p-p" not in "".join(rows)


def rows_of(*certificate: CertifiedOrder) -> list[list[str]]:
    return [row.split() for row in certificate_lines(certificate, 3, load("en"))[2:]]


def test_what_is_on_the_part_is_shown_beside_the_error_of_its_tool() -> None:
    """An oval blank has bent the tool by 11.66 um p-p; 10.96 are on the part, though learning has left 0.74."""
    oval = replace(PART[1], order=2, on_part_um=5.48, left_um=0.37, tool_off_um=5.83)
    beyond = replace(PART[-1], on_part_um=None, left_um=None)
    shown, unseen = rows_of(oval, beyond)
    assert shown[:3] == ["2", "10.96", "11.66"]
    assert unseen == ["13", "too", "uncertain", "(gain", "1:", "1.42", ">", "0.95)"], (
        "no height, and what was judged"
    )
    assert "tool error" not in certificate_lines(PART, 3, load("en"))[1], "a part alone does not show it"


def test_along_the_cut_the_lobe_has_its_rows_when_they_are_noise_and_other_orders_have_none() -> None:
    along = replace(PART[1], axial=1, standing=OrderStatus.NOISE, on_part_um=0.1)
    (shown,) = rows_of(replace(along, order=2), replace(along, order=3), replace(along, order=0))
    assert shown[:4] == ["3", "slope", "Z", "0.20"]


def test_a_push_has_a_row_and_what_was_refused_is_not_called_learned() -> None:
    """14 um at the entry, none at the end of the cut."""
    both = OrderStatus.LEARNED, OrderStatus.REFUSED
    (learned,), (refused,) = (rows_of(*certify_push(14.0, each)) for each in both)
    assert learned[:5] == ["push", "at", "entry", "14.00", "1.00"] and learned[-1] == "learned"
    assert refused[:4] == learned[:4] and refused[4:] == ["not", "learned:", "refused"]
    assert certify_push(0.0) == ()


def test_an_order_that_the_tool_hardly_follows_is_not_called_too_uncertain() -> None:
    (row,) = rows_of(replace(PART[-1], bound=0.5, bound_gain_1=0.5))
    assert "uncertain" not in row and row[-2:] == ["hardly", "follows"]
