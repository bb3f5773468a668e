"""The pictures of the documentation can be shown anywhere: they are there, well formed and need nothing else."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from docs.animation import Frame, animated
from docs.pictures import CELL_HEIGHT, CELL_WIDTH, svg
from tests.terminal_screen import Emulation

ROOT = Path(__file__).parents[2]
PICTURE = re.compile(r"docs/pictures/[\w.-]+")
ADDRESS = re.compile(r"\w+://[^\s\"'<>)]*|\bhref\b|@import|url\(|\bdata:")
NAMESPACE = "http://www.w3.org/2000/svg"
TAG = f"{{{NAMESPACE}}}"


def named_pictures() -> list[str]:
    return sorted(set(PICTURE.findall((ROOT / "README.md").read_text(encoding="utf-8"))))


def faults(text: str) -> list[str]:
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        return [str(error)]
    wrong = [] if root.tag == f"{TAG}svg" else [f"not a picture but {root.tag}"]
    return wrong + [address for address in ADDRESS.findall(text) if address != NAMESPACE]


def picture_of(text: str) -> ElementTree.Element:
    emulation = Emulation(20, 3)
    emulation.feed(text.encode())
    drawn = svg(emulation.cells())
    assert faults(drawn) == []
    return ElementTree.fromstring(drawn)


def written(picture: ElementTree.Element) -> list[tuple[float, float, str, float]]:
    """Column, row, text and width in cells of everything that is written."""
    return [
        (
            float(text.get("x", "")) / CELL_WIDTH,
            float(text.get("y", "")) // CELL_HEIGHT,
            text.text or "",
            float(text.get("textLength", "")) / CELL_WIDTH,
        )
        for text in picture.iter(f"{TAG}text")
    ]


def paths(picture: ElementTree.Element, attribute: str, colour: str) -> list[str]:
    return [path.get("d", "") for path in picture.iter(f"{TAG}path") if path.get(attribute) == colour]


def test_each_picture_is_there_and_needs_nothing_else() -> None:
    kept = (f"docs/pictures/{path.name}" for path in (ROOT / "docs" / "pictures").glob("*.svg"))
    found = {
        name: (ROOT / name).is_file() and faults((ROOT / name).read_text("utf-8"))
        for name in {*kept, *named_pictures()}
    }
    assert {name: wrong for name, wrong in found.items() if wrong != []} == {}


@pytest.mark.parametrize(
    "spoilt",
    [
        f'<svg xmlns="{NAMESPACE}"><text></svg>',
        f'<svg xmlns="{NAMESPACE}"><style>@font-face {{ src: url(f.woff) }}</style></svg>',
        f'<svg xmlns="{NAMESPACE}"><image href="other.png"/></svg>',
        f'<svg xmlns="{NAMESPACE}"><text>https://example.org</text></svg>',
        "<html/>",
    ],
)
def test_a_picture_that_needs_something_else_would_be_found(spoilt: str) -> None:
    assert faults(spoilt) != []


def test_text_stands_in_its_cells_whatever_its_width() -> None:
    picture = picture_of("SIM  a <b>&\r\n 차축 정지 x \u25b8")
    assert written(picture) == [
        (0, 0, "SIM", 3),
        (5, 0, "a <b>&", 6),
        (1, 1, "차축", 4),
        (6, 1, "정지", 4),
        (11, 1, "x", 1),
        (13, 1, "\u25b8", 1),
    ]


def test_styles_and_colours_are_those_of_the_screen() -> None:
    picture = picture_of("\x1b[1;38;2;255;0;0mred\x1b[0;7;38;2;1;2;3m on \r\n on ")
    groups = {group[0].text: group for group in picture.iter(f"{TAG}g")}
    assert groups["red"].get("fill") == "#ff0000"
    assert groups["red"].get("font-weight") == "bold"
    assert groups["on"].get("font-weight") is None
    assert groups["on"].get("fill") != "#010203"
    assert len(groups["on"]) == 2
    assert paths(picture, "fill", "#010203") == ["M0 16H32V32H0zM24 0H56V16H24z"]


def test_like_backgrounds_in_rows_one_below_the_other_are_one_rectangle() -> None:
    picture = picture_of("\x1b[48;2;1;2;3mabcd\r\nefgh")
    assert paths(picture, "fill", "#010203") == ["M0 0H32V32H0z"]


def test_braille_dots_stand_on_one_grid_across_cells() -> None:
    # By the numbering of the dots: 1 2 3 7 go down the left, 4 5 6 8 down the right.
    dot_1, dot_8 = "\u2801", "\u2880"
    (path,) = paths(picture_of(f"\x1b[38;2;1;2;3m{dot_1}{dot_8}\r\n{dot_1}"), "stroke", "#010203")
    centres = [(int(x) + 1, int(y)) for x, y in re.findall(r"M(\d+) (\d+)h2", path)]
    assert centres == [(2, 2), (8 + 6, 14), (2, 16 + 2)]


def test_frames_meet_and_bars_fill_their_eighths() -> None:
    framed = picture_of("\x1b[38;2;1;2;3m┌─\r\n│")
    (lines,) = paths(framed, "stroke", "#010203")
    assert set(re.findall(r"\d+ \d+", lines)) == {"8 8", "4 8", "4 16", "16 8", "4 32"}
    assert written(framed) == []
    assert paths(picture_of("\x1b[38;2;1;2;3m▌▂█"), "fill", "#010203") == [
        "M0 0H4V16H0zM8 12H16V16H8zM16 0H24V16H16z"
    ]


# The animated picture shows each frame when it should, draws what stays once, and ends where nothing moves.


ANIMATION_TAG = "{http://www.w3.org/2000/svg}"
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
    return {text.text or "" for text in group.iter(f"{ANIMATION_TAG}text")}


def seen_at(picture: ElementTree.Element, percent: float) -> set[str]:
    """What a browser shows: the newest change of its rule decides about a group, or its being without one."""
    rules = dict(KEYFRAMES.findall(picture.findtext(f"{ANIMATION_TAG}style", "")))
    seen: set[str] = set()
    for group in picture.findall(f"{ANIMATION_TAG}g"):
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
    still = [group for group in picture.findall(f"{ANIMATION_TAG}g") if "z" in group.get("class", "").split()]
    assert set().union(*map(texts_of, still)) == {"stays", "one", "second"}
    assert "@media(prefers-reduced-motion:reduce){g[class],.bar{animation:none}}" in animated(FILM)
