"""How the jaws hold, from sections: the truth is the shell of the simulated lathe, by finite differences."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import numpy as np
import pytest

from drivers.simulator.plant.presets import plant_named
from profiles.job import Job
from profiles.lobe.along import along_cut
from profiles.lobe.jaw_fit import MOST_SD, SectionLobe, fit_straight_fraction
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine

LATHE = load_machine("lee-2001-lathe").machine
ONE, TWO = (load_job(f"lee-2001-experiment-{number}").job for number in (1, 2))
NOISE_UM = 0.1  # standard deviation of an amplitude that a good gauge finds


def lathe_with(fraction: float) -> MachineProfile:
    return replace(LATHE, chuck=replace(LATHE.chuck, jaw_straight_fraction=fraction))


def sections_of(job: Job, stiffness: float, past_mm: tuple[float, ...], seed: int = 1) -> list[SectionLobe]:
    """Return the lobe of the simulated shell at places past mid-cut, with the noise of a gauge."""
    blank = replace(plant_named("realistic", LATHE, seed, None), jaw_stiffness=stiffness).blank(job)
    angle, noise = np.arange(360.0), Random(f"{stiffness} {seed}")
    found = []
    for past in past_mm:
        surface_um = blank.spring_back_um(angle, blank.middle_mm + past)
        c = 2.0 * complex(np.mean(surface_um * np.exp(-1j * job.jaws * np.radians(angle))))
        c += complex(noise.gauss(0.0, NOISE_UM), noise.gauss(0.0, NOISE_UM))
        z_mm = job.overhang_mm - job.cut_length_mm / 2.0 - past
        found.append(SectionLobe(z_mm=z_mm, lobe_um=c, sd_um=NOISE_UM))
    return found


def test_two_sections_predict_a_third_better_than_the_usual_fraction() -> None:
    """Jaws of ten stiffnesses: the worst third section within 0.3 um of amplitude; 0.75 misses it by several."""
    chance, missed = Random(5), []
    for number in range(10):
        stiffness = 10.0 ** chance.uniform(0.0, 3.0)
        jaws_side, free_end, third = sections_of(ONE, stiffness, (3.2, -3.2, 1.6), number)
        fitted = fit_straight_fraction(ONE, LATHE, [jaws_side, free_end])
        off = []
        for fraction in (fitted.fraction, 0.75):
            # Scaled to the free end, where either is right.
            at_free, at_third = along_cut(ONE, lathe_with(fraction)).factor(3, [-3.2, 1.6])
            off.append(abs(abs(third.lobe_um) - abs(free_end.lobe_um) * at_third / at_free))
        missed.append(off)
    fitted_um, usual_um = np.array(missed).T
    assert fitted_um.max() < 0.3
    assert usual_um.max() > 4.0 and np.median(usual_um) > 4.0 * np.median(fitted_um)


@pytest.mark.parametrize("fraction", [0.1, 0.5, 0.9])
def test_the_uncertainty_is_that_of_the_noise(fraction: float) -> None:
    """Of 200 pairs of sections about 68 % are within one standard uncertainty, and 95 % within two."""
    factor = along_cut(ONE, lathe_with(fraction)).factor(3, [3.2, 0.0, -3.2])
    chance, off = Random(3), []
    for _ in range(200):
        lobes = [27.5 * each + chance.gauss(0.0, NOISE_UM) for each in factor]
        found = fit_straight_fraction(
            ONE,
            LATHE,
            [
                SectionLobe(z_mm=z, lobe_um=each * 1j, sd_um=NOISE_UM)
                for z, each in zip((22.8, 26.0, 29.2), lobes, strict=True)
            ],
        )
        off.append((found.fraction - fraction) / found.sd)
    assert abs(np.mean(off)) < 1.0
    assert np.mean(np.abs(off) < 2.5) > 0.9


def test_sections_that_cannot_tell_are_refused_with_what_they_leave_open() -> None:
    close = sections_of(ONE, 45.0, (0.02, -0.02))
    with pytest.raises(ProfileError) as refused:
        fit_straight_fraction(ONE, LATHE, close)
    (problem,) = refused.value.problems
    assert problem.code == "jaws.undetermined" and problem.limit == f"± {MOST_SD:g}"
    assert float(problem.value.split("±")[1].split(",")[0]) > MOST_SD
    with pytest.raises(ProfileError) as refused:
        fit_straight_fraction(ONE, LATHE, close[:1] * 2)
    assert refused.value.problems[0].code == "jaws.undetermined"
    with pytest.raises(ProfileError) as refused:
        fit_straight_fraction(load_job("steel-bar-65").job, LATHE, [replace(each, z_mm=60.0) for each in close])
    assert refused.value.problems[0].code in ("jaws.undetermined", "jaws.height")


def test_what_no_jaws_have_is_refused_by_how_much() -> None:
    """Steeper along Z than even pressure: sections of another height than stated."""
    for lobes, above in (((40.0, 2.0), False), ((28.0, 27.5), True)):
        sections = [
            SectionLobe(z_mm=z, lobe_um=um + 0j, sd_um=NOISE_UM) for z, um in zip((22.8, 29.2), lobes, strict=True)
        ]
        with pytest.raises(ProfileError) as refused:
            fit_straight_fraction(ONE, LATHE, sections)
        (problem,) = refused.value.problems
        assert (problem.code, problem.limit) == ("jaws.outside", "0 … 1")
        fraction = float(problem.value.split("±")[0])
        assert fraction > 1.0 if above else fraction < 0.0
    with pytest.raises(ProfileError) as refused:
        fit_straight_fraction(ONE, LATHE, [replace(each, z_mm=each.z_mm + 22.0) for each in sections])
    assert refused.value.problems[0].code == "jaws.height"


def test_sections_of_a_compensated_part_are_refused_by_how_small_their_lobe_is() -> None:
    """A tenth of the lobe everywhere, and what a path leaves that is the same at every Z."""
    plain = sections_of(TWO, 45.0, (3.2, 0.0, -3.2))
    middle_um = plain[1].lobe_um
    for left in ([0.1 * each.lobe_um for each in plain], [each.lobe_um - 0.95 * middle_um for each in plain]):
        with pytest.raises(ProfileError) as refused:
            fit_straight_fraction(TWO, LATHE, [replace(s, lobe_um=c) for s, c in zip(plain, left, strict=True)])
        (problem,) = refused.value.problems
        assert (problem.code, problem.key) == ("jaws.compensated", "lobe_error_um_pp")
        assert float(problem.limit.split()[0]) == pytest.approx(0.25 * TWO.lobe_error_um_pp, abs=0.06)
        assert float(problem.value.split()[0]) < float(problem.limit.split()[0])
