"""Trials of gains on disk: one file each, written before the first gain is, and closed when it is over."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from console.session.data.kept_files import folder_name, keep, numbered_files, read_kept_values, utc_now
from console.session.operator import operator_name
from drivers.identification.tool_gains import matches
from drivers.link.address import without_options
from profiles.axis.notch import is_coefficient
from profiles.axis.sampled_loop import AxisPlant, FlexibleMode
from profiles.axis.servo_gains import is_filter, stated_settings
from profiles.files import printable, write_atomically
from profiles.machine import MachineProfile
from profiles.strict_values import read_own

FOLDER, SCHEMA = "trials", 1
MOST_SETTING = 8_388_607  # 24 bits with their sign: what a controller can have
BEGUN, APPLIED, ENDED_EARLY = "begun", "applied", "ended_early"
REVERTING, REVERTED, ADOPTED, RESTORED = "reverting", "reverted", "adopted", "restored"
_NUMBER = re.compile(r"trial-(\d{6})\.json")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialEvent:
    """What was done or found, when (UTC), by whom, with the gains that were read; none where they were not."""

    date: str
    what: str
    by: str
    found: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRecord:
    """One trial: gains `before`, as read, and `proposed`, with their margins; `open` until it is over.

    `axis` is the one of those margins, as `values_of` writes it; {} is that of the profile.

    `address` is that of the link, without options; a simulated machine has none that lasts.
    """

    machine: str
    simulated: bool
    address: str
    version: str
    kind: str
    before: Mapping[str, float]
    proposed: Mapping[str, float]
    margins: Mapping[str, float]
    open: bool
    events: tuple[TrialEvent, ...]
    axis: Mapping[str, float] = field(default_factory=dict)

    def complete(self, names: Sequence[str]) -> TrialRecord:
        """Return the record with these names; one of gains alone had no notch filter, before and after."""
        if not set(self.before) <= set(names) or any(
            not is_filter(name) for name in set(names) - set(self.before)
        ):
            return self
        before, proposed = ({name: each.get(name, 0.0) for name in names} for each in (self.before, self.proposed))
        return replace(self, before=before, proposed=proposed)

    def add_event(self, what: str, found: Mapping[str, float], *, over: bool = False) -> TrialRecord:
        """Return the record with one more event, and closed where the trial is over."""
        event = TrialEvent(date=utc_now(), what=what, by=operator_name(), found=dict(found))
        return replace(self, events=(*self.events, event), open=self.open and not over)


MODE_FIGURES, MODE_SUFFIXES = ("hz", "damping_ratio", "fraction"), ("", "_2", "_3")


def values_of(plant: AxisPlant) -> dict[str, float]:
    """Return an axis as values for a file."""
    values = {
        "acceleration_per_v": plant.acceleration_per_v,
        "damping_per_s": plant.damping_per_s,
        "delay_s": plant.delay_s,
        "lag_s": plant.lag_s,
    }
    for suffix, mode in zip(MODE_SUFFIXES, plant.modes, strict=False):
        values |= {f"mode_{name}{suffix}": getattr(mode, name) for name in MODE_FIGURES}
    return values


def plant_of(values: Mapping[str, float]) -> AxisPlant | None:
    """Return the axis that `values_of` has written; None for {}."""
    if not values:
        return None
    rigid = {name: values[name] for name in ("acceleration_per_v", "damping_per_s", "delay_s")}
    modes = tuple(
        FlexibleMode(**{name: values[f"mode_{name}{suffix}"] for name in MODE_FIGURES})
        for suffix in MODE_SUFFIXES
        if f"mode_hz{suffix}" in values
    )
    return AxisPlant(**rigid, lag_s=values.get("lag_s", 0.0), modes=modes)


def file_of_new(data: Path, machine: str) -> Path:
    """Return the file for the next trial of a machine."""
    folder = data / FOLDER / folder_name(machine)
    newest = max((number for number, _ in numbered_files(folder, _NUMBER)), default=0)
    return folder / f"trial-{newest + 1:06d}.json"


def write_new(file: Path, record: TrialRecord) -> None:
    """Write the record of a new trial. Raises ProfileError: `file.exists`, `file.not_writable`."""
    keep(file, {"schema": SCHEMA, **asdict(record)})


def write_again(file: Path, record: TrialRecord) -> None:
    """Write the record of a trial with what has happened since. Raises ProfileError: `file.not_writable`."""
    content = json.dumps({"schema": SCHEMA, **asdict(record)}, ensure_ascii=False, allow_nan=False, indent=2)
    write_atomically(file, f"{content}\n".encode(), overwrite=True, private=True)


def open_trial(data: Path, machine: str, address: str, *, simulated: bool) -> tuple[Path, TrialRecord] | None:
    """Return the newest trial of this machine at this address that is not over.

    Raises ProfileError: `trial.file`, `schema.unsupported`, `file.unreadable`.
    """
    folder = data / FOLDER / folder_name(machine)
    for _, file in numbered_files(folder, _NUMBER):
        record = read(file)
        here = simulated or record.address == without_options(address)
        if record.machine == machine and record.simulated == simulated and here:
            return (file, record) if record.open else None
    return None


def read(file: Path) -> TrialRecord:
    """Read one file. Raises ProfileError: `trial.file`, `schema.unsupported`, `file.unreadable`."""
    table, where = read_kept_values(file, "trial.file"), printable(str(file))
    return read_own(TrialRecord, table, schema=SCHEMA, code="trial.file", where=where, judge=_judge)


def _judge(record: TrialRecord) -> None:
    """Refuse what are not the same gains before and after; what is written from it has to be one."""
    if not record.before or tuple(record.before) != tuple(record.proposed):
        raise ValueError(f"{', '.join(record.before)} | {', '.join(record.proposed)}")
    for name, value in (*record.before.items(), *record.proposed.items()):
        whole = float(value).is_integer() and abs(value) <= MOST_SETTING
        if not (is_coefficient(value) if is_filter(name) else whole):
            raise ValueError(f"{value:g}")
    if record.axis:
        try:
            plant = plant_of(record.axis)
        except KeyError as error:
            raise ValueError(f"axis {error}") from error
        if plant is None or plant.acceleration_per_v <= 0.0 or plant.damping_per_s < 0.0 or plant.delay_s < 0.0:
            raise ValueError("axis")


def ended_by(machine: MachineProfile, trial: TrialRecord, found: Mapping[str, float]) -> str:
    """Return the event that ends a trial with the gains that were found, "" where it goes on.

    `adopted` is that the profile has the proposed ones: those have to be proven in air first. With others of the
    profile, as `controller apply` writes them, nothing of the trial is left; a filter among them is proven as any
    of a profile (`console.session.tuning.air_proof`).
    """
    if matches(found, trial.before):
        return RESTORED
    if matches(stated_settings(machine), found):
        return ADOPTED if matches(found, trial.proposed) else RESTORED
    return ""
