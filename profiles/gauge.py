"""The gauge: what its file states of the errors of a roundness or form gauge, from which an uncertainty follows.

Plain values and their limits. A gauge file is TOML as a job's. An amount is stated either as the expanded
uncertainty of a figure (k = 2, of a calibration certificate: it holds all errors of the gauge), or as what it is
made of (`profiles.metrology.uncertainty`). An amount that a file does not state is unknown, not 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import date
from typing import Any

from profiles.fields import Field, FieldType, flatten, read_fields, schema_problem, spell_toml
from profiles.metrology.conformity import DecisionRule
from profiles.problem import Problem, ProfileError

DATES = ("calibrated", "valid_until")


@dataclass(frozen=True, slots=True, kw_only=True)
class GaugeProfile:
    """A gauge, as its maker, its calibration or its owner states it; None is not stated.

    `roundness_u_um`, `cylindricity_u_um`, `diameter_u_um`: expanded uncertainties (k = 2) of RONt, CYLt and a mean
    diameter as a whole. Otherwise the errors: `spindle_error_um`, the largest amplitude (half of peak to valley)
    of the spindle's radial error, of unknown phase, at `spindle_error_upr` undulations or, without, at some low
    order; `probe_noise_um`, standard deviation of a single reading; `probe_gain_percent`, limit of the error of
    the amplification; `repeat_um`, standard deviation of RONt when the part is put on again; `eccentricity_um`,
    the most by which a part may be off the axis where its radius is not known; `filter_cutoff_percent`, limit of
    the error of the cut-off; `column_error_um`, limit of a section's shift across the axis; `set_up_angle_deg`,
    standard deviation of the angle of the start mark; `size_error_um`, limit of the error of a diameter;
    `temperature_off_k`, the most that part and gauge are off 20 degC or from each other. `expired`: it was loaded
    after the last day of its validity, which its file does not know.
    """

    name: str
    source: str = ""
    serial_number: str = ""
    calibrated: str = ""
    valid_until: str = ""
    decision_rule: str = DecisionRule.ISO_2017
    roundness_u_um: float | None = None
    cylindricity_u_um: float | None = None
    diameter_u_um: float | None = None
    spindle_error_um: float | None = None
    spindle_error_upr: int | None = None
    probe_noise_um: float | None = None
    probe_gain_percent: float | None = None
    repeat_um: float | None = None
    eccentricity_um: float | None = None
    filter_cutoff_percent: float | None = None
    column_error_um: float | None = None
    set_up_angle_deg: float | None = None
    size_error_um: float | None = None
    temperature_off_k: float | None = None
    schema: int = 1
    expired: bool = False

    @property
    def rule(self) -> DecisionRule:
        """How its figures are judged against a limit."""
        return DecisionRule(self.decision_rule)

    def on(self, day: str) -> GaugeProfile:
        """Return it as it is on a day (ISO 8601): expired or not."""
        return replace(self, expired=bool(self.valid_until) and day > self.valid_until)


def _amount(key: str, table: str, unit: str, at_most: float) -> Field:
    return Field(key=key, table=table, unit=unit, at_least=0, at_most=at_most, optional=True)


GAUGE_FIELDS: tuple[Field, ...] = (
    Field(key="schema", kind=FieldType.WHOLE, default=1, at_least=1, at_most=1),
    Field(key="name", kind=FieldType.TEXT),
    Field(key="source", kind=FieldType.TEXT, default=""),
    Field(key="serial_number", kind=FieldType.TEXT, default=""),
    *(Field(key=key, kind=FieldType.TEXT, default="") for key in DATES),
    Field(
        key="decision_rule", kind=FieldType.CHOICE, choices=tuple(DecisionRule), default=str(DecisionRule.ISO_2017)
    ),
    _amount("roundness_u_um", "certificate", "um", 1000),
    _amount("cylindricity_u_um", "certificate", "um", 1000),
    _amount("diameter_u_um", "certificate", "um", 1000),
    _amount("spindle_error_um", "spindle", "um", 1000),
    Field(key="spindle_error_upr", kind=FieldType.WHOLE, table="spindle", at_least=2, at_most=100, optional=True),
    _amount("probe_noise_um", "probe", "um", 100),
    _amount("probe_gain_percent", "probe", "%", 50),
    _amount("filter_cutoff_percent", "probe", "%", 50),
    _amount("repeat_um", "set_up", "um", 100),
    _amount("eccentricity_um", "set_up", "um", 1000),
    _amount("set_up_angle_deg", "set_up", "deg", 45),
    _amount("column_error_um", "column", "um", 1000),
    _amount("size_error_um", "size", "um", 1000),
    _amount("temperature_off_k", "size", "K", 50),
)
"""Every key of a gauge with its limits, in the order in which a file shows them."""


def gauge_from_table(table: Mapping[str, Any], *, where: str = "") -> GaugeProfile:
    """Return the gauge in a TOML table. Raises `ProfileError` with every problem; `where` is its file."""
    leaves, problems = flatten(table, where=where)
    if refusal := schema_problem(leaves, where=where):
        raise ProfileError(refusal)
    values, found = read_fields(GAUGE_FIELDS, leaves, where=where)
    if problems or found:
        raise ProfileError(*problems, *found)
    if undated := [each for key in DATES if (each := _date_problem(key, values[key], where))]:
        raise ProfileError(*undated)
    return GaugeProfile(**values)


def _date_problem(key: str, value: str, where: str) -> Problem | None:
    with suppress(ValueError):
        if not value or date.fromisoformat(value).isoformat() == value:
            return None
    return Problem(code="gauge.no_date", where=where, key=key, value=spell_toml(value), limit="2026-03-31")
