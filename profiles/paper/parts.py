"""Eqs 4 to 11 without 9, Prog. 1, Table 6, Figs 14 and 16: the parts before and after, and what was left."""

from __future__ import annotations

from functools import partial

import numpy as np

from profiles.arrays import floats
from profiles.compensations.path import compensated_depth_um, removed_depth_um, spindle_speed_rpm
from profiles.paper.causes_left import FULL_BLEND, cause_records, models
from profiles.paper.conditions import equation_records, table_6_records
from profiles.paper.experiments import Experiments
from profiles.paper.record import Basis, Curve, Figure, Record, Section
from profiles.paper.residual import (
    SINE,
    Ramps,
    fundamental_fraction,
    left_um,
    stroke_fraction,
    zigzag,
)
from profiles.roundness import evaluate

_TURN_DEG = np.arange(0.0, 360.0, 0.5)
_PHASE = np.radians(3 * _TURN_DEG)

_put_in = partial(Record, tolerance=1e-9, basis=Basis.CONSTRUCTION, why="put_in")
"""A record whose numbers come from the paper itself."""


def section(paper: Experiments) -> Section:
    """Return the comparison of the trajectories and of the parts."""
    return Section(
        "parts",
        (
            *_path(paper),
            *equation_records(),
            *_prog_1(paper),
            *table_6_records(paper),
            *_fig_14(paper),
            *cause_records(paper),
        ),
        (_figure_prog_1(paper), *_figures_14_and_16(paper)),
    )


def _path(paper: Experiments) -> tuple[Record, ...]:
    first, second = paper.jobs
    deepest = compensated_depth_um(_TURN_DEG, a0_um=100.0, a1_um=27.5)
    return (
        _put_in("eq4.speed", spindle_speed_rpm(50.0, 3), "rpm", expected=1000.0),
        _put_in("eq7.amplitude", first.lobe_amplitude_um, "um", expected=27.5, at="1"),
        _put_in("eq7.amplitude", second.lobe_amplitude_um, "um", expected=16.5, at="2"),
        _put_in("eq11.deepest", float(deepest.max()), "um", expected=127.5),
        _put_in("prog1.counts", first.lobe_error_um_pp / paper.machine.tool.count_um, "cts", expected=275.0),
    )


def _prog_1(paper: Experiments) -> tuple[Record, ...]:
    error_um = paper.errors_um_pp[0]
    stroke = partial(Record, "prog1.stroke", unit="um", expected=error_um, why="stroke")
    ramps = {"s_curve": (Ramps.S_CURVE, FULL_BLEND), "linear": (Ramps.LINEAR, FULL_BLEND)}
    blends = ramps | {"triangle": (Ramps.LINEAR, 0.0)}
    mean = partial(Record, "prog1.mean", unit="um", why="mean")
    depths_um = [1000 * job.depth_of_cut_mm for job in paper.jobs]
    return (
        *(stroke(error_um * stroke_fraction(*each), at=name) for name, each in ramps.items()),
        *(
            Record("prog1.fundamental", 100 * fundamental_fraction(zigzag(*each)), "%", at=name)
            for name, each in blends.items()
        ),
        *(
            mean(depth_um + error / 2, at=f"{number}", expected=depth_um)
            for number, (depth_um, error) in enumerate(zip(depths_um, paper.errors_um_pp, strict=True), start=1)
        ),
    )


def _fig_14(paper: Experiments) -> tuple[Record, ...]:
    records = []
    for number, (job, error) in enumerate(zip(paper.jobs, paper.errors_um_pp, strict=True), start=1):
        removed = removed_depth_um(_TURN_DEG, a0_um=1000 * job.depth_of_cut_mm, a1_um=job.lobe_amplitude_um)
        round_um = evaluate(_TURN_DEG, -removed, None).ront_um
        records.append(_put_in("fig14.ront", round_um, "um", expected=error, at=f"{number}", tolerance=0.01))
    return tuple(records)


def _figure_prog_1(paper: Experiments) -> Figure:
    error_um = paper.errors_um_pp[0]
    paths = {"wanted": dict(SINE), "s_curve": zigzag(Ramps.S_CURVE, 1.0), "linear": zigzag(Ramps.LINEAR, 1.0)}
    curves = []
    for name, harmonics in paths.items():
        each_um = [error_um * fraction * np.cos(k * _PHASE) for k, fraction in harmonics.items()]
        curves.append(Curve(name, _TURN_DEG, floats(np.sum(each_um, axis=0))))
    return Figure("prog1", "deg", "um", tuple(curves))


def _figures_14_and_16(paper: Experiments) -> tuple[Figure, ...]:
    model, figures = models(paper)["s_curve_measured"], []
    for number, error in enumerate(paper.errors_um_pp, start=1):
        before = Curve("before", _TURN_DEG, error / 2 * np.cos(_PHASE))
        after = Curve("after", _TURN_DEG, left_um(error, *model, _PHASE))
        figures.append(Figure("fig16", "deg", "um", (before, after), at=f"{number}"))
    return tuple(figures)
