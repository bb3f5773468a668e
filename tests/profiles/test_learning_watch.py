"""Whatever an axis makes of its command, learning never leaves a wave worse than it found it."""

from __future__ import annotations

import cmath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.compensations.learning import (
    REPEATS_SD_UM,
    Deviation,
    Watch,
    coefficient_of,
    learned_command,
    learned_part,
)
from profiles.compensations.next_version import FIRST_GAIN, LATER_GAIN
from profiles.compensations.path import CutPath, LobedPath

WANTED = LobedPath(mean_um=100.0, amplitude_um=27.5, lobes=3, phase_deg=90.0)
RESPONSES = st.builds(cmath.rect, st.floats(0.0, 4.0), st.floats(-cmath.pi, cmath.pi))
WRONG = st.builds(cmath.rect, st.floats(2.0, 30.0), st.floats(-cmath.pi, cmath.pi))


def nominal(n: int) -> complex:
    return cmath.rect(0.8, -0.3 * n)


def made(path: CutPath, true: complex, n: int) -> complex:
    """What an axis that makes `true` times its nominal response does of a wave."""
    return true * nominal(n) * coefficient_of(path.command, n)


def noise(random: np.random.Generator) -> complex:
    return 0.5 * REPEATS_SD_UM * complex(random.normal(), random.normal())


@given(RESPONSES, WRONG, st.integers(2, 8), st.integers(0, 99))
def test_a_tool_in_air_is_never_left_worse_than_it_began(
    true: complex, wrong: complex, passes: int, seed: int
) -> None:
    """Three times the lobe, where friction makes `wrong`, and T'/T is anything: sign, phase and size."""
    random, watch, path = np.random.default_rng(seed), Watch(), CutPath(target=WANTED, command=WANTED)
    for _ in range(passes):
        off = {9: wrong - made(path, true, 9) + noise(random)}
        watch = watch.judged(path, off, lambda _: 0.04)
        path = learned_command(watch.kept(path), watch.learned(off), nominal)
    assert abs(wrong - made(path, true, 9)) <= 1.5 * abs(wrong)
    if abs(1 - true) > 1.5:
        assert watch.frozen == {9}
        assert coefficient_of(path.command, 9) == 0j, "it is as if nobody had learned it"
    if abs(1 - true) < 0.9:
        assert watch.grown == ()


@given(RESPONSES, WRONG, WRONG, st.integers(0, 99))
def test_parts_in_a_row_end_no_worse_than_the_first(
    true: complex, held: complex, misjudged: complex, seed: int
) -> None:
    """`held` is what keeps the tool from its path, `misjudged` what the path itself is wrong by."""
    random, watch, path, left = np.random.default_rng(seed), Watch(), CutPath(target=WANTED, command=WANTED), []
    for number in range(6):
        tool = {9: coefficient_of(path.target, 9) + held - made(path, true, 9)}
        part = {9: misjudged - coefficient_of(path.target, 9) + tool[9] + noise(random)}
        left.append(abs(part[9]))
        watch = watch.judged(path, part, lambda _: 0.01)
        high, missed = (Deviation(coefficients_um=watch.learned(each)) for each in (part, tool))
        gain = LATER_GAIN if number else FIRST_GAIN
        path = learned_part(watch.kept(path), high, missed, nominal, gain)
    assert left[-1] <= max(1.5 * left[0], left[0] + 1.0)
    if watch.frozen:
        assert left[-1] <= min(left) + 6.0 * REPEATS_SD_UM


def test_what_one_path_leaves_otherwise_from_pass_to_pass_stops_nothing() -> None:
    path, sure = CutPath(target=WANTED, command=WANTED), 0
    for seed in range(50):
        random, watch = np.random.default_rng(seed), Watch()
        for _ in range(8):
            watch = watch.judged(path, {n: noise(random) for n in (3, 6, 9)}, lambda _: 0.005)
        sure += len(watch.grown)
    assert sure == 0


def test_one_wave_that_grows_leaves_the_others_to_be_learned_and_stays_as_it_was() -> None:
    path, watch, true = CutPath(target=WANTED, command=WANTED), Watch(), {3: 0.7 + 0j, 9: 2.6 + 0.8j}
    for _ in range(4):
        off = {3: WANTED.harmonics[0].coefficient - made(path, true[3], 3), 9: 1j - made(path, true[9], 9)}
        watch = watch.judged(path, off, lambda _: 0.04)
        path = learned_command(watch.kept(path), watch.learned(off), nominal)
    assert abs(WANTED.harmonics[0].coefficient - made(path, true[3], 3)) < 0.5
    (grown,) = watch.grown
    assert (grown.order, grown.best_um) == (9, 1.0)
    assert grown.grown_um == pytest.approx(abs(1 - true[9]))
    # Other passes begin, and it is still not learned.
    assert watch.afresh().learned({3: 1j, 9: 1j}) == {3: 1j}
    assert coefficient_of(watch.afresh().kept(path).command, 9) == 0j


def test_what_friction_may_do_meanwhile_is_no_growth() -> None:
    path = CutPath(target=WANTED, command=WANTED)
    begun = Watch().judged(path, {6: 0.1j}, lambda _: 0.05)
    assert begun.judged(path, {6: 0.7j}, lambda _: 0.05).frozen == {6}
    assert begun.judged(path, {6: 0.7j}, lambda _: 0.05, lambda _: 2.4).frozen == frozenset()
