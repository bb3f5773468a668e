"""Text of the page Run during a cut: its progress, and how well the tool follows the target path."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from console.session.cut.telemetry import SpindleRipple
from console.session.station.progress import CutProgress, CutStage
from console.text.catalogue import Catalogue
from console.tui.lines import (
    BLANK,
    NOTHING,
    Line,
    dim,
    fact,
    justify_line,
    line,
    to_the_right,
    width_of,
    wrap_line,
)
from console.tui.plot.big_number import big_number
from console.tui.theme import Token
from profiles.job import Job

LABEL_WIDTH = 14
BEFORE_CUT = frozenset({CutStage.POSITION, CutStage.RUN_UP})  # stages before the cut of the part
BIN_DEG = 10.0  # bin width for averages in the polar plot: single samples are too few in a turn
Floats = NDArray[np.float64]


def progress_line(text: Catalogue, cut: CutProgress, width: int) -> Line:
    """Return turn, Z, time left, and a bar with the finished fraction; before the cut its stage."""
    turns, length = f"{cut.turns:.0f}", text.units.figure(cut.length_mm, "mm", 1)
    if cut.stage in BEFORE_CUT:
        stage = text(f"run_page.stage.{cut.stage}")
        coming = text("run_page.progress_before", stage=stage, turns=turns, length=length)
        return justify_line(line((coming, Token.STRONG)), BLANK, width)
    percent = f" {100.0 * cut.fraction:3.0f} %"
    turn, z, left = f"{cut.turn:.0f}", text.units.figure(cut.z_mm, "mm", 1), f"{cut.left_s:.0f}"
    head = text("run_page.progress", turn=turn, turns=turns, z=z, length=length, left=left)
    words = line((head, Token.STRONG))
    room = width - width_of(words) - len(percent) - 2
    return justify_line(words, line(bar(cut.fraction, min(max(room, 0), 40)), percent), width)


def bar(fraction: float, cells: int) -> str:
    """Return a bar of so many cells; it is full only when all is done."""
    full = int(min(max(fraction, 0.0), 1.0) * cells)
    return "■" * full + "□" * (cells - full)


def values_title(text: Catalogue, age_s: float | None) -> str:
    """Return the title of the live values, with their greatest age in tenths of a second."""
    if age_s is None:
        return text("run_page.values")
    return text("run_page.values_age", age=f"{max(math.ceil(10.0 * age_s), 1) / 10.0:.1f}")


def live_lines(text: Catalogue, cut: CutProgress, job: Job | None, width: int) -> list[Line]:
    """Return the live values. Only in the part is there a target path for the tool."""
    in_part = cut.judged and cut.stage is CutStage.CUT
    has_peak = cut.judged and cut.stage not in BEFORE_CUT
    target_mm = cut.tool_radius_mm + cut.tool_error_um / 1000.0
    speed_rpm = cut.speed_rpm
    lobe_hz = NOTHING if job is None or speed_rpm is None else f"{job.jaws * speed_rpm / 60.0:.1f} Hz"

    def row(key: str, value: str) -> Line:
        return fact(text(f"run_page.live.{key}"), value, width, label_width=LABEL_WIDTH)

    stage = text("run_page.holding") if cut.holding else text(f"run_page.stage.{cut.stage}")
    if cut.hold.asked and cut.stage is CutStage.CUT and not cut.holding:
        stage = text("run_page.hold_asked")
    not_judged = wrap_line(text("run_page.not_judged"), width, Token.DIM)
    return [
        fact(text("run_page.live.stage"), stage, width, label_width=LABEL_WIDTH, token=Token.STRONG),
        row("speed", NOTHING if speed_rpm is None else f"{speed_rpm:z.0f} rpm"),
        row("ripple", _ripple(cut.ripple)),
        row("lobe", lobe_hz),
        row("tool", f"R {text.units.show(cut.tool_radius_mm, 'mm', 4)}"),
        row("wanted", f"R {text.units.show(target_mm, 'mm', 4)}" if in_part else NOTHING),
        row("error", text.units.show(cut.tool_error_um, "um", 2, "+z") if in_part else NOTHING),
        row("peak", text.units.show(cut.tool_error_peak_um, "um", 2) if has_peak else NOTHING),
        row("following", text.units.show(cut.following_error_um, "um", 2, "+z")),
        *(_together_lines(text, cut, width) if cut.judged else [BLANK, *not_judged]),
    ]


def large_lines(text: Catalogue, cut: CutProgress, width: int) -> list[Line]:
    """Return time left, speed and tool error in large digits, to be read from the machine."""
    in_part = cut.judged and cut.stage is CutStage.CUT
    numbers = (
        ("run_page.large.left", NOTHING if cut.stage in BEFORE_CUT else f"{cut.left_s:.0f}", "s"),
        ("run_page.live.speed", NOTHING if cut.speed_rpm is None else f"{cut.speed_rpm:z.0f}", "rpm"),
        (
            "run_page.live.error",
            text.units.figure(cut.tool_error_um, "um", 1, "+z") if in_part else NOTHING,
            text.units.unit("um"),
        ),
    )
    rows = [row for key, number, unit in numbers for row in (BLANK, *big_number(number, text(key), unit, width))]
    return rows[1:]


def _ripple(ripple: SpindleRipple | None) -> str:
    """Format the ripple with its bound; one that may be zero is only given as less than a value."""
    if ripple is None:
        return NOTHING
    if ripple.percent <= ripple.within_percent:
        return f"< {ripple.percent + ripple.within_percent:.2f} %"
    return f"{ripple.percent:.2f} ± {ripple.within_percent:.2f} %"


def _together_lines(text: Catalogue, cut: CutProgress, width: int) -> list[Line]:
    shown = NOTHING if cut.synchronisation is None else text(f"frame.sync.{cut.synchronisation}")
    value, token = (f"! {shown}", Token.WARNING) if cut.is_lost else (shown, Token.STRONG)
    together = fact(text("run_page.live.sync"), value, width, label_width=LABEL_WIDTH, token=token)
    return [together, *phase_lines(text, cut, width)]


def phase_lines(text: Catalogue, cut: CutProgress, width: int) -> list[Line]:
    """Return the phase error of the spindle with its limit, and a scale of both."""
    phase_deg, limit_deg = cut.lag_deg, cut.phase_limit_deg
    shown = text("run_page.no_phase") if phase_deg is None else f"{phase_deg:+z.2f} °"
    fraction, within, token = None, 0.0, Token.DIM
    if phase_deg is not None and limit_deg is not None:
        fraction, token = phase_deg / limit_deg, Token.TEXT
        within = 0.0 if cut.phase is None else cut.phase.within_deg / limit_deg
        if cut.in_phase is False:
            shown, token = f"! {text('run_page.out_of_phase')} {shown}", Token.WARNING
    return [
        fact(text("run_page.live.phase"), shown, width, label_width=LABEL_WIDTH, token=token),
        line((to_the_right(gauge(fraction, width - 2, within), width), token)),
        line(dim(to_the_right(_phase_limit(text, cut), width))),
    ]


SHOWN_LAG_DEG = 0.05
"""From where on the lag that learning counts on is shown: below, it is 0 in the digits that are shown."""


def _phase_limit(text: Catalogue, cut: CutProgress) -> str:
    if cut.phase_limit_deg is None:
        return text("run_page.no_limit")
    limit, expected = f"{cut.phase_limit_deg:.2f}°", cut.expected_lag
    if max(map(abs, expected)) >= SHOWN_LAG_DEG:
        learned = " … ".join(f"{lag_deg:+.1f}" for lag_deg in dict.fromkeys(expected))
        return text("run_page.limit_learned", limit=limit, learned=learned)
    if cut.phase is None:
        return text("run_page.limit", limit=limit)
    return text("run_page.limit_known", limit=limit, within=f"{cut.phase.within_deg:.2f}°")


def gauge(fraction: float | None, cells: int, within: float = 0.0) -> str:
    """Return a scale from -limit to +limit with a needle at this fraction of the limit; beyond it an arrow.

    On either side of the needle the scale is double as far as its uncertainty `within` reaches.
    """
    half = max((cells - 3) // 2, 1)
    scale = list("├" + "─" * half + "┼" + "─" * half + "┤")
    if fraction is None:
        return "".join(scale)
    needle, reach = half + 1 + round(fraction * half), round(within * half)
    for cell in range(max(needle - reach, 1), min(needle + reach, 2 * half + 1) + 1):
        scale[cell] = "╪" if cell == half + 1 else "═"
    if abs(fraction) > 1.0:
        scale[0 if fraction < 0 else -1] = "◀" if fraction < 0 else "▶"
    else:
        scale[needle] = "●"
    return "".join(scale)


def mean_error_um(cut: CutProgress) -> tuple[Floats, Floats]:
    """Return the mean tool error by spindle angle: centres of the filled bins, deg, and um (infeed positive)."""
    bins = np.floor(cut.angles_deg / BIN_DEG).astype(int)
    seen = np.unique(bins)
    means = np.array([cut.errors_um[bins == each].mean() for each in seen], dtype=np.float64)
    return (seen + 0.5) * BIN_DEG, means
