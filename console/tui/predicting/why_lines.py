"""Why the prediction is what it is: the contributions to its band, the limits of the speed, what is inverted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from console.session.learning.learning_steps import scatter_um
from console.session.stages import Stage
from console.session.work import Work
from console.text.band import band_reasons
from console.text.catalogue import Catalogue
from console.tui.lines import BLANK, NOTHING, Line, dim, hanging, line, ranged, wrapped
from console.tui.pages import preview_lines
from console.tui.theme import Token
from drivers.cutting.strategy import Strategy
from drivers.preview.band import predicted_band
from drivers.preview.outlook import Outlook
from drivers.preview.preview import Underway
from profiles.axis.envelope import highest_safe_speed
from profiles.axis.response import ServoResponse, Source
from profiles.compensations.next_version import half_width_um_pp
from profiles.files import printable
from profiles.forecast import LEAST_FORECAST_UM, forecast_um, is_below_forecast
from profiles.job import NO_LOBE, Job
from profiles.machine import MachineProfile

_VALUE_CELLS = 9
_NEXT_LIMITS = 2  # limits that are named beside the lowest


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimit:
    """The speed of the job and the limits of its machine for it, rpm; `binding` is the name of the lowest."""

    asked_rpm: float
    limits_rpm: Mapping[str, float]
    binding: str

    @property
    def highest_rpm(self) -> int:
        """The highest safe speed, rounded down."""
        return math.floor(self.limits_rpm[self.binding])

    @property
    def is_exceeded(self) -> bool:
        """Whether the job turns faster."""
        return self.asked_rpm > self.limits_rpm[self.binding]


class SpeedLimits:
    """Cache of the last limit, which takes some milliseconds; `of` is called whenever the page is painted."""

    def __init__(self) -> None:
        self._found: tuple[Job, MachineProfile, ServoResponse, SpeedLimit] | None = None

    def of(self, seen: Outlook) -> SpeedLimit:
        """Return the limits of a job on its machine, with the response that its cut inverts."""
        found, asked = self._found, (seen.job, seen.machine, seen.response)
        if found is None or any(a is not b for a, b in zip(found[:3], asked, strict=True)):
            limits, binding = highest_safe_speed(*asked)
            limit = SpeedLimit(asked_rpm=seen.job.spindle_speed_rpm, limits_rpm=limits, binding=binding)
            found = self._found = (*asked, limit)
        return found[3]


def speed_line(limit: SpeedLimit, text: Catalogue, width: int) -> Line:
    """Return the speed of the job against its highest safe one, and what limits that."""
    token = Token.WARNING if limit.is_exceeded else Token.TEXT
    value = f"{limit.asked_rpm:.0f} / {limit.highest_rpm} rpm"
    mark = "! " if limit.is_exceeded else ""
    words = f" {mark}{value} {text(f'speed_limit.{limit.binding}')}"
    return ranged(line(dim(text("preview_page.highest_speed"))), line((words, token)), width)


def why_lines(
    work: Work, seen: Underway, strategy: Strategy, limit: SpeedLimit, text: Catalogue, width: int
) -> list[Line]:
    """Return why the predicted residual is a band, what limits the speed, and what is inverted."""
    rows = [*_band_lines(work, seen, strategy, text, width), BLANK, *_speed_lines(limit, text, width)]
    return [*rows, BLANK, *_response_lines(seen.response, seen.job.lobe_frequency_hz, text, width)]


def span_of(work: Work, seen: Underway, strategy: Strategy) -> preview_lines.Span | None:
    """Return the limits of the remaining error: by the model, or by the part that a learned path is from."""
    if work.stage == Stage.AIR:
        return None
    if _is_learned(work):
        return _span_by_part(work, seen, strategy)
    band = predicted_band(seen, strategy)
    return None if band is None else (forecast_um(band.low_um), forecast_um(band.high_um))


def _is_learned(work: Work) -> bool:
    return work.compensation is not None and not work.compensation.is_model


def _span_by_part(work: Work, seen: Underway, strategy: Strategy) -> preview_lines.Span | None:
    """Return the limits by the confidence of the part's lobe and the scatter of two clampings; None if unknown."""
    told, part = preview_lines.by_part(seen, strategy), work.compensation.part if work.compensation else None
    if told is None or told.ront_um is None or part is None:
        return None
    half_um = half_width_um_pp(part.lobe_sd_um, scatter_um(seen.job, seen.machine))
    return forecast_um(told.ront_um - half_um), forecast_um(told.ront_um + half_um)


def _band_lines(work: Work, seen: Underway, strategy: Strategy, text: Catalogue, width: int) -> list[Line]:
    """Return the contributions to the band, largest first, or why there is no band."""
    if strategy not in seen.strategies and not _is_learned(work):
        return wrapped(text("preview_page.computing"), width, Token.DIM)
    span = span_of(work, seen, strategy)
    if span is None or seen.job.lobe_error_source == NO_LOBE:
        return wrapped(text("preview_page.no_band"), width, Token.DIM)
    low, high = (text.units.figure(each, "um", 1) for each in span)
    rows = wrapped(text("preview_page.why_band", low=low, high=high, strategy=strategy.value), width, Token.STRONG)
    found = sorted(_reasons(work, seen, strategy, text), key=lambda each: -1.0 if each[0] is None else each[0])
    for um, words in reversed(found):
        value = NOTHING if um is None else text.units.figure(um, "um", 2)
        rows += hanging(dim(f"{value:>{_VALUE_CELLS - 4}} {text.units.unit('um')} "), words, width)
    combined = "combined_learned" if _is_learned(work) else "combined"
    rows += wrapped(text(f"preview_page.{combined}"), width, Token.DIM)
    left_um = preview_lines.calculated_um(seen, strategy)
    if left_um is not None and is_below_forecast(left_um):
        left, least = (text.units.figure(each, "um", 2) for each in (left_um, LEAST_FORECAST_UM))
        rows += wrapped(text("preview_page.forecast", calculated=left, least=least), width)
    return rows


def _reasons(work: Work, seen: Underway, strategy: Strategy, text: Catalogue) -> list[tuple[float | None, str]]:
    """Return each contribution, um p-p (None is not known), in words."""
    part = work.compensation.part if work.compensation is not None and _is_learned(work) else None
    if part is not None:
        of_part = half_width_um_pp(part.lobe_sd_um, 0.0)
        of_clamping = half_width_um_pp(0.0, scatter_um(seen.job, seen.machine))
        return [(of_part, text("band.part")), (of_clamping, text("band.clampings"))]
    band = predicted_band(seen, strategy)
    if band is None:
        return []
    return [(um, words) for _, um, words in band_reasons(band, seen.response, text)]


def _speed_lines(limit: SpeedLimit, text: Catalogue, width: int) -> list[Line]:
    """Return the highest safe speed, what limits it, and what would limit it next."""
    rows = wrapped(
        text("preview_page.why_speed", rpm=limit.highest_rpm, limit=text(f"speed_limit.{limit.binding}")),
        width,
        Token.WARNING if limit.is_exceeded else Token.STRONG,
    )
    following = sorted(limit.limits_rpm.items(), key=lambda each: each[1])[1 : 1 + _NEXT_LIMITS]
    said = " · ".join(f"{rpm:.0f} rpm {text(f'speed_limit.{name}')}" for name, rpm in following)
    return [*rows, *wrapped(text("preview_page.next_limits", limits=said), width, Token.DIM)]


def _response_lines(response: ServoResponse, frequency_hz: float, text: Catalogue, width: int) -> list[Line]:
    """Return what the command inverts, and how well that is known."""
    percent = f"{100.0 * response.relative_95(frequency_hz):.1f}"
    if response.source is Source.MODEL:
        return wrapped(text("preview_page.inverts_model", percent=percent), width)
    facts = {
        "name": printable(response.name, 60),
        "low": f"{response.lowest_hz:g}",
        "high": f"{response.highest_hz:g}",
        "amplitude": text.units.figure(response.amplitude_um or 0.0, "um", 0),
        "percent": percent,
    }
    return wrapped(text("preview_page.inverts_identified", **facts), width)
