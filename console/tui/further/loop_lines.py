"""Text of the loop on the page Tune: its gains, its margins beside what is usual, the responses kept of it.

The loop as numbers comes first: its response and margins, and the responses kept of it.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.cells import cell_len

from console.session.data.identified_responses import responses_of
from console.session.tuning.known_loop import MOST_RESPONSES
from console.session.tuning.standing_trial import differing_words
from console.text.catalogue import Catalogue
from console.tui.lines import Line, dim, fit_text, hanging, line, wrap_line
from console.tui.rows import list_rows
from console.tui.theme import Token
from drivers.commissioning.checked_configuration import differing_settings
from drivers.identification.result import IdentifiedResponse, unfit_problems
from drivers.identification.tool_gains import ToolLoop
from profiles.arrays import Complexes, Floats, complexes, floats
from profiles.axis.margins import (
    LEAST_GAIN_MARGIN,
    LEAST_PHASE_MARGIN_DEG,
    MOST_SENSITIVITY,
    LoopMargins,
    loop_margins,
)
from profiles.axis.sampled_loop import loop_of
from profiles.axis.servo_gains import PidGains, gains_from_variables, shown_names
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.paper.table_5 import FREQUENCIES_HZ, PHASE_ERROR_RAD, measured_gains
from profiles.problem import Problem

LABEL_WIDTH = 18
VALUE_WIDTH = 26
NONE = "–"
DATE = len("2001-11-30 14:05")
PAPER_MACHINE = "lee-2001-lathe"  # the machine of Table 5
LOWEST_HZ, POINTS = 1.0, 300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResponseCurve:
    """A response at frequencies in Hz; a lag is a negative phase."""

    hz: Floats
    gain_db: Floats
    phase_deg: Floats

    @classmethod
    def from_response(cls, hz: Floats, response: Complexes) -> ResponseCurve:
        """Return the curve of a complex response, its phase continuous."""
        gain_db = 20.0 * np.log10(np.maximum(np.abs(response), 1e-12))
        return cls(hz=hz, gain_db=floats(gain_db), phase_deg=floats(np.degrees(np.unwrap(np.angle(response)))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenResponse:
    """A kept response: its points, and why it is not one of the loop that was read; or why it cannot be read."""

    file: Path
    found: IdentifiedResponse | None
    curve: ResponseCurve | None
    problems: tuple[Problem, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopFacts:
    """The loop with the gains that were read, or with those of the profile where `read` is None.

    `differing` are the variables in which the two differ: what the profile has, what was read.
    """

    read: ToolLoop | None
    gains: PidGains
    period_ms: float
    margins: LoopMargins
    model: ResponseCurve
    responses: tuple[SeenResponse, ...]
    paper: ResponseCurve | None
    differing: Mapping[str, tuple[float, float]]


def loop_facts(machine: MachineProfile, read: ToolLoop | None, data: Path, *, simulated: bool) -> LoopFacts:
    """Return everything that is shown of the loop; ProfileError where the profile lacks a gain."""
    here = machine if read is None else read.apply_to(machine)
    loop = loop_of(here)
    hz = floats(np.geomspace(LOWEST_HZ, 0.98 * loop.nyquist_hz, POINTS))
    return LoopFacts(
        read=read,
        gains=gains_from_variables(here),
        period_ms=here.controller.servo_period_ms,
        margins=loop_margins(loop),
        model=ResponseCurve.from_response(hz, loop.closed_loop(hz)),
        responses=tuple(_seen(data, here, simulated=simulated)),
        paper=paper_curve() if machine.name == PAPER_MACHINE else None,
        differing=differing_settings(machine, {} if read is None else read.gains),
    )


def paper_curve() -> ResponseCurve:
    """Return Table 5 as points: a loss of the peak-to-peak value, the reading that a simple loop can produce."""
    gain_db = 20.0 * np.log10(measured_gains())
    return ResponseCurve(
        hz=floats(FREQUENCIES_HZ), gain_db=floats(gain_db), phase_deg=floats(-np.degrees(PHASE_ERROR_RAD))
    )


def _seen(data: Path, machine: MachineProfile, *, simulated: bool) -> Iterator[SeenResponse]:
    for kept in responses_of(data, machine.name, MOST_RESPONSES):
        found, problems, curve = kept.response, kept.problems, None
        if found is not None:
            problems = unfit_problems(found, machine, found.path, simulated=simulated)
            points = sorted(found.points, key=lambda point: point.frequency_hz)
            phasors = complexes([cmath.rect(point.gain, math.radians(point.phase_deg)) for point in points])
            curve = ResponseCurve.from_response(floats([point.frequency_hz for point in points]), phasors)
        yield SeenResponse(file=kept.file, found=found, curve=curve, problems=problems)


def loop_lines(facts: LoopFacts, text: Catalogue, width: int) -> list[Line]:
    """Return margins first, then the gains and what they are from."""
    lines = margin_lines(facts.margins, facts.period_ms, text, width)
    lines += warning_lines(facts, text, width)
    return lines + gain_lines(facts, text, width)


def margin_lines(margins: LoopMargins, period_ms: float, text: Catalogue, width: int) -> list[Line]:
    """Return the margins, one a row, beside the values that are usual; an unstable loop has none."""
    if not margins.stable:
        return wrap_line(text("tune_page.unstable"), width, Token.ALARM)
    gain, phase, sensitivity = margins.gain_margin, margins.phase_margin_deg, margins.sensitivity_peak
    delay = NONE
    if margins.delay_margin_ms is not None:
        cycles = text("tune_page.cycles", count=f"{margins.delay_margin_ms / period_ms:.1f}")
        delay = f"{margins.delay_margin_ms:.2f} ms, {cycles}"
    wide = NONE if margins.bandwidth_hz is None else f"{margins.bandwidth_hz:.1f} Hz"
    rows: list[tuple[str, str, str, bool]] = [
        (
            "gain_margin",
            NONE if gain is None else f"{gain:.2f} ({_db(gain)}) @ {margins.gain_margin_hz:.0f} Hz",
            f">= {LEAST_GAIN_MARGIN:g}",
            gain is not None and gain < LEAST_GAIN_MARGIN,
        ),
        (
            "phase_margin",
            NONE if phase is None else f"{phase:.1f}° @ {margins.crossover_hz:.1f} Hz",
            f">= {LEAST_PHASE_MARGIN_DEG:g}°",
            phase is not None and phase < LEAST_PHASE_MARGIN_DEG,
        ),
        ("delay_margin", delay, "", False),
        (
            "sensitivity",
            f"{sensitivity:.2f} @ {margins.sensitivity_peak_hz:.0f} Hz",
            f"<= {MOST_SENSITIVITY:g}",
            sensitivity > MOST_SENSITIVITY,
        ),
        ("bandwidth", wide, "", False),
        ("peak", f"{margins.peak:.3f} ({_db(margins.peak)}) @ {margins.peak_hz:.1f} Hz", "", False),
    ]
    if margins.gain_reduction is not None:
        rows.insert(
            1, ("gain_reduction", f"{margins.gain_reduction:.3g} ({_db(margins.gain_reduction)})", "", False)
        )
    return [_row(text(f"tune_page.{key}"), value, usual, text, width, bad=bad) for key, value, usual, bad in rows]


def _row(label: str, value: str, usual: str, text: Catalogue, width: int, *, bad: bool) -> Line:
    mark = ("! ", Token.WARNING) if bad else dim("  ")
    shown = (fit_text(value, VALUE_WIDTH), Token.WARNING if bad else Token.TEXT)
    room = max(width - 2 - LABEL_WIDTH - VALUE_WIDTH, 0)
    return (
        mark,
        dim(fit_text(label, LABEL_WIDTH)),
        shown,
        dim(fit_text(usual and text("tune_page.usual", limit=usual), room)),
    )


def gain_lines(facts: LoopFacts, text: Catalogue, width: int) -> list[Line]:
    """Return the gains in V/m, and as the controller has them."""
    gains = facts.gains.at_rest
    rows = [
        ("kp", f"{gains.kp_v_per_m:.5g} V/m"),
        ("ki", f"{gains.ki_v_per_m_s:.4g} V/(m s)"),
        ("kd", f"{gains.kd_v_s_per_m:.4g} V s/m"),
        ("kvff", f"{gains.velocity_feedforward_v_s_per_m:.4g} V s/m"),
        ("kaff", f"{gains.acceleration_feedforward_v_s2_per_m:.4g} V s2/m"),
        ("period", f"{facts.period_ms:.4f} ms"),
    ]
    lines: list[Line] = []
    if facts.read is not None:
        read = facts.read.gains
        lines += _pack_items([f"{name} {read[name]:.11g}" for name in shown_names(read)], width, Token.TEXT)
    lines += _pack_items([f"{text(f'tune_page.{key}')} {value}" for key, value in rows], width, Token.DIM)
    return lines + (hanging(dim("  "), text("tune_page.metric"), width, Token.DIM) if text.units.is_inch else [])


def _pack_items(items: Sequence[str], width: int, token: Token) -> list[Line]:
    """Return items side by side, as many in a row as fit; none is broken."""
    rows: list[str] = []
    for item in items:
        longer = f"{rows[-1]}   {item}" if rows else item
        if rows and cell_len(longer) <= width - 2:
            rows[-1] = longer
        else:
            rows.append(item)
    return [line(dim("  "), (row, token)) for row in rows]


def warning_lines(facts: LoopFacts, text: Catalogue, width: int) -> list[Line]:
    """Return where the gains are from where they were not read, and what the model does not have."""
    lines: list[Line] = []
    if facts.read is None:
        lines += hanging(("! ", Token.WARNING), text("tune_page.not_read"), width)
        return lines
    if facts.differing:
        names = differing_words(facts.differing)
        lines += hanging(("! ", Token.WARNING), text("tune_page.differing", names=names), width)
    if facts.read.unmodelled_settings:
        names = ", ".join(facts.read.unmodelled_settings)
        lines += hanging(("! ", Token.WARNING), text("tune_page.unmodelled", names=names), width)
    return lines


def response_lines(
    responses: Sequence[SeenResponse], selected: int, text: Catalogue, width: int, height: int
) -> list[Line]:
    """Return the kept responses, newest first, the selected one marked, in rows of one line."""
    if not responses:
        return wrap_line(text("tune_page.no_responses"), width, Token.DIM)
    words = (fit_text(_response_words(seen, text), max(width - 2, 0)) for seen in responses)
    tokens = (Token.DIM if seen.problems else Token.TEXT for seen in responses)
    return list_rows([*zip(words, tokens, strict=True)], selected, height)


def _response_words(seen: SeenResponse, text: Catalogue) -> str:
    found = seen.found
    if found is None:
        return f"{printable(seen.file.name, 40)}  {text('tune_page.unreadable')}"
    date = printable(found.date.replace("T", " ")[:DATE])
    points = found.points
    band = NONE
    if points:
        low, high = (pick(point.frequency_hz for point in points) for pick in (min, max))
        band = f"{low:g}…{high:g} Hz, {text.units.show(max(point.amplitude_um for point in points), 'um', 0)}"
    fits = text("tune_page.fits") if not seen.problems else text("tune_page.other", key=_first_key(seen))
    return f"{date}  {found.path:<8} {band}  {fits}"


def _first_key(seen: SeenResponse) -> str:
    keys = list(dict.fromkeys(problem.key for problem in seen.problems))
    return ", ".join(keys[:2]) + (" …" if len(keys) > 2 else "")


def reason_lines(seen: SeenResponse, text: Catalogue, width: int) -> list[Line]:
    """Return in full why a response is not one of this loop."""
    return [row for problem in seen.problems for row in hanging(("· ", Token.DIM), text.problem(problem), width)]


def heading(facts: LoopFacts, text: Catalogue) -> str:
    """Return what the loop is from."""
    return text("tune_page.loop_profile") if facts.read is None else text("tune_page.loop_read", at=facts.read.at)


def legend(facts: LoopFacts, seen: SeenResponse | None, text: Catalogue) -> Line:
    """Return what is drawn in the plots."""
    pieces: list[tuple[str, Token]] = [("── ", Token.AFTER), (text("tune_page.model"), Token.TEXT)]
    if seen is not None and seen.curve is not None:
        pieces += [("   • ", Token.BEFORE), (text("tune_page.identified"), Token.TEXT)]
    if facts.paper is not None:
        pieces += [("   ✗ ", Token.MARK), (text("tune_page.table_5"), Token.TEXT)]
    return line(*pieces)


def _db(factor: float) -> str:
    return f"{20.0 * math.log10(factor):+.1f} dB"
