"""Parts in a row whose tool is off its path by what each test says: what repeats is learned, and nothing else.

The tool does T u + d, of which d is the disturbance and T its response; what its path lacks is on the part.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import pytest

from console.cli.machine import run_cut
from console.session.cut.run import plan_run
from console.session.learning import learning
from console.session.learning.order_learning import LearnHow
from console.session.learning.row_result import LearnResult
from console.text.catalogue import load
from drivers.cutting.planning import Strategy
from drivers.lathe.heartbeat import cut_condition
from profiles.compensations.certificate import Certified, Standing
from profiles.compensations.learning import Deviation, coefficient_of
from profiles.store import load_job, load_machine
from tests.tui.stage import LANGUAGES

MACHINE = load_machine("lee-2001-lathe").machine
RING = load_job("lee-2001-experiment-1").job
ANGLES = (0.0, 2.2, -2.0, 0.9, 3.0, -1.1)
"""Angles of an order on six parts: none is near that before it."""


class Row:
    """A row of parts, whose tool moves by `arrives` of what is known of it."""

    def __init__(self, arrives: Mapping[int, complex] | None = None) -> None:
        plan = plan_run(RING, MACHINE, Strategy.CAM, watchdog=cut_condition(MACHINE))
        self.learner = learning._Learner(plan, None, lambda *_: None, LearnHow())  # type: ignore[arg-type]
        self.arrives = arrives or {}
        self.shown: list[dict[int, Certified]] = []

    def part(self, disturbed_um: Mapping[int, complex]) -> None:
        """Cut a part, and learn from it."""
        learner: Any = self.learner
        orders = learner._orders
        learner._path, learner._cutting = learner._lobe.clamp(learner._path, None, learner._response)
        orders.begin(learner._path, learner._watch)
        off = {}
        for n in orders.fitted:
            moved = self.arrives.get(n, 1.0) * learner._response(n) * coefficient_of(learner._path.command, n)
            off[n] = coefficient_of(learner._path.target, n) - moved - disturbed_um.get(n, 0j)
        seen = SimpleNamespace(mean_um=0.0, coefficients_um=off, sd_um=dict.fromkeys(off, 0.02))
        learner._teaching = lambda _: seen
        _, found = learner._learn_from(0j, None, Deviation(coefficients_um=off, sd_um=0.02), 1.0)
        self.shown.append({each.order: each for each in found})

    def heights_um(self, order: int) -> list[float]:
        """Return the amplitude on each part."""
        return [part[order].on_part_um or 0.0 for part in self.shown]

    def standings(self, order: int) -> list[Standing]:
        return [part[order].standing for part in self.shown]


def test_what_comes_with_each_blank_is_left_as_it_comes_from_the_fourth_part_on() -> None:
    """Learned, a part has this one less the one before: 1.8 um of 1 um, which is taken for its growth."""
    row = Row()
    for angle in ANGLES:
        row.part({5: cmath.rect(1.0, angle), 4: 0.8 + 0j})
    heights = row.heights_um(5)
    assert heights == pytest.approx([1.0, 2.0 * math.sin(1.1), 1.0, 1.0, 1.0, 1.0])
    assert row.standings(5) == [Standing.LEARNED, Standing.GREW] + [Standing.VARIES] * 4
    assert row.learner._watch.grown == ()
    assert max(row.heights_um(4)[1:]) < 0.1, "what repeats is learned"
    assert Standing.VARIES not in row.standings(4)


def test_what_varied_is_learned_again_once_it_repeats() -> None:
    row = Row()
    for angle in (*ANGLES[:3], *(0.9,) * 8):
        row.part({5: cmath.rect(1.0, angle)})
    standings = row.standings(5)
    assert standings[2] is Standing.VARIES and Standing.VARIES not in standings[-2:]
    assert row.heights_um(5)[-1] < 0.2


def test_an_order_that_stays_large_at_its_best_path_did_not_grow_by_learning_and_is_learned() -> None:
    """Three times the lobe: 0.15 um on the first part, and 0.9 from the second on, as the lobe became larger."""
    row = Row()
    for number in range(5):
        row.part({9: 0.9 + 0j if number else 0.15 + 0j})
    assert row.standings(9)[1:3] == [Standing.GREW, Standing.LEARNED]
    assert row.heights_um(9)[2] == pytest.approx(0.9), "its best path was cut again"
    assert max(row.heights_um(9)[3:]) < 0.2
    assert row.learner._watch.grown == (), "and nobody is told that its best is kept"


def test_an_order_that_learning_makes_worse_returns_to_its_best_and_stays_there() -> None:
    """The tool does 2.6 times what is known of it: a step makes -1.6 um of 1 um."""
    row = Row(arrives={5: 2.6 + 0j})
    for _ in range(6):
        row.part({5: 1.0 + 0j})
    assert row.heights_um(5) == pytest.approx([1.0, 1.6, 1.0, 1.0, 1.0, 1.0])
    assert row.standings(5) == [Standing.LEARNED] + [Standing.GREW] * 5


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_report_says_what_of_an_order_no_learning_removes(language: str) -> None:
    """Twice a turn it is the blank's, its trim at the limit; five times a turn what varies; the rest is small."""
    shape: dict[str, Any] = {"gain": 0.5, "factor": 0.5, "bound": 0.6, "bound_gain_1": 0.4}
    heights = ((2, 5.48, 0.37, 5.83), (4, 0.5, 0.5, 0.9), (5, 1.34, 1.34, 1.46), (7, 0.1, 0.1, 0.2))
    standings = {2: Standing.LEARNED, 4: Standing.LEARNED, 5: Standing.VARIES, 7: Standing.VARIES}
    certificate = tuple(
        Certified(order=n, on_part_um=on, left_um=left, tool_off_um=off, standing=standings[n], **shape)
        for n, on, left, off in heights
    )
    plan: Any = SimpleNamespace(job=RING)
    part: Any = SimpleNamespace(certificate=certificate, trim_short={2: 7.1})
    none: Any = None
    of: dict[str, Any] = {"simulated": True, "figures": none, "collisions": (), "parts": (part,)}
    result = LearnResult(plan=plan, before=none, after=none, floor=none, **of)
    oval, fifth = run_cut._own(result, load(language))
    assert all(figure in oval for figure in ("10.96", "11.66", "0.74", " 16 um p-p"))
    assert all(figure in fifth for figure in ("2.68", "2.92")) and " 16 um" not in fifth
