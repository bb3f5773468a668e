"""A learned path that is no correction of its cut is refused, whoever wrote its file."""

import cmath
from dataclasses import replace

import pytest

from profiles.axis.friction import held_back_um
from profiles.compensations.path import CutPath, LobedPath, PathHarmonic, invert, path_problems, target_path
from profiles.job import Job
from profiles.store import load_job, load_machine

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=90.0)
LAG = cmath.rect(0.885, -0.9)
PATH = CutPath(target=WANTED, command=invert(WANTED, LAG))


MACHINE = load_machine("lee-2001-lathe").machine
RING = load_job("lee-2001-experiment-1").job


def codes(path: CutPath, job: Job = RING) -> list[str]:
    target = WANTED if job is RING else target_path(job)
    found = path_problems(path, target, lambda _: LAG, lambda n: held_back_um(MACHINE, job, n))
    return [problem.code for problem in found]


def test_what_learning_does_is_let_through() -> None:
    """As on the realistic lathe: friction asks for a fifth more, the cut for 25 um of mean, overtones for one."""
    nine = PathHarmonic(lobes=9, amplitude_um=0.9, phase_deg=5.0)
    command = replace(PATH.command, amplitude_um=36.7, mean_um=125.0, overtones=(nine,))
    assert codes(CutPath(target=replace(WANTED, amplitude_um=28.9), command=command)) == []
    half = CutPath(target=replace(WANTED, amplitude_um=13.75), command=replace(PATH.command, amplitude_um=15.5))
    assert codes(half) == []


@pytest.mark.parametrize(
    "target",
    [
        {"mean_um": 500.0},
        {"amplitude_um": 1000.0},
        {"phase_deg": 30.0},
        {"lobes": 4},
        {"growth_per_mm": 0.5},
        {"overtones": (PathHarmonic(lobes=6, amplitude_um=100.0, phase_deg=0.0),)},
        {"overtones": (PathHarmonic(lobes=3, amplitude_um=100.0, phase_deg=0.0),)},
        {"mean_um": float("nan")},
    ],
)
def test_what_is_another_cut_is_refused(target: dict[str, object]) -> None:
    other = replace(WANTED, **target)  # type: ignore[arg-type]
    for path in (
        CutPath(target=other, command=invert(other, LAG)),
        CutPath(target=WANTED, command=invert(other, LAG)),
    ):
        assert codes(path) != []


def test_friction_may_hold_a_tool_by_what_its_loop_gives_way() -> None:
    """7.545 um/N at 10 Hz by the paper's gains, 1.755 um/N at 50 Hz in the simulated loop; 5 N."""
    slow = replace(RING, spindle_speed_rpm=200.0)
    assert held_back_um(MACHINE, slow, 3) == pytest.approx(1.2732 * 5.0 * 7.545, rel=0.01)
    assert held_back_um(MACHINE, RING, 3) == pytest.approx(1.2732 * 5.0 * 1.755, rel=0.01)
    assert held_back_um(MACHINE, slow, 15) == pytest.approx(1.2732 / 5.0 * 5.0 * 1.755, rel=0.01)
    assert [held_back_um(MACHINE, RING, n) for n in (2, 5, 6)] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("held_um", "told"), [(17.3, []), (60.0, ["path.beyond"])])
def test_a_small_slow_lobe_may_be_told_much_more_than_it_is_to_do(held_um: float, told: list[str]) -> None:
    """3 N hold a tool by (4/pi) 3 N 4.51 um/N = 17.2 um at 20 Hz, in which two jaws want 5.2 um."""
    job = load_job("two-jaw-tube").job
    target = target_path(job)
    held = target.plus({2: held_um * 1j * target.harmonics[0].coefficient / target.amplitude_um})
    assert codes(CutPath(target=target, command=invert(held, LAG)), job) == told
    misread = CutPath(target=held, command=invert(held, LAG))
    assert codes(misread, job) == ["path.beyond"], "what is wanted of the tool has no friction"


@pytest.mark.parametrize(
    ("order", "oval_um", "command", "told"),
    [
        (2, 14.0, 2.2, []),
        (2, 14.0, 3.0, ["path.beyond"]),
        (2, 30.0, 1.0, ["path.beyond"]),
        (3, 14.0, 1.0, ["path.beyond"]),
    ],
)
def test_one_harder_jaw_of_six_may_make_more_oval_than_there_is_lobe(
    order: int, oval_um: float, command: float, told: list[str]
) -> None:
    """A ring is (35/3)^2 = 136 times softer to an oval than to six lobes: 10 % more on one jaw makes 2.7 lobes."""
    job = replace(RING, jaws=6, lobe_jaws=6, lobe_error_um_pp=12.0)
    target = target_path(job)
    wanted, asked = (target.plus({order: k * oval_um * 1j}) for k in (1.0, command))
    found = codes(CutPath(target=wanted, command=invert(asked, LAG)), job)
    assert sorted(set(found)) == told
