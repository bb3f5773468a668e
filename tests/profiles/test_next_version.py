"""A row of parts on an axis that is not what it is taken for: what each teaches the next, and when it must not."""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from profiles.calibration.lobe import find_lobe
from profiles.compensations.certificate import ToolResponse
from profiles.compensations.learned_compensation import HoldsFor, as_table, differences, from_table
from profiles.compensations.learning import coefficient_of
from profiles.compensations.next_version import (
    AppliedPath,
    ImprovementVerdict,
    LearningStep,
    compare_uncompensated,
    next_version,
)
from profiles.compensations.part_harmonics import PartHarmonics, part_harmonics
from profiles.compensations.path import CutPath, expect_residual, fraction_of, invert, target_path
from profiles.job import Job
from profiles.problem import ProfileError
from profiles.store import load_job
from profiles.traces import Trace

JOB = load_job("lee-2001-experiment-1").job
LOBE = 27.5 * cmath.exp(-1j * math.radians(3 * JOB.lobe_phase_deg))
HOLDS = HoldsFor(
    job="ring", job_sha256="a" * 64, machine="lathe", machine_sha256="b" * 64, simulated=False, strategy="cam"
)
INDEX = {"state": "free", "direction": "spindle", "start_mark": "spindle index"}


def nominal(n: int) -> complex:
    return cmath.rect(0.9 / n**0.3, -0.3 * n)


MODEL = CutPath(target=target_path(JOB), command=invert(target_path(JOB), nominal))


def part(
    harmonics: Mapping[int, complex],
    noise_um: float = 0.0,
    seed: int = 1,
    meta: Mapping[str, str] | None = None,
    extra: tuple[int, ...] = (),
    beside: tuple[int, ...] = (),
) -> PartHarmonics:
    """A part with these waves in spindle angle, measured from the index."""
    angle = np.arange(360.0)
    deviation = np.random.default_rng(seed).normal(0.0, noise_um, 360) if noise_um else np.zeros(360)
    for n, c in harmonics.items():
        deviation = deviation + np.real(c * np.exp(1j * n * np.radians(angle)))
    trace = Trace(angle_deg=angle, deviation_um=deviation, meta={**INDEX, **(meta or {})})
    return part_harmonics(trace, JOB, filter_upr=50.0, extra=extra, beside=beside)


def left(
    path: CutPath, share: float, true: complex, more: Mapping[int, complex] | None = None
) -> dict[int, complex]:
    """What an axis that makes `true` times its nominal response leaves on the part."""
    made = {w.lobes: true * nominal(w.lobes) * w.coefficient for w in fraction_of(path, share).command.harmonics}
    wants = {3: LOBE, **(more or {})}
    return {n: wants.get(n, 0j) - made.get(n, 0j) for n in {*made, *wants}}


def taught(
    cut: AppliedPath,
    measured: PartHarmonics,
    *,
    gain: float | None = None,
    scatter_um: float = 0.0,
    orders: tuple[int, ...] = (3, 6, 9),
    beside: tuple[int, ...] = (),
) -> LearningStep:
    number = 1 if cut.version is None else cut.version.version + 1
    return next_version(
        cut,
        measured,
        HOLDS,
        JOB,
        number=number,
        gain=gain,
        orders=orders,
        follows=lambda n: ToolResponse(response=nominal(n), spread=0.0),
        scatter_um=scatter_um,
        beside=beside,
        date="2001-11-30T14:05:00Z",
    )


def test_the_parts_get_better_by_what_two_of_them_foretell() -> None:
    """|1 - T'/T| with a gain of 1, |1 - 0.7 T'/T| with one of 0.7; the overtone goes with the lobe."""
    true = cmath.rect(0.85, math.radians(-12.0))
    cut, shrinks = AppliedPath(path=MODEL, fraction=1.0, version=None), []
    before = 27.5
    for gain in (1.0, 0.7, 0.7):
        harmonics = left(cut.path, 1.0, true, {6: 2.0 + 1j})
        step = taught(cut, part(harmonics, noise_um=1e-6), gain=gain)
        assert step.next.gain == gain
        assert step.contraction is not None
        assert step.contraction.arrives == pytest.approx(true, abs=1e-5)
        assert step.contraction.value == pytest.approx(abs(1 - gain * true), abs=1e-5)
        assert step.contraction.verdict is ImprovementVerdict.CONVERGES
        shrinks.append(abs(harmonics[3]) / before)
        before = abs(harmonics[3])
        cut = AppliedPath(path=step.next.path, fraction=1.0, version=step.next)
    assert shrinks == pytest.approx([abs(1 - true), abs(1 - true), abs(1 - 0.7 * true)], rel=1e-6)
    assert cut.path.target.overtones[0].lobes == 6
    assert [cut.version.version, cut.version.parent] == [3, 2] if cut.version else False


def test_half_of_the_compensation_tells_sign_and_angle() -> None:
    told = expect_residual(55.0, 0.5)
    assert (told.right_um_pp, told.wrong_um_pp) == (27.5, 82.5)
    half = AppliedPath(path=MODEL, fraction=0.5, version=None)
    right, wrong, late = (
        taught(half, part(left(MODEL, 0.5, true), noise_um=0.1))
        for true in (1.0, -1.0, cmath.exp(-1j * math.radians(3 * 10.0)))
    )
    assert [2 * step.next.part.lobe.amplitude_um for step in (right, wrong) if step.next.part] == (
        pytest.approx([27.5, 82.5], abs=0.1)
    )
    assert [problem.code for problem in right.reasons] == ["learned.nothing"], "it is as it was to be: go on"
    (problem,) = wrong.reasons
    assert (problem.code, problem.key) == ("learned.diverges", "--revert 0")
    assert late.contraction is not None
    assert -math.degrees(cmath.phase(late.contraction.arrives)) / 3 == pytest.approx(10.0, abs=0.1)
    # An axis that is late by 30 deg of the lobe: half a part teaches |1 - exp(-j 30 deg) / 2| of a whole one.
    axis = cmath.exp(-1j * math.radians(30.0))
    first, learned = (left(path, 1.0, axis)[3] for path in (MODEL, late.next.path))
    assert abs(learned) / abs(first) == pytest.approx(abs(1 - axis / 2), abs=0.01)


def test_only_what_stands_out_of_the_noise_is_learned() -> None:
    cut = AppliedPath(path=MODEL, fraction=1.0, version=None)
    sd_um = 1.0 * math.sqrt(2 / 360)
    step = taught(cut, part({3: 1.5j, 6: 0.5 * sd_um, 9: 12.0 * sd_um}, noise_um=1.0))
    assert step.learned == (3, 9)
    nothing = taught(cut, part({}, noise_um=1.0))
    assert (nothing.learned, [problem.code for problem in nothing.reasons]) == ((), ["learned.nothing"])
    assert nothing.next.path.target.harmonics[0].coefficient == pytest.approx(LOBE)


@pytest.mark.long
def test_a_fixed_gain_learns_half_of_the_noise_of_one_part() -> None:
    """gamma / (2 - gamma) of its variance: 0.54 at 0.7."""
    rng = np.random.default_rng(3)
    first = taught(AppliedPath(path=MODEL, fraction=1.0, version=None), part({3: 1.0 + 0j}, noise_um=1e-9)).next
    cut, off = AppliedPath(path=MODEL, fraction=1.0, version=first), []
    for _ in range(75):
        clamped = complex(rng.normal(), rng.normal())
        step = taught(cut, part({3: left(cut.path, 1.0, 1.0)[3] + clamped}, noise_um=1e-9), gain=0.7)
        cut = AppliedPath(path=step.next.path, fraction=1.0, version=first)
        off.append(abs(cut.path.target.harmonics[0].coefficient - LOBE) ** 2)
    assert np.mean(off) / 2 == pytest.approx(0.7 / 1.3, rel=0.3)


def test_what_clamping_scatters_is_no_divergence() -> None:
    first = taught(AppliedPath(path=MODEL, fraction=1.0, version=None), part({3: 1.0 + 0j}, noise_um=0.01)).next
    cut = AppliedPath(path=first.path, fraction=1.0, version=first)
    worse = part({3: 1.6 + 0j}, noise_um=0.01)
    known, unsure = taught(cut, worse), taught(cut, worse, scatter_um=1.4)
    assert [problem.code for problem in known.reasons] == ["learned.diverges"]
    assert unsure.reasons == ()
    assert unsure.contraction is not None
    assert unsure.contraction.verdict is ImprovementVerdict.UNCLEAR


@settings(max_examples=20, deadline=None)
@given(offset=st.integers(0, 359), against=st.booleans(), phase_deg=st.floats(0.0, 119.9))
def test_a_part_is_the_same_however_it_was_measured(offset: int, against: bool, phase_deg: float) -> None:
    """Measured from jaw 1, either way round, it has the waves that it has from the index."""
    job: Job = replace(JOB, lobe_phase_deg=37.0, assumed=())
    spindle = {3: cmath.rect(5.0, -math.radians(3 * phase_deg)), 6: 1.5 + 2j}
    angle = np.arange(360.0)
    at_spindle = (-1 if against else 1) * (angle - offset) + 37.0
    deviation = sum(np.real(c * np.exp(1j * n * np.radians(at_spindle))) for n, c in spindle.items())
    meta = {"state": "free", "direction": "ccw" if against else "cw", "jaw_1_deg": str(offset)}
    trace = Trace(angle_deg=angle, deviation_um=np.asarray(deviation), meta=meta)
    found = part_harmonics(trace, job, filter_upr=50.0)
    assert found.reasons == ()
    assert {n: found.coefficients_um[n] for n in spindle} == pytest.approx(spindle, abs=1e-9)
    crest = find_lobe(trace, job).phase_deg
    assert crest is not None
    assert cmath.exp(3j * math.radians(crest - phase_deg)) == pytest.approx(1.0, abs=1e-9)
    assert found.ront_um(spindle) == pytest.approx(0.0, abs=1e-9)


def test_the_oval_of_a_part_off_the_axis_of_the_gauge_is_not_of_the_part() -> None:
    """A circle of 26 mm, 500 um off at 40 deg, by rays: 2.4 um of second harmonic, of which nothing is left."""
    angle = np.arange(360.0)
    away = np.radians(angle - 40.0)
    seen = 500.0 * np.cos(away) + np.sqrt(26_000.0**2 - (500.0 * np.sin(away)) ** 2) - 26_000.0
    meta = {"state": "free", "direction": "spindle", "start_mark": "spindle index", "radius_mm": "26"}
    for true_um in (0.0, 1.5 - 0.7j):
        oval = np.real(true_um * np.exp(2j * np.radians(angle)))
        found = part_harmonics(Trace(angle_deg=angle, deviation_um=seen + oval, meta=meta), JOB, filter_upr=50.0)
        assert found.coefficients_um[2] == pytest.approx(true_um, abs=2e-3)


def test_a_part_without_a_place_on_the_spindle_teaches_nothing() -> None:
    assert JOB.lobe_phase_deg == 90.0 and "lobe_phase_deg" in JOB.assumed
    cut = AppliedPath(path=MODEL, fraction=1.0, version=None)
    for meta, code in (
        ({"start_mark": "unknown"}, "lobe.phase_unknown"),
        ({"start_mark": "jaw 1"}, "learned.jaw_assumed"),
        ({"state": "clamped"}, "lobe.not_free"),
    ):
        step = taught(cut, part({3: 3.0 + 0j}, 0.01, meta=meta))
        assert code in [problem.code for problem in step.reasons]
    with pytest.raises(ProfileError, match=r"learned\.gain"):
        taught(cut, part({3: 3.0 + 0j}), gain=1.5)


def test_waves_that_are_asked_for_are_learned_beside_the_lobe() -> None:
    """An oval and a fifth wave: what the second part keeps of them is what the axis makes too little of."""
    true, odd = 0.9 + 0j, {2: 2.0 - 1j, 5: 1.5j}
    orders, cut = (2, 3, 5, 6, 9), AppliedPath(path=MODEL, fraction=1.0, version=None)
    harmonics = left(cut.path, 1.0, true, odd)
    step = taught(cut, part(harmonics, noise_um=1e-6, extra=(5,)), orders=orders, gain=1.0)
    assert {2, 3, 5} <= set(step.learned)
    again = left(step.next.path, 1.0, true, odd)
    for n, c in odd.items():
        assert again[n] == pytest.approx(0.1 * c, abs=1e-5)
    assert 5 not in part(harmonics, noise_um=1e-6).coefficients_um


def test_the_next_part_is_expected_as_sure_as_two_clampings_and_the_trace_allow() -> None:
    """Peak to peak is twice an amplitude, whose variance has the trace and the clamping of either part in it."""
    cut = AppliedPath(path=MODEL, fraction=1.0, version=None)
    measured = part({3: 3.0 + 0j}, noise_um=1.0)
    trace_sd_um = 1.0 * math.sqrt(2 / 360)
    for scatter_um in (0.0, 0.4):
        step = taught(cut, measured, scatter_um=scatter_um)
        # A trace is off in both directions (chi-square of two), a force in the height alone (normal).
        half_um = math.sqrt((2.45 * trace_sd_um) ** 2 + 2.0 * (1.96 * scatter_um) ** 2)
        assert step.expected_half_width_um_pp == pytest.approx(2.0 * half_um, rel=0.1)
        # By the job's own lobe, from 27.5 um to 3: T'/T shares the same doubt.
        assert step.contraction is not None
        noise_um = math.sqrt(measured.sd_um[3] ** 2 + 2.0 * scatter_um**2)
        assert step.contraction.half_width == pytest.approx(2.45 * step.next.gain * noise_um / 27.5, rel=1e-6)


def test_a_version_comes_back_from_its_file_and_holds_for_its_job_alone() -> None:
    made = taught(
        AppliedPath(path=MODEL, fraction=0.5, version=None), part({3: 20 + 0j, 6: 1j}, noise_um=0.01)
    ).next
    table = json.loads(json.dumps(as_table(made)))
    assert from_table(table) == made
    changed = replace(HOLDS, job_sha256="c" * 64, strategy="pvt", settings={"overhang_mm": "40"})
    assert [p.code for p in differences(made, changed)] == ["learned.settings_changed", "learned.strategy"]
    assert differences(made, HOLDS) == ()


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("path", "command", "amplitude_um"), math.nan),
        (("path", "command", "amplitude_um"), "27.5"),
        (("path", "wanted", "mean_um"), True),
        (("holds_for", "simulated"), "false"),
        (("holds_for", "job_sha256"), 1),
        (("part", "ront_um"), math.inf),
        (("part", "share"), "0.5"),
        (("part", "version"), 2.7),
        (("gain",), True),
        (("version",), 1.0),
        (("date",), None),
    ],
)
def test_a_version_of_another_type_is_refused(keys: tuple[str, ...], value: object) -> None:
    made = taught(AppliedPath(path=MODEL, fraction=0.5, version=None), part({3: 20 + 0j}, noise_um=0.01)).next
    table = json.loads(json.dumps(as_table(made)))
    inner = table
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    with pytest.raises(ProfileError, match=r"learned\.file"):
        from_table(table)


def overtaken(path: CutPath, true: Mapping[int, complex], wants: Mapping[int, complex]) -> dict[int, complex]:
    """What an axis leaves that answers with another share of its nominal response at each wave."""
    made = {w.lobes: true[w.lobes] * nominal(w.lobes) * w.coefficient for w in path.command.harmonics}
    return {n: wants.get(n, 0j) - made.get(n, 0j) for n in true}


def test_an_overtone_that_the_axis_makes_too_much_of_is_no_lesson_but_with_a_smaller_gain() -> None:
    """Well at the lobe and 2.5 times too much of 9/rev, |1 - 0.7 (2.5 + 0.3j)| = 0.78: then 3.2 + 0.3j, 1.26."""
    for arrives, gain, factor, told in (
        (2.5 + 0.3j, 0.7, 0.7784, []),
        (3.2 + 0.3j, 0.7, 1.2576, ["learned.harmonic_frozen"]),
        (3.2 + 0.3j, 0.3, 0.0985, []),
    ):
        true, wants = {3: 0.9 + 0j, 6: 1 + 0j, 9: arrives}, {3: LOBE, 9: 4.0 + 1j}
        model = AppliedPath(path=MODEL, fraction=1.0, version=None)
        first = taught(model, part(overtaken(MODEL, true, wants), noise_um=0.01)).next
        assert set(taught(model, part(overtaken(MODEL, true, wants), noise_um=0.01)).contractions) == {3}
        cut = AppliedPath(path=first.path, fraction=1.0, version=first, parent=MODEL)
        step = taught(cut, part(overtaken(first.path, true, wants), noise_um=0.01), gain=gain)
        assert step.contractions[9].arrives == pytest.approx(arrives, abs=0.02)
        assert step.contractions[9].value == pytest.approx(factor, abs=0.02)
        assert [problem.code for problem in step.warnings] == told
        assert step.reasons == ()
        for problem in step.warnings:
            assert (problem.key, problem.value.startswith("1.2")) == ("9/rev", True)
            assert step.next.frozen == (9,)
            assert abs(coefficient_of(step.next.path.target, 9)) < 1e-9, "as before it was learned"
            assert 9 not in step.learned and 3 in step.learned


def test_an_overtone_is_judged_by_what_half_a_part_has_taught_too() -> None:
    """Half of the path was told, and 9/rev is learned whole. What lathes do not repeat is no divergence."""
    true, wants = {3: 1 + 0j, 6: 1 + 0j, 9: -0.5 + 0j}, {3: LOBE, 9: 4.0 + 0j}
    halved = left(MODEL, 0.5, 1.0) | {9: 4.0 + 0j}
    first = taught(AppliedPath(path=MODEL, fraction=0.5, version=None), part(halved, noise_um=0.01)).next
    cut = AppliedPath(path=first.path, fraction=1.0, version=first, parent=MODEL)
    worse = taught(cut, part(overtaken(first.path, true, wants), noise_um=0.01))
    assert worse.contractions[9].arrives == pytest.approx(-0.5, abs=0.02)
    assert [problem.code for problem in worse.warnings] == ["learned.harmonic_frozen"]
    small = taught(AppliedPath(path=MODEL, fraction=1.0, version=None), part({9: 0.05 + 0j}, noise_um=0.01)).next
    cut = AppliedPath(path=small.path, fraction=1.0, version=small, parent=MODEL)
    again = taught(cut, part({3: 0.05 + 0j, 9: 0.1 + 0j}, noise_um=0.01), scatter_um=0.5)
    assert again.contractions[9].verdict is ImprovementVerdict.UNCLEAR
    assert again.reasons == ()


def turned(path: CutPath, off_deg: float, arrives: complex, share: float = 1.0) -> PartHarmonics:
    """A part in the angles of its job, when jaw 1 was taken so many degrees off: its lobe stands that far on."""
    lobe = LOBE * cmath.exp(-3j * math.radians(off_deg))
    return part({3: lobe - share * arrives * path.target.harmonics[0].coefficient}, noise_um=0.05)


@pytest.mark.parametrize("held", [1.0, 0.82, 0.61], ids=["ideal", "3 N at 50 Hz", "3 N at 33 um"])
@pytest.mark.parametrize("off_deg", [25.0, -25.0])
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_part_with_jaw_1_taken_elsewhere_teaches_nothing(off_deg: float, held: float, share: float) -> None:
    """|1 - exp(-j 75 deg)| is 1.22: worse than no compensation, though clamping may scatter by more than that."""
    cut = AppliedPath(path=MODEL, fraction=share, version=None)
    step = taught(cut, turned(MODEL, off_deg, held, share), scatter_um=2.3)
    (problem,) = step.reasons
    assert (problem.code, problem.limit) == ("learned.worse", "55.0 um")
    # The tool is taken for one that does its path: 17 to 25 degrees of 25.
    assert 16.0 <= math.copysign(1.0, off_deg) * float(problem.key.split()[0]) <= 25.0


def test_a_lobe_that_is_only_elsewhere_is_a_warning_and_a_tool_that_is_held_back_none() -> None:
    cut = AppliedPath(path=MODEL, fraction=1.0, version=None)
    aside = taught(cut, turned(MODEL, 15.0, 1.0))
    assert ([p.code for p in aside.warnings], aside.reasons) == (["learned.lobe_elsewhere"], ())
    assert aside.warnings[0].value == "+15 deg"
    for arrives in (0.0, 0.85, 1.45, cmath.rect(0.8, math.radians(-20.0))):
        for size in (0.95, 1.06):
            lobe = {3: (size - arrives) * LOBE}
            said = taught(cut, part(lobe, noise_um=0.05), scatter_um=2.3)
            assert (said.warnings, said.reasons) == ((), ()), (arrives, size)


def test_what_has_no_lobe_or_one_of_a_model_is_not_made_worse() -> None:
    tiny = replace(JOB, lobe_error_um_pp=0.02)
    path = CutPath(target=target_path(tiny), command=target_path(tiny))
    found = compare_uncompensated(0.5j, 0.001, path.target.harmonics[0].coefficient, 1.0, tiny)
    assert (found.reasons(), found.warnings()) == ((), ())
    # A job that says 20 um of 55: what is left is larger than 20, and the part is better all the same.
    job = replace(JOB, lobe_error_source="model", lobe_error_um_pp=20.0)
    known, expected_um = 27.5 + 0j, target_path(job).harmonics[0].coefficient
    towards = expected_um / abs(expected_um)
    assert compare_uncompensated(known * towards - expected_um, 0.01, expected_um, 1.0, job).reasons() == ()
    aside = known * towards * cmath.exp(-3j * math.radians(59.0))
    assert compare_uncompensated(aside - expected_um, 0.01, expected_um, 1.0, job).reasons()


def test_a_version_without_what_may_be_missing_is_read_and_learned_from() -> None:
    wants = {6: 2.0 + 0j, 9: 4.0 + 1j}
    made = taught(
        AppliedPath(path=MODEL, fraction=1.0, version=None), part(left(MODEL, 1.0, 1.0, wants), noise_um=0.01)
    )
    table = json.loads(json.dumps(as_table(made.next)))
    assert table["schema"] == 1
    del table["frozen"], table["part"]["plain"]
    old = from_table(table)
    assert (old.path, old.part and old.part.lobe) == (made.next.path, made.next.part and made.next.part.lobe)
    cut = AppliedPath(path=old.path, fraction=1.0, version=old, parent=MODEL, history=(old,))
    again = taught(cut, part(left(old.path, 1.0, 0.9, wants), noise_um=0.01))
    assert again.contractions[9].arrives == pytest.approx(0.9, abs=0.08)
    with pytest.raises(ProfileError, match=r"schema\.unsupported"):
        from_table({**table, "schema": 2})


def test_an_oval_that_two_parts_show_is_learned_and_one_that_turns_is_not() -> None:
    """From traces alone: jaws bend each part alike, a blank each part at another angle."""
    for ovals, learned in (((3.0 + 1j, 3.1 + 1j), True), ((3.0 + 1j, -1.0 - 3j), False)):
        cut, history = AppliedPath(path=MODEL, fraction=1.0, version=None), []
        for oval in ovals:
            wants = {2: oval, 5: 0j}
            step = taught(cut, part(left(cut.path, 1.0, 0.95, wants), noise_um=0.02, beside=(2, 5)), beside=(2, 5))
            stands = {each.order: each.standing.value for each in step.certificate}
            history.append(step.next)
            cut = AppliedPath(
                path=step.next.path, fraction=1.0, version=step.next, parent=cut.path, history=tuple(history)
            )
            if len(history) == 1:
                assert stands[2] == "one_part"
        assert stands[2] == ("learned" if learned else "varies")
        assert stands[5] == "noise"
        assert abs(coefficient_of(cut.path.target, 2)) == pytest.approx(abs(ovals[1]) if learned else 0.0, abs=0.4)
