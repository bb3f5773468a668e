"""Validate a stopping-performance record: of this machine at this link, complete, plausible, and recent."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import date

from drivers.commissioning.stop_numbers import number_problems
from drivers.commissioning.stop_record import StopRecord, needed_stops
from drivers.link.address import without_options
from drivers.link.base import StopWay
from profiles.files import printable
from profiles.machine import MachineProfile
from profiles.problem import Problem

VALID_DAYS = 180
"""Validity of a record: drives, brakes and friction change. Half a year is a usual inspection interval."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopsNow:
    """What a record must match: this machine with the settings of `key` (`stop_key`), today.

    `stop_way` is the path of a stop now. `address` is that of the link; None for a simulated machine,
    which is measured on a copy of itself.
    """

    machine: MachineProfile
    key: str
    today: date
    stop_way: StopWay
    address: str | None


def record_problems(record: StopRecord | None, now: StopsNow) -> tuple[Problem, ...]:
    """Return why a record does not permit arming.

    It is missing; of another machine, link or settings; too old or dated in the future; incomplete; or contains
    stops that this machine cannot have made.
    """
    if record is None:
        return (Problem(code="stops.no_record"),)
    return (*_of_another(record, now), *_of_other_times(record, now), *_measured(record, now))


def _of_another(record: StopRecord, now: StopsNow) -> Iterator[Problem]:
    name = now.machine.name
    if record.machine != name:
        yield Problem(code="stops.other_machine", key=name, value=printable(record.machine, 60), limit=name)
    if now.address is not None and without_options(record.address) != without_options(now.address):
        value = printable(record.address, 60)
        yield Problem(code="stops.other_address", key=name, value=value, limit=now.address)


def _of_other_times(record: StopRecord, now: StopsNow) -> Iterator[Problem]:
    measured_at, age_days = record.measured_at.isoformat(), (now.today - record.measured_at).days
    if age_days < 0:
        yield Problem(code="stops.in_future", value=measured_at, limit=now.today.isoformat())
    elif age_days > VALID_DAYS:
        yield Problem(code="stops.expired", value=measured_at, limit=f"<= {VALID_DAYS} d")
    if record.key != now.key:
        yield Problem(code="stops.other_settings", value=record.key[:12], limit=now.key[:12])
    if now.stop_way not in (record.stop_way, StopWay.LOST):
        yield Problem(code="stops.other_way", value=record.stop_way, limit=now.stop_way)


def _measured(record: StopRecord, now: StopsNow) -> Iterator[Problem]:
    missing = needed_stops(now.machine) - {(entry.way, entry.origin, entry.axis) for entry in record.entries}
    if missing:
        yield Problem(code="stops.incomplete", value=", ".join(sorted(" ".join(each) for each in missing)))
    yield from number_problems(record.entries, now.machine)
