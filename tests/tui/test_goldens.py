"""What the whole screen looks like: every page at three sizes in both languages, compared with a kept text.

GOLDENS=write pytest tests/tui/test_goldens.py

writes the texts anew (see `tests.golden_text`).
"""

from __future__ import annotations

import asyncio
import re
import string
import tempfile
import tomllib
from functools import cache
from pathlib import Path

import pytest
from rich.cells import cell_len

from console.text.catalogue import load
from console.tui.keymap import DIGITS, NUMBERED, PageName
from tests.golden_text import compare, writing
from tests.tui.scenes import application, fill, fixed_world, played, rows_of, scene_of
from tests.tui.stage import LANGUAGES, SIZES

FOLDER = Path(__file__).with_name("goldens")
TEXTS = Path(__file__).parents[2] / "console" / "text"
LONG_LETTERS = 12
WORD_DOT_WORD = re.compile(r"[a-z_]+(?:\.[a-z0-9_]+)+")

Size = tuple[int, int]
PICTURES = [(page, size, language) for page in PageName for size in SIZES for language in LANGUAGES]
BETWEEN = SIZES[1]
"""What is whole at the smallest size and at the largest is seldom wrong here: these pictures are `long`.

So are those in the second language at the largest size: where both languages fit in 80 columns, what fits there in
one fits in the other.
"""


def is_long(size: Size, language: str) -> bool:
    return size == BETWEEN or (size, language) == (SIZES[-1], LANGUAGES[-1])


all_pictures = pytest.mark.parametrize(
    ("page", "size", "language"),
    [
        pytest.param(page, size, language, id=f"{page}-{size[0]}x{size[1]}-{language}", marks=marks)
        for page, size, language in PICTURES
        for marks in ((pytest.mark.long,) if is_long(size, language) else (),)
    ],
)


def picture(page: PageName, size: Size, language: str) -> tuple[str, ...]:
    """The rows of the terminal, with their blanks."""
    scene = scene_of(page)

    async def play(data: Path) -> list[str]:
        app, _ = application(scene, data, language=language)
        async with played(app, scene, size):
            return rows_of(app)

    with fixed_world(), tempfile.TemporaryDirectory() as folder:
        fill(Path(folder))
        return tuple(asyncio.run(play(Path(folder))))


def golden_of(page: PageName, size: Size, language: str) -> Path:
    return FOLDER / f"{page}-{size[0]}x{size[1]}-{language}.txt"


@cache
def entries(language: str) -> dict[str, str]:
    found: dict[str, str] = {}
    for path in sorted((TEXTS / language).glob("*.toml")):
        found |= tomllib.loads(path.read_text(encoding="utf-8"))
    return found


def bare_keys(text: str) -> list[str]:
    """Keys of the catalogues that stand in a text instead of their words."""
    tables = {key.partition(".")[0] for language in LANGUAGES for key in entries(language) if "." in key}
    return [word for word in WORD_DOT_WORD.findall(text) if word.partition(".")[0] in tables]


@cache
def english_beginnings() -> frozenset[str]:
    """How the longer English sentences begin that are said otherwise in Korean; the rest may be a row below."""
    found = set()
    for key, english in entries("en").items():
        for piece, *_ in string.Formatter().parse(english):
            words = piece.strip()
            head = words[: LONG_LETTERS + 1]
            if sum(letter.isalpha() for letter in words) > LONG_LETTERS and head not in entries("ko").get(key, ""):
                found.add(head)
    return frozenset(found)


def english_in(text: str) -> list[str]:
    return sorted(head for head in english_beginnings() if head in text)


@all_pictures
def test_every_screen_is_whole_and_looks_as_it_did(page: PageName, size: Size, language: str) -> None:
    """One test: a screen takes some time to paint, and tests of their own would each paint it in their worker."""
    rows = picture(page, size, language)
    assert [cell_len(row) for row in rows] == [size[0]] * size[1]
    the_six_rows_of_the_frame_are_in_their_places(rows, language)
    text = "\n".join(rows)
    assert bare_keys(text) == []
    if language == "ko":
        assert english_in(text) == []
    elif size == SIZES[-1]:
        assert english_in(text) != [], "an English sentence on a Korean screen would not be found"
    compare(rows, golden_of(page, size, language), write=writing())


def the_six_rows_of_the_frame_are_in_their_places(rows: tuple[str, ...], language: str) -> None:
    text = load(language)
    state, alarm, *_, following, stop, keys = rows
    pages = next(row for row in rows if row.lstrip().startswith("1"))  # below an alarm of several lines
    assert state.startswith(" SIM ")
    assert state.endswith(" 08:52 ")
    assert alarm.startswith((" · ", " – ", " !!! "))
    close = pages.replace(" ", "")
    assert [
        name for name in NUMBERED if f"{DIGITS[name]}{text(f'page.{name}')}".replace(" ", "") not in close
    ] == []
    assert " 0" in pages
    assert following.startswith(" ▶ ")
    assert stop.startswith(f" {text('frame.stop')} ")
    assert "SPACE" in stop
    assert keys.rstrip().endswith(f"? {text('key.help')}")


def test_a_bare_key_would_be_found() -> None:
    assert bare_keys("drive align_page.drive and R 26.0000 mm, LSC of setup.no_such_word") == [
        "align_page.drive",
        "setup.no_such_word",
    ]


def test_there_is_no_golden_without_its_screen() -> None:
    target = {golden_of(*each).name for each in PICTURES}
    assert {path.name for path in FOLDER.iterdir()} == target


def test_a_difference_is_shown_and_writing_does_not_pass(tmp_path: Path) -> None:
    golden = tmp_path / "run-80x24-en.txt"
    golden.write_text("same\nbefore\n", encoding="utf-8")
    rows = ("same  ", "after ")
    with pytest.raises(pytest.fail.Exception, match=r"(?s)-before.*\+after"):
        compare(rows, golden, write=False)
    assert golden.read_text(encoding="utf-8") == "same\nbefore\n"
    with pytest.raises(pytest.fail.Exception, match="was written"):
        compare(rows, golden, write=True)
    compare(rows, golden, write=False)
