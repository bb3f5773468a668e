"""The animated picture shows each frame when it should, draws what stays once, and ends where nothing moves."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest

from docs.animation import Frame, animated
from tests.terminal_screen import Emulation

TAG = "{http://www.w3.org/2000/svg}"
KEYFRAMES = re.compile(r"@keyframes (k\d+)\{((?:[\d.]+%\{visibility:\w+\})+)\}")
CHANGE = re.compile(r"([\d.]+)%\{visibility:(\w+)\}")


def frame(text: str, caption: str, shown_s: float) -> Frame:
    emulation = Emulation(12, 2)
    emulation.feed(text.encode())
    return Frame(tuple(tuple(row) for row in emulation.cells()), caption, shown_s)


FILM = (
    frame("stays\r\none", "first", 1.0),
    frame("stays\r\ntwo", "second", 2.0),
    frame("stays\r\none", "second", 1.0),
)


def texts_of(group: ElementTree.Element) -> set[str]:
    return {text.text or "" for text in group.iter(f"{TAG}text")}


def seen_at(picture: ElementTree.Element, percent: float) -> set[str]:
    """What a browser shows: the newest change of its rule decides about a group, or its being without one."""
    rules = dict(KEYFRAMES.findall(picture.findtext(f"{TAG}style", "")))
    seen: set[str] = set()
    for group in picture.findall(f"{TAG}g"):
        name, *still = group.get("class", "").split()
        changes = [how for at, how in CHANGE.findall(rules.get(name, "")) if float(at) <= percent]
        if changes[-1] == "visible" if changes else still == ["z"]:
            seen |= texts_of(group)
    return seen


@pytest.mark.parametrize(
    ("percent", "expected"),
    [
        (0.0, {"stays", "one", "first"}),
        (24.0, {"stays", "one", "first"}),
        (26.0, {"stays", "two", "second"}),
        (74.0, {"stays", "two", "second"}),
        (76.0, {"stays", "one", "second"}),
        (100.0, {"stays", "one", "second"}),
    ],
)
def test_each_frame_is_shown_for_its_time(percent: float, expected: set[str]) -> None:
    assert seen_at(ElementTree.fromstring(animated(FILM)), percent) == expected


def test_a_row_that_stays_or_comes_back_is_drawn_once() -> None:
    text = animated(FILM)
    assert [text.count(f">{row}<") for row in ("stays", "one", "two", "second")] == [1, 1, 1, 1]


def test_where_nothing_may_move_the_last_frame_is_shown() -> None:
    picture = ElementTree.fromstring(animated(FILM))
    still = [group for group in picture.findall(f"{TAG}g") if "z" in group.get("class", "").split()]
    assert set().union(*map(texts_of, still)) == {"stays", "one", "second"}
    assert "@media(prefers-reduced-motion:reduce){g[class],.bar{animation:none}}" in animated(FILM)
