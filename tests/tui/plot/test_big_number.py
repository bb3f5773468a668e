"""Large numbers: as drawn by hand, and in plain text where there is no room."""

from __future__ import annotations

import textwrap

from console.tui.lines import plain, width_of
from console.tui.plot.big_number import big_number

DRAWN = """\
        ██  ██  ██████      ██████
        ██  ██  ██  ██          ██
██████  ██████  ██  ██          ██
            ██  ██  ██          ██
            ██  ██████  ██      ██ mm
"""


def test_a_number_is_drawn_with_its_label_and_its_unit() -> None:
    drawn = plain(big_number("-40.7", "speed", "mm", 60))
    assert textwrap.dedent(drawn.replace("speed", "     ")) + "\n" == DRAWN
    assert drawn.splitlines()[2].startswith("speed ")


def test_a_number_without_room_or_form_is_plain_text() -> None:
    for number, width in (("1234.5678", 30), ("∞", 60)):
        (row,) = big_number(number, "spindle", "rpm", width)
        assert number in plain([row])
        assert width_of(row) == width
