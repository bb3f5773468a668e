"""A chuck whose jaw presses harder makes an oval on each part; a blank makes another one, at any angle.

The tool learns the path of the first in air, where no blank is. The second is trimmed in the cut.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.learning import MADE, job_file
from console.session.cut.run import plan_run
from console.session.learning import learning
from console.session.learning.order_learning import LearnHow, OrderLearning
from drivers.cutting.planning import Strategy
from drivers.lathe.heartbeat import cut_condition
from drivers.pmac.programs.cam_trim import MOST_TRIM_UM
from profiles.compensations.learning import HarmonicFit, coefficient_of
from profiles.job import Job
from profiles.store import load_job, load_machine
from tests.console.commands import Console

MACHINE = load_machine("lee-2001-lathe").machine
RING = load_job("lee-2001-experiment-1").job


def six(tmp_path: Path) -> Job:
    return load_job(str(job_file("six", tmp_path))).job


class Air:
    """Passes in air of a tool that arrives with `arrives` of what its model says, and how many there were."""

    def __init__(self, learner: learning._Learner, arrives: complex) -> None:
        self.learner, self.arrives, self.errors_um = learner, arrives, list[float]()

    def __call__(self) -> HarmonicFit:
        path, learner = self.learner._path, self.learner
        error_um = {
            n: coefficient_of(path.target, n)
            - self.arrives * learner._response(n) * coefficient_of(path.command, n)
            for n in learner._orders.fitted
        }
        self.errors_um.append(abs(error_um[2]))
        learner._in_air_at = path.target
        return HarmonicFit(mean_um=0.0, coefficients_um=error_um, amplitude_sd_um=0.01)


def learner_of(job: Job) -> learning._Learner:
    plan = plan_run(job, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
    return learning._Learner(plan, None, lambda *_: None, LearnHow())  # type: ignore[arg-type]


def test_an_oval_that_the_chuck_makes_is_learned_in_air_and_only_that(tmp_path: Path) -> None:
    learner = learner_of(six(tmp_path))
    air = Air(learner, arrives=0.65 + 0.1j)
    learner._air_pass = air  # type: ignore[method-assign]
    learner._in_air_anew()
    assert air.errors_um == [], "nothing has moved: no pass"
    oval = {2: 14.0 + 0j}
    learner._path = replace(
        learner._path,
        target=learner._path.target.plus(oval),
        command=learner._path.command.plus({2: oval[2] / learner._response(2)}),
    )
    sixth = coefficient_of(learner._path.command, 6)
    learner._in_air_anew()
    # abs(1 - T'/T) = 0.364 a pass: 5.1 um, 1.9, 0.7; then 0.25.
    assert air.errors_um == pytest.approx([14.0 * 0.364**k for k in (1, 2, 3)], rel=0.01)
    assert air().coefficients_um[2] == pytest.approx(0.0, abs=0.3)
    assert coefficient_of(learner._path.command, 6) == pytest.approx(sixth), "the lobe is learned in the parts"
    learner._in_air_anew()
    assert len(air.errors_um) == 4, "the tool follows it: no pass more"


@pytest.mark.parametrize("jaws", [2, 3, 4, 6])
def test_a_batch_is_as_quick_with_many_jaws_and_shows_each_learned_order(jaws: int) -> None:
    """What is fetched between two polls is short: with twice the samples half as many batches trim a cut."""
    orders = OrderLearning(replace(RING, jaws=jaws), MACHINE, Strategy.CAM, LearnHow())
    assert orders.samples_a_turn <= 36
    assert orders.samples_a_turn >= 3 * max(orders.learned)
    assert orders.of_blanks == ((3,) if jaws == 2 else (2,))


@pytest.mark.long
@pytest.mark.timeout(300)
def test_with_six_jaws_the_second_part_is_rounder_by_far(
    console: Console, close: tuple[str, str], tmp_path: Path
) -> None:
    """Jaw 1 makes 13.8 um of oval, more than twice the lobe; 0.90 of a path arrives, so 2.7 um p-p of it stay."""
    path = job_file("six", tmp_path)
    words = (
        str(path),
        *close,
        "--sim",
        "--plant",
        "realistic",
        "--seed",
        "3",
        "--strategy",
        "cam",
        "--learn",
        "2",
    )
    first, second = json.loads(console("run", *words, "--json").out)["passes"]
    assert first["RONt_um"] > 25.0
    assert second["RONt_um"] < 0.25 * first["RONt_um"]
    assert MADE["six"]["jaws"] == 6 and MOST_TRIM_UM < 13.8, "a trim alone could not"
