"""What a cut sends to the terminal ten times a second: little enough for a line over a slow network.

The bytes are those of the console itself on a real terminal; the cut is always the same one.
"""

from __future__ import annotations

import pytest

from benchmarks.run_page import a_frame, moments_of_a_cut
from console.session.station.state import StationState

pytestmark = [pytest.mark.system, pytest.mark.long]

FRAMES = 15


@pytest.fixture(scope="module")
def cut() -> list[StationState]:
    return moments_of_a_cut(FRAMES)


@pytest.mark.parametrize(("columns", "rows", "most_bytes"), [(80, 24, 3000), (160, 48, 8000)])
def test_a_frame_of_a_cut_stays_within_its_bytes(
    cut: list[StationState], columns: int, rows: int, most_bytes: int
) -> None:
    frame = a_frame("console", cut, columns, rows)
    # Values, progress and plot move in every frame: next to nothing would mean that nothing was shown.
    assert 300 < frame.sent_bytes < most_bytes


def test_a_page_on_which_nothing_changes_sends_nothing(cut: list[StationState]) -> None:
    assert a_frame("console", cut[:1] * FRAMES, 80, 24).sent_bytes == 0
