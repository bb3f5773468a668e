"""A learned path that is no correction of its cut is refused, whoever wrote its file."""

import cmath
from dataclasses import replace

import pytest

from profiles.compensation import CutPath, LobedPath, Wave, invert
from profiles.path_bounds import path_problems

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, crest_deg=90.0)
LAG = cmath.rect(0.885, -0.9)
PATH = CutPath(wanted=WANTED, command=invert(WANTED, LAG))


def codes(path: CutPath) -> list[str]:
    return [problem.code for problem in path_problems(path, WANTED, lambda _: LAG)]


def test_what_learning_does_is_let_through() -> None:
    """As on the realistic lathe: friction asks for a fifth more, the cut for 25 um of mean, overtones for one."""
    nine = Wave(lobes=9, amplitude_um=0.9, crest_deg=5.0)
    command = replace(PATH.command, amplitude_um=36.7, mean_um=125.0, overtones=(nine,))
    assert codes(CutPath(wanted=replace(WANTED, amplitude_um=28.9), command=command)) == []
    half = CutPath(wanted=replace(WANTED, amplitude_um=13.75), command=replace(PATH.command, amplitude_um=15.5))
    assert codes(half) == []


@pytest.mark.parametrize(
    "wanted",
    [
        {"mean_um": 500.0},
        {"amplitude_um": 1000.0},
        {"crest_deg": 30.0},
        {"lobes": 4},
        {"growth_per_mm": 0.5},
        {"overtones": (Wave(lobes=6, amplitude_um=100.0, crest_deg=0.0),)},
        {"overtones": (Wave(lobes=3, amplitude_um=100.0, crest_deg=0.0),)},
        {"mean_um": float("nan")},
    ],
)
def test_what_is_another_cut_is_refused(wanted: dict[str, object]) -> None:
    other = replace(WANTED, **wanted)  # type: ignore[arg-type]
    for path in (
        CutPath(wanted=other, command=invert(other, LAG)),
        CutPath(wanted=WANTED, command=invert(other, LAG)),
    ):
        assert codes(path) != []
