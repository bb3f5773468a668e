"""Calibrations: of the lobe, of the wrench, and the tables that they are read from."""

from __future__ import annotations

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from profiles.calibration.lobe import FoundLobe, find_lobe, with_lobe
from profiles.calibration.table import CalibrationKind, column_name, parse_table
from profiles.calibration.wrench import WrenchFit, fit_wrench
from profiles.chucking.diagnosis import Mechanism
from profiles.job import Job
from profiles.lobe.lobe_conditions import find_missing_conditions
from profiles.problem import ProfileError
from profiles.store import load_job
from profiles.strict_values import record
from profiles.traces import Trace

ASSUMED = load_job("lee-2001-experiment-1").job
"""Its jaw 1 stands at 90 deg, which is assumed."""
JOB = replace(ASSUMED, assumed=())
ANGLE = np.arange(720) / 2.0
INDEX = {"direction": "spindle", "start_mark": "spindle index"}
ROUND = {**INDEX, "units_checked": "yes"}  # as round as no lathe turns
SIMULATED = {**INDEX, "simulated": "yes", "strategy": "none"}


def found(phase_deg: float, meta: dict[str, str], job: Job = JOB, amplitude: float = 27.5) -> FoundLobe:
    deviation = amplitude * np.cos(3 * np.radians(ANGLE - phase_deg)) + 3.0 * np.cos(np.radians(ANGLE))
    noise = np.random.default_rng(1).normal(0.0, 0.02, ANGLE.size)
    return find_lobe(Trace(angle_deg=ANGLE, deviation_um=deviation + noise, meta=meta), job)


def codes(lobe: FoundLobe) -> list[str]:
    return [problem.code for problem in lobe.reasons]


@pytest.mark.parametrize(
    ("phase_deg", "meta", "expected", "past"),
    [
        (92.0, INDEX, 92.0, 2.0),
        (212.0, INDEX, 92.0, 2.0),
        (33.0, INDEX, 33.0, -57.0),
        (268.0, {**INDEX, "direction": "ccw"}, 92.0, 2.0),
        (2.0, {"direction": "cw", "jaw_1_deg": "0"}, 92.0, 2.0),
        (15.0, {"direction": "ccw", "jaw_1_deg": "20"}, 95.0, 5.0),
        (72.0, {**INDEX, "jaw_1_deg": "70"}, 72.0, 2.0),
    ],
)
def test_a_phase_is_of_its_spindle(phase_deg: float, meta: dict[str, str], expected: float, past: float) -> None:
    lobe = found(phase_deg, meta)
    assert (lobe.phase_deg, lobe.past_jaw_deg) == pytest.approx((expected, past), abs=0.01)
    assert codes(lobe) == []


def test_sizes_are_told_to_what_a_gauge_resolves() -> None:
    """A trace without any scatter has a confidence limit of some nanometres, and digits of those mean nothing."""
    (problem,) = found(92.0, ROUND, amplitude=0.0).reasons
    assert (problem.code, problem.limit) == ("lobe.not_significant", "< 0.01 um")


def test_a_trace_of_unknown_phase_has_an_amplitude_only() -> None:
    direction = "# direction: spindle | cw | ccw"
    mark = "# start_mark: spindle index | jaw 1 (or # jaw_1_deg: NUMBER)"
    metas: tuple[tuple[dict[str, str], str], ...] = (
        ({}, f"{direction}, {mark}"),
        ({"direction": "cw"}, mark),
        ({"direction": "cw", "start_mark": "unknown"}, mark),
        ({"jaw_1_deg": "0"}, direction),
        ({"start_mark": "jaw 1"}, direction),
        ({"start_mark": "spindle index"}, direction),
    )
    for meta, missing in metas:
        lobe = found(92.0, meta)
        assert (codes(lobe), lobe.phase_deg) == (["lobe.phase_unknown"], None)
        assert lobe.reasons[0].limit == missing
        assert lobe.fit.error_um_pp == pytest.approx(55.0, abs=0.02)
        with pytest.raises(ValueError):
            with_lobe(JOB, lobe, chuck="", tool="")


@pytest.mark.parametrize(("radius_mm", "size"), [(17.4, "absolute"), (51.8, "absolute"), (17.4, "relative")])
def test_a_trace_of_a_part_of_another_size_is_not_of_this_job(radius_mm: float, size: str) -> None:
    """A smaller part, or a diameter in place of a radius."""
    (told,) = found(92.0, {**INDEX, "radius_mm": str(radius_mm), "size": size}).reasons
    code = "lobe.diameter_stated" if radius_mm == 51.8 else "lobe.other_size"
    assert (told.code, told.key) == (code, "radius_mm")
    assert told.limit == f"{JOB.finished_radius_mm:.3f} mm"


def test_a_trace_is_compared_with_the_job_and_other_reasons_are_named() -> None:
    assert codes(found(92.0, {**INDEX, "radius_mm": f"{JOB.finished_radius_mm + 0.4}"})) == []
    assert codes(found(92.0, {**INDEX, "state": "clamped"})) == ["lobe.not_free"]
    assert codes(found(92.0, {**INDEX, "method": "v_block"})) == ["lobe.method"]
    assert codes(found(92.0, ROUND, amplitude=0.0)) == ["lobe.not_significant"]
    filtered = found(92.0, {**INDEX, "filter_upr": "15"})
    assert [(problem.code, problem.value) for problem in filtered.warnings] == [("lobe.filtered", "2.7 %")]


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ({"strategy": "none", "compensation": "none", "stage": "full"}, None),
        ({"strategy": "cam", "compensation": "none", "stage": "full"}, "lobe.compensated"),
        ({"compensation": "3"}, "lobe.compensated"),
        ({"simulated": "yes", "strategy": "none"}, "lobe.simulated"),
    ],
)
def test_only_an_uncompensated_part_that_somebody_cut_has_the_lobe(said: dict[str, str], code: str | None) -> None:
    lobe = found(92.0, {**INDEX, **said})
    assert codes(lobe) == ([code] if code else [])
    assert lobe.fit.error_um_pp == pytest.approx(55.0, abs=0.02)


def test_the_source_of_a_job_says_that_its_lobe_is_for_practice() -> None:
    simulated = Trace(angle_deg=ANGLE, deviation_um=27.5 * np.cos(3 * np.radians(ANGLE)), meta=SIMULATED)
    job = replace(JOB, source="Table 6; Fig 14")
    practice = find_lobe(simulated, job, practice=True)
    for _ in range(2):
        job = with_lobe(job, practice, chuck="", tool="")
        assert job.source == "Table 6; Fig 14; lobe of a simulated part, for practice"
    assert with_lobe(job, found(92.0, INDEX), chuck="", tool="").source == "Table 6; Fig 14"


@pytest.mark.parametrize(
    ("past_deg", "wall_mm", "mechanism"),
    [
        (5.0, 2.5, Mechanism.SPRING_BACK),
        (60.0, 2.5, Mechanism.WALL),
        (30.0, 2.5, None),
        (0.0, 26.0, Mechanism.CONTACT),
    ],
)
def test_where_it_is_high_says_what_made_it(past_deg: float, wall_mm: float, mechanism: Mechanism | None) -> None:
    seen = found(90.0 + past_deg, INDEX, replace(JOB, wall_thickness_mm=wall_mm)).diagnosis
    assert seen is not None and seen.mechanism is mechanism
    assert found(90.0, INDEX, ASSUMED).diagnosis is None  # nobody knows where jaw 1 was


def test_the_job_gets_the_lobe_with_its_conditions_and_what_was_assumed_stays_so() -> None:
    job = with_lobe(JOB, found(92.0, INDEX), chuck="3-jaw 160", tool="")
    assert (job.lobe_error_um_pp, job.lobe_phase_deg) == pytest.approx((55.0, 92.0), abs=0.02)
    assert (job.lobe_error_source, job.lobe_chuck, job.lobe_tool) == ("fitted", "3-jaw 160", None)
    assert job.jaw_1_deg == pytest.approx(90.0)
    assert find_missing_conditions(job) == ("lobe_tool",)  # the machine has no name for its tool
    again = with_lobe(job, found(92.0, INDEX, job), chuck="3-jaw 160", tool="")
    assert again.jaw_1_deg == pytest.approx(90.0)  # calibrated twice, jaw 1 has not moved
    by_index = with_lobe(ASSUMED, found(92.0, INDEX, ASSUMED), chuck="", tool="")
    assert {"lobe_force_n", "chucking_force_n"} <= set(by_index.assumed)
    assert not {"lobe_phase_deg", "lobe_spindle_speed_rpm", "lobe_error_um_pp"} & set(by_index.assumed)
    assert by_index.lobe_past_jaw_deg is None  # nobody knows where jaw 1 was
    later = found(92.0, INDEX, by_index)
    assert later.past_jaw_deg is None
    by_jaw = with_lobe(ASSUMED, found(2.0, {"direction": "cw", "jaw_1_deg": "0"}, ASSUMED), chuck="", tool="")
    assert "lobe_phase_deg" in by_jaw.assumed and by_jaw.lobe_past_jaw_deg == pytest.approx(2.0, abs=0.01)


def test_where_a_part_sits_is_told_of_two_jaws() -> None:
    """Off the axis by 500 um a ring of 52 mm shows two waves a turn of 4.8 um, which is no lobe of two jaws."""
    job = replace(JOB, jaws=2)
    for e, told in ((500.0, ["lobe.off_axis"]), (50.0, [])):
        deviation = 27.5 * np.cos(2 * np.radians(ANGLE)) + e * np.cos(np.radians(ANGLE))
        off_axis = find_lobe(Trace(angle_deg=ANGLE, deviation_um=deviation, meta=INDEX), job)
        assert [problem.code for problem in off_axis.warnings] == told


# A table of measurements as a spreadsheet exports it, and what is refused of one, with its line.

PLAIN = "torque_n_m,force_n\n10,3700\n20.5,7400\n"


def refused(text: str | bytes, kind: CalibrationKind | None = None) -> list[tuple[str, str, str]]:
    with pytest.raises(ProfileError) as caught:
        parse_table(text.encode() if isinstance(text, str) else text, kind, where="t.csv")
    return [
        (problem.code.removeprefix("calibration."), problem.where, problem.key)
        for problem in caught.value.problems
    ]


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        "\ufeff" + PLAIN.replace("\n", "\r\n"),
        "Torque (N·m);Force [N];remark\n10;3700;\n\n20,5;7400;second pull\n;;\n",
        "note\tForce N\ttorque Nm\n1\t3700\t10\n2\t7400\t20,5\n",
        '# bench: 2\n# free words\n"torque_n_m","force_n"\n"10","3700"\n# later\n20.5,7.4e3,,\n',
    ],
)
def test_what_a_spreadsheet_writes_is_read(text: str) -> None:
    table = parse_table(text.encode())
    assert table.kind is CalibrationKind.WRENCH
    assert table.columns["torque_n_m"].tolist() == [10.0, 20.5]
    assert table.columns["force_n"].tolist() == [3700.0, 7400.0]


def test_headings_and_lines_are_read_as_a_spreadsheet_writes_them() -> None:
    text = "# Jaws: 3\nTorque (N m)\tForce (N)\tby\n10\t3700\tme\n"
    table = parse_table(text.encode("utf-16"))
    assert (dict(table.meta), table.ignored, table.lines) == ({"jaws": "3"}, ("by",), (3,))
    names = ("Deflection (µm)", "Angle [°]", "Chucking force, N", "torque Nm")
    assert [column_name(name) for name in names] == "deflection_um angle_deg chucking_force_n torque_n_m".split()


def test_wrong_rows_are_named_with_their_lines_and_a_spoilt_file_once() -> None:
    text = 'torque_n_m,force_n\n10,3700\n-5,100\n1_0,100\n5\n7,nan\n8,"1,5"\n'
    assert refused(text) == [
        ("out_of_range", "t.csv:3", "torque_n_m"),
        ("not_number", "t.csv:4", "torque_n_m"),
        ("cells", "t.csv:5", ""),
        ("not_number", "t.csv:6", "force_n"),
        ("not_number", "t.csv:7", "force_n"),
    ]
    assert refused("torque_n_m;force_n\n10,5;3700\n20.5;1\n") == [("mixed_decimals", "t.csv:3", "torque_n_m")]
    assert refused("torque,force\n1,2\n") == [("columns", "t.csv:1", "")]
    assert refused("torque_n_m,force_n,force_n\n1,2,3\n") == [("columns", "t.csv:1", "")]
    assert refused("") == [("empty", "t.csv", "")]
    assert refused(PLAIN, CalibrationKind.DEFLECTION) == [("columns", "t.csv:1", "")]
    assert refused(PLAIN.encode() + b"\xb5") == [("not_text", "t.csv:4", "")]
    assert refused("# a: 1\n# a: 2\n" + PLAIN) == [("meta", "t.csv:2", "")]
    assert len(refused("torque_n_m,force_n\n" + "x,1\n" * 100)) == 20
    with pytest.raises(ProfileError) as caught:
        parse_table(b"torque_n_m;force_n\n" + b"10;1000\n" * 10_001, where="t.csv")
    (problem,) = caught.value.problems
    assert (problem.code, problem.where) == ("calibration.too_large", "t.csv:10002")
    assert (problem.value, problem.limit) == ("> 10000 rows", "<= 10000 rows")


# Force by torque: the line, its confidence and the way back, against repeated experiments.

Floats = NDArray[np.float64]

TORQUE = np.repeat([10.0, 20.0, 30.0, 40.0, 50.0], 3)
SLOPE = 2 * math.pi * 0.12 * 4 / 0.008
"""Scroll chuck: 2 pi eta i / p with eta 0.12, i 4, p 8 mm: 50 N m give 18.8 kN."""


def wrench_refused(torque: object, force: object) -> tuple[str, str]:
    with pytest.raises(ProfileError) as caught:
        fit_wrench(torque, force)  # type: ignore[arg-type]
    return caught.value.problems[0].code, caught.value.problems[0].key


def test_the_line_is_surer_than_the_next_clamping_and_its_scatter_is_a_share() -> None:
    """Through the origin at one torque T: the line is +- t s T / sqrt(sum T^2) where the scatter is the same."""
    from scipy.stats import t as student_t

    torque = np.array([10.0, 20.0, 20.0, 30.0, 40.0])
    force = 100.0 * torque + np.array([30.0, -20.0, 10.0, -40.0, 25.0])
    slope = float(torque @ force) / float(torque @ torque)
    sd = math.sqrt(float(np.sum((force - slope * torque) ** 2)) / 4)
    half = float(student_t.ppf(0.975, 4)) * sd * 20.0 / math.sqrt(float(torque @ torque))
    fit = fit_wrench(torque, force)
    same = replace(
        fit,
        slope_n_per_n_m=slope,
        sd_n=sd,
        covariance=(0.0, 0.0, 1.0 / float(torque @ torque)),
        growing=0.0,
        as_likely=(),
    )
    band = same.line_n(20.0)
    assert (band.value - band.low, band.high - band.value) == pytest.approx((half, half))
    assert half < same.force_n(20.0).high - band.value
    assert fit.line_n(20.0).low <= band.low and band.high <= fit.line_n(20.0).high, "five clampings tell little"
    assert fit.force_sd_percent == pytest.approx(100.0 * fit.sd_n / (25.0 * fit.slope_n_per_n_m))


def test_a_scroll_chuck_is_a_line_through_the_origin_there_and_back() -> None:
    fit = fit_wrench(TORQUE, SLOPE * TORQUE)
    assert fit.force_n(50.0).value == pytest.approx(18850, rel=1e-4)
    assert fit.torque_n_m(18849.0).value == pytest.approx(50.0, rel=1e-4)
    assert (fit.outliers, fit.misses, fit.intercept_n) == ((), False, 0.0)
    fit = noisy(1)
    force = fit.force_n(30.0)
    assert fit.torque_n_m(force.high).low == pytest.approx(30.0, rel=1e-9)
    assert fit.torque_n_m(force.low).high == pytest.approx(30.0, rel=1e-9)


@pytest.mark.parametrize(
    ("affine", "grows", "torque"),
    [(False, False, TORQUE), (False, True, TORQUE[::2]), (True, False, TORQUE[::2]), (True, True, TORQUE)],
)
@pytest.mark.first(1)
def test_the_bands_hold_what_they_promise(affine: bool, grows: bool, torque: Floats) -> None:
    """250 calibrations: 95 % hold the slope, and the force and the torque of the next clamping anywhere.

    The scatter of a gauge is 400 N everywhere, that of friction 5 % of the force; which, nobody says.
    """
    rng, offset = np.random.default_rng(6), 900.0 if affine else 0.0

    def clamped(at: Floats) -> Floats:
        sd = 0.05 * SLOPE * at if grows else np.full_like(at, 400.0)
        return np.asarray(offset + SLOPE * at + sd * rng.normal(0.0, 1.0, at.size))

    held = []
    for _ in range(250):
        fit = fit_wrench(torque, clamped(torque), affine=affine)
        held.append([abs(fit.slope_n_per_n_m - SLOPE) < fit.slope_ci])
        for place in (12.0, 35.0, 48.0):
            next_n = float(clamped(np.array([place]))[0])
            line, band = fit.line_n(place), fit.force_n(place)
            held[-1] += [line.low < offset + SLOPE * place < line.high, band.low < next_n < band.high]
            if place == 35.0:
                back = fit.torque_n_m(next_n)
                held[-1].append(back.low < place < back.high)
    shares = np.mean(held, axis=0)
    assert shares.min() > 0.905, "95 %, less three sd of a share of 250"
    assert shares.mean() < 0.985, "and not by being far wider than need be"


@pytest.mark.parametrize("grows", [False, True])
@pytest.mark.long
def test_chance_alone_is_rarely_taken_for_a_bend_or_an_outlier(grows: bool) -> None:
    rng, sd = np.random.default_rng(7), 0.05 * SLOPE * TORQUE if grows else np.full_like(TORQUE, 400.0)
    fits = [fit_wrench(TORQUE, SLOPE * TORQUE + sd * rng.normal(0.0, 1.0, TORQUE.size)) for _ in range(300)]
    met = np.mean([[fit.misses, bool(fit.outliers)] for fit in fits], axis=0)
    assert met == pytest.approx([0.05, 0.05], abs=0.038)  # three sd of a share of 300


def test_a_clamping_that_stands_off_is_kept_and_equal_scatter_is_read() -> None:
    kept = asdict(noisy(2))
    old = {key: value for key, value in kept.items() if key not in ("growing", "as_likely")}
    assert record(WrenchFit, old).growing == 0.0
    assert record(WrenchFit, kept) == noisy(2)
    force = SLOPE * TORQUE + np.random.default_rng(5).normal(0.0, 300.0, 15)
    force[7] -= 3000.0
    fit = fit_wrench(TORQUE, force)
    assert (fit.outliers, fit.points) == ((7,), 15)
    # By rounding it may miss less than the means themselves, which is no number of a chance.
    torque_n_m = np.repeat([10.0, 20.0, 30.0, 40.0], 3)
    fit = fit_wrench(torque_n_m, 200.0 * torque_n_m + np.tile([-400.0, 0.0, 400.0], 4))
    assert fit.lack_of_fit_chance == pytest.approx(1.0) and not fit.misses


def noisy(seed: int, bent: float = 0.0, repeated: bool = True) -> WrenchFit:
    torque = TORQUE if repeated else np.linspace(10.0, 50.0, 15)
    noise = np.random.default_rng(seed).normal(0.0, 300.0, 15)
    return fit_wrench(torque, SLOPE * torque * (1 - bent * torque) + noise)


@pytest.mark.parametrize("repeated", [True, False])
def test_a_chuck_that_sticks_is_no_line(repeated: bool) -> None:
    assert not noisy(3, repeated=repeated).misses
    assert noisy(3, bent=0.005, repeated=repeated).misses


def test_what_gives_no_line_is_refused() -> None:
    assert wrench_refused([10.0, 20.0, 30.0], [1.0, 2.0, 3.0])[0] == "calibration.few_points"
    assert wrench_refused([20.0] * 6, [1.0] * 6) == ("calibration.alike", "torque_n_m")
    assert wrench_refused([1.0, 2.0, 3.0, 0.0], [1.0] * 4) == ("calibration.not_positive", "torque_n_m")
    assert wrench_refused([1.0, 2.0, 3.0, 4.0], [1.0, 2.0, math.nan, 1.0]) == (
        "calibration.not_positive",
        "force_n",
    )
    assert wrench_refused([10.0, 20.0, 30.0, 40.0], [9000.0, 10.0, 1.0, 1.0])[0] == "calibration.no_slope"
    with pytest.raises(ProfileError) as caught:
        noisy(1).force_n(80.0)
    assert (caught.value.problems[0].code, caught.value.problems[0].limit) == (
        "calibration.outside",
        "10 … 50 N m",
    )
