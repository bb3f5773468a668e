"""What sections teach along the cut, from parts that are made up: by their truth, not by the model of a lobe."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from profiles.arrays import read_only
from profiles.compensations.axial_learning import (
    NO_SECTIONS,
    AxialHistory,
    AxialRules,
    AxialSteps,
    axial_steps,
    fit_axial,
)
from profiles.compensations.certificate import OrderStatus, ToolResponse
from profiles.compensations.part_harmonics import PartHarmonics, part_harmonics
from profiles.compensations.path import AlongCut, CutPath, LobedPath, axial_um
from profiles.store import load_job
from profiles.traces import Trace

JOB = load_job("lee-2001-experiment-1").job
PLACES = (-0.8, -0.4, 0.0, 0.4, 0.8)
KNOWN = AlongCut(half_length_mm=4.0, orders=((3, (0.2, 0.03)),))
STEEP = AlongCut(half_length_mm=4.0, orders=((3, (-2.0, 3.0)),))
Surface = Callable[[np.ndarray, float], np.ndarray]


def sections(
    surface_um: Surface, places: Sequence[float] = PLACES, noise_um: float = 0.05, seed: int = 1
) -> list[tuple[float, PartHarmonics]]:
    chance, angle_deg = np.random.default_rng(seed), np.arange(1800) * 0.2
    meta = {"state": "free", "start_mark": "spindle index", "direction": "spindle"}
    found = []
    for s in places:
        deviation_um = surface_um(np.radians(angle_deg), s) + chance.normal(0.0, noise_um, angle_deg.size)
        trace = Trace(angle_deg=read_only(angle_deg), deviation_um=read_only(deviation_um), meta=meta)
        found.append((s, part_harmonics(trace, JOB, filter_upr=50.0, beside=(2,))))
    return found


def rules(**how: object) -> AxialRules:
    given: dict[str, object] = {
        "lobes": 3,
        "orders": frozenset({2, 3, 6}),
        "chucked": frozenset({3, 6}),
        "frozen": frozenset(),
        "scatter": 0.05,
        "known_within": (0.1, 0.05),
        "follows": lambda _: ToolResponse(response=0.9 - 0.2j, spread=0.05),
    }
    return AxialRules(**{**given, **how})  # type: ignore[arg-type]


def path(amplitude_um: float = 27.5) -> LobedPath:
    return LobedPath(mean_um=100.0, amplitude_um=amplitude_um, lobes=3, phase_deg=0.0, along=KNOWN)


def standings(steps: AxialSteps) -> Mapping[tuple[int, int], OrderStatus]:
    return {(each.order, each.axial): each.standing for each in steps.certificate}


def test_the_force_of_one_clamping_is_not_a_slope() -> None:
    """A lobe 8 % too high everywhere changes along Z as the lobe does: nothing of that is learned along Z."""

    def too_high(angle: np.ndarray, s: float) -> np.ndarray:
        return 2.2 * (1.0 + 0.2 * s + 0.03 * s**2) * np.cos(3.0 * angle)

    steps = axial_steps(fit_axial(sections(too_high), KNOWN, (3, 6)), path(), rules(), AxialHistory())
    assert not steps.changes_um
    assert standings(steps)[3, 1] is OrderStatus.NOISE


def test_a_lobe_that_changes_otherwise_and_turns_and_a_taper_are_found_and_removed() -> None:
    """Slope 3 um at 40 degrees of lobe, curvature 1.5 um, and a taper of 2 um from the middle to an end."""

    def left(angle: np.ndarray, s: float) -> np.ndarray:
        return np.asarray(
            s * 3.0 * np.cos(3.0 * angle - np.radians(40.0)) + s**2 * 1.5 * np.cos(3.0 * angle) - 2.0 * s
        )

    fit = fit_axial(sections(left), KNOWN, (3, 6))
    assert fit.coefficients_um[3, 1] == pytest.approx(3.0 * np.exp(-1j * np.radians(40.0)), abs=0.05)
    assert fit.coefficients_um[3, 2] == pytest.approx(1.5, abs=0.05)
    assert fit.coefficients_um[0, 1] == pytest.approx(-2.0, abs=0.05)
    steps = axial_steps(fit, path(), rules(), AxialHistory())
    now = steps.applied(CutPath(target=path(), command=path()), rules().follows)
    angle_deg = np.linspace(0.0, 360.0, 90)
    for s in (-1.0, -0.3, 0.5, 1.0):
        deeper_um = now.target.at_um(angle_deg, 4.0 * s) - path().at_um(angle_deg, 4.0 * s)
        assert deeper_um == pytest.approx(left(np.radians(angle_deg), s), abs=0.15)
    command, target = axial_um(now.command.axial), axial_um(now.target.axial)
    assert command[3, 1] == pytest.approx(target[3, 1] / (0.9 - 0.2j))
    assert command[0, 1] == pytest.approx(target[0, 1]), "the mean is followed as it is"


@pytest.mark.parametrize("places", [(), (0.3,), (0.3, 0.3), (-0.7, 0.7)])
def test_what_no_section_determines_is_not_learned_and_said_so(places: tuple[float, ...]) -> None:
    def left(angle: np.ndarray, s: float) -> np.ndarray:
        return (3.0 * s + 3.0 * s**2) * np.cos(3.0 * angle)

    fit = fit_axial(sections(left, places), KNOWN, (3, 6))
    steps = axial_steps(fit, path(), rules(), AxialHistory())
    two = len(set(places)) == 2
    assert (3, 2) not in steps.changes_um and ((3, 1) in steps.changes_um) is two
    assert standings(steps)[3, 2] is OrderStatus.UNSEEN
    bow = next(each for each in steps.certificate if (each.order, each.axial) == (3, 2))
    assert bow.known_within_um == pytest.approx(0.05 * 27.5), "as the model has it"
    assert standings(steps)[3, 1] is (OrderStatus.LEARNED if two else OrderStatus.UNSEEN)


def test_sections_close_to_each_other_teach_nothing_that_is_within_their_noise() -> None:
    fit = fit_axial(
        sections(lambda angle, s: 0.5 * s * np.cos(3.0 * angle), (0.0, 0.02, 0.04), noise_um=0.3), KNOWN, (3,)
    )
    assert fit.sd_um[3, 1] > 1.0
    assert not axial_steps(fit, path(), rules(), AxialHistory()).changes_um


@pytest.mark.parametrize("apart", [1e-5, 0.003])  # of 4 mm: within what counts as one section
def test_a_section_measured_again_is_no_further_height(apart: float) -> None:
    """Else a parabola through two points of one height throws the middle, and its slope, by hundreds of um."""
    fit = fit_axial(
        sections(lambda angle, s: 2.0 * s * np.cos(3.0 * angle), (-0.5, apart - 0.5, 0.5)), KNOWN, (3,)
    )
    assert fit.coefficients_um[3, 1] == pytest.approx(2.0, abs=0.1)
    assert (3, 2) not in fit.coefficients_um


def test_a_slope_is_as_uncertain_as_the_middle_that_is_carried_along() -> None:
    """Of 40 parts of noise alone the slope scatters by its standard error, with heights unevenly apart, too."""
    places, noise_um = (-0.5, -0.4, 0.9), 2.0
    fits = [
        fit_axial(sections(lambda angle, s: 0.0 * angle, places, noise_um, seed), STEEP, (3,))
        for seed in range(40)
    ]
    scatter_um = np.std([fit.coefficients_um[3, 2] for fit in fits])
    assert scatter_um <= 1.3 * fits[0].sd_um[3, 2]


def test_a_section_that_was_turned_on_the_gauge_teaches_nothing_along_the_part() -> None:
    """8 um of the lobe are left, with a slope of 1 um; one of five sections stands 40 degrees aside."""

    def left(angle: np.ndarray, s: float) -> np.ndarray:
        aside = np.radians(40.0) if s == PLACES[1] else 0.0
        return np.asarray((8.0 + s) * np.cos(3.0 * (angle - aside)))

    steps = axial_steps(fit_axial(sections(left), KNOWN, (3, 6)), path(), rules(), AxialHistory())
    assert not steps.changes_um


def test_of_sections_without_a_size_no_taper_is_learned() -> None:
    """A gauge that levels each section by itself writes no mean: none is not the same as round to size."""
    fit = fit_axial(sections(lambda angle, s: -2.0 * s + 0.0 * angle), KNOWN, (3,), sized=False)
    assert not any(order == 0 for order, _ in fit.coefficients_um)


def test_an_oval_is_learned_along_the_part_from_the_second_part_that_shows_it() -> None:
    def oval(angle: np.ndarray, s: float) -> np.ndarray:
        return 2.0 * s * np.cos(2.0 * angle)

    first = axial_steps(fit_axial(sections(oval), KNOWN, (2, 3)), path(), rules(), AxialHistory())
    assert standings(first)[2, 1] is OrderStatus.ONE_PART and not first.changes_um
    fit = fit_axial(sections(oval, seed=2), KNOWN, (2, 3))
    second = axial_steps(fit, path(), rules(), AxialHistory().add(first))
    assert second.changes_um[2, 1].real == pytest.approx(2.0, rel=0.1)


def test_noise_of_two_parts_does_not_vary_it_is_noise() -> None:
    history = AxialHistory()
    for seed in (1, 2):
        fit = fit_axial(sections(lambda angle, s: 0.0 * angle, seed=seed), KNOWN, (2, 3))
        steps = axial_steps(fit, path(), rules(), history)
        history = history.add(steps)
    assert {each for key, each in standings(steps).items() if key[0] == 2} == {OrderStatus.NOISE}


def test_a_program_of_segments_learns_what_is_in_phase_with_its_lobe() -> None:
    def left(angle: np.ndarray, s: float) -> np.ndarray:
        return s * (2.0 * np.cos(3.0 * angle) + 1.0 * np.sin(3.0 * angle))

    fit = fit_axial(sections(left), KNOWN, (3,))
    steps = axial_steps(fit, path(), rules(orders=frozenset({3}), in_phase=True), AxialHistory())
    folded = path().plus_axial(steps.changes_um).fold_axial()
    assert folded.axial == () and folded.along.powers(3)[0] == pytest.approx(0.2 + 2.0 / 27.5, abs=0.005)


def test_the_gain_falls_from_part_to_part_and_without_sections_nothing_is_said_of_other_orders() -> None:
    fit = fit_axial(sections(lambda angle, s: 1.0 * s * np.cos(3.0 * angle)), KNOWN, (3,))
    gains, history = [], AxialHistory()
    for _ in range(3):
        steps = axial_steps(fit, path(), rules(scatter=0.5), history)
        gains.append(next(each.gain for each in steps.certificate if (each.order, each.axial) == (3, 1)))
        history = history.add(steps)
    assert gains[0] > gains[1] > gains[2]
    assert {each.order for each in axial_steps(NO_SECTIONS, path(), rules(), history).certificate} == {3}
