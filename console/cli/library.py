"""Loading what the arguments name: data folder, job, machine. A file raises `ProfileError` with every problem."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from console.cli.arguments import DEFAULT_PLANT
from console.session.data.kept_files import (
    data_folder,
    gauges_folder,
    jobs_folder,
    machines_folder,
    refuse_closed,
    utc_now,
)
from console.session.errors import SessionError
from drivers.link.address import LinkAddress, SimulatedAddress, parse_address
from drivers.simulator.plant.which_lathe import ONE_LOBE_PLANTS, with_one_lobe
from profiles.gauge import GaugeProfile
from profiles.machine import MachineProfile, real_machine_problems
from profiles.problem import Problem, ProfileError, refusal_error
from profiles.store import LoadedJob, LoadedMachine, load_gauge, load_job, load_machine

Loaded = TypeVar("Loaded", bound=LoadedMachine)

if TYPE_CHECKING:
    from console.session.cut.simulated_parts import LatheParts
    from console.session.data.calibrated_chuck import CalibratedMachine
    from console.text.catalogue import Catalogue
    from drivers.simulator.plant.true_parameters import TrueParameters
    from profiles.metrology.uncertainty import KnownGauge

DEFAULT_MACHINE = "lee-2001-lathe"
SIM_OPTION, SIM_LINK = "--sim", "--link sim:"
"""Options that lead to a simulated machine; a command has one of them, or both."""


def data_of(options: Namespace) -> Path:
    """Return the data folder of this call; `data.closed` where this account may not read it."""
    folder = data_folder(options.data)
    refuse_closed(folder)
    return folder


def job_of(options: Namespace) -> LoadedJob:
    """Load the job named on the command line."""
    return load_job(options.job, jobs_folder(data_of(options)))


def gauge_of(options: Namespace) -> GaugeProfile | None:
    """Load the gauge named on the command line, with the rule asked for there; None where none is named.

    Raises `ProfileError` also for a rule without a gauge: `gauge.none_named`.
    """
    if options.gauge is None:
        if options.accept is not None:
            raise refusal_error("gauge.none_named", key="--accept", value=options.accept, limit="--gauge NAME")
        return None
    gauge = load_gauge(options.gauge, gauges_folder(data_of(options))).on(utc_now()[:10])
    return gauge if options.accept is None else replace(gauge, decision_rule=options.accept)


def known_gauge_of(options: Namespace, lathe: str) -> KnownGauge | None:
    """Return the gauge named on the command line with its own error, `lathe` names a simulated lathe.

    Raises ProfileError: as `gauge_of` and `known_gauge`.
    """
    from console.session.learning.gauge_errors import known_gauge

    gauge = gauge_of(options)
    return None if gauge is None else known_gauge(data_of(options), gauge, lathe)


def profile_of(options: Namespace) -> LoadedMachine:
    """Load the machine named on the command line, for reading and calculating only."""
    return load_machine(options.machine or DEFAULT_MACHINE, machines_folder(data_of(options)))


def machine_of(options: Namespace, simulated_by: str = f"{SIM_OPTION} | {SIM_LINK}") -> LoadedMachine:
    """Load the machine named on the command line, for a command that moves it; as `refuse_unsigned`."""
    loaded = profile_of(options)
    if not isinstance(link_address(options, loaded), SimulatedAddress):
        refuse_unsigned(loaded.machine, simulated_by)
    return loaded


def judged_of(options: Namespace) -> CalibratedMachine:
    """Load the machine named on the command line with its newest calibrations, to judge a job on it."""
    from console.session.data.calibrated_chuck import apply_calibrations

    return apply_calibrations(profile_of(options), data_of(options))


def link_address(options: Namespace, machine: LoadedMachine) -> LinkAddress:
    """Return the machine's address from --link or its profile, else a simulated one; `LinkError` for a bad one."""
    given = options.link or machine.machine.link
    return parse_address(given) if given and not options.sim else SimulatedAddress()


def refuse_unsigned(machine: MachineProfile, simulated_by: str = SIM_LINK) -> None:
    """Refuse a machine on a real link with `safety.signed_for_simulator` where its profile was signed for that.

    `simulated_by` are the options of the command that lead to the simulated machine instead.
    """
    if problems := real_machine_problems(machine, simulated_by):
        raise ProfileError(*problems)


def plant_given(options: Namespace) -> bool:
    """Whether the command line describes the actual plant of a simulated lathe."""
    given = any(each is not None for each in (options.plant, options.seed, options.clamping_sd))
    return given or options.blind


def refused_plant(options: Namespace, command: str, text: Catalogue) -> bool:
    """Say so where the plant of a simulated lathe is described for a real one; return whether it is."""
    if options.sim or not plant_given(options):
        return False
    print(f"console {command}: {text('usage.plant_without_sim')}", file=sys.stderr)
    return True


def simulated_address(options: Namespace, machine: MachineProfile) -> SimulatedAddress | None:
    """Return the simulated lathe that --plant, --seed and --clamping-sd describe, None without these."""
    if not plant_given(options):
        return None
    plant, sd_percent = options.plant or SimulatedAddress().plant, options.clamping_sd
    from drivers.simulator.plant.presets import plant_named

    plant_named(plant, machine, options.seed, sd_percent)
    return SimulatedAddress(plant=plant, seed=options.seed, clamping_sd_percent=sd_percent, blind=options.blind)


def true_parameters_of(options: Namespace, machine: MachineProfile) -> TrueParameters | None:
    """Return the actual plant that a command without screens cuts on, None where it is not specified.

    Without screens there is no alignment, so the plant must be set up as profile and job say: `ideal` by default,
    and `session.nobody_aligns` for the plant `mounted`.
    """
    if not plant_given(options):
        return None
    from drivers.simulator.plant.presets import plant_named
    from drivers.simulator.plant.which_lathe import MOUNTED

    plant = options.plant or DEFAULT_PLANT
    if plant == MOUNTED:
        raise SessionError(Problem(code="session.nobody_aligns", key="--plant", value=plant))
    return plant_named(plant, machine, options.seed, options.clamping_sd)


def along_as_there(loaded: Loaded, address: LinkAddress | None, true: TrueParameters | None = None) -> Loaded:
    """Return a machine whose lobe along Z is as its simulated lathe has it: at an address, or in this process.

    Parts of the plants `ideal` and `paper` have one lobe along Z, as the paper evaluates them. Raises
    `ProfileError` as `plant_named`.
    """
    if address is not None and not isinstance(address, SimulatedAddress):
        return loaded
    if address is not None and address.plant in ONE_LOBE_PLANTS:
        return replace(loaded, machine=with_one_lobe(loaded.machine))
    from drivers.simulator.plant.presets import plant_named  # loads numerics, which the first page does not need
    from drivers.simulator.plant.true_parameters import as_simulated

    if address is not None:
        true = plant_named(address.plant, loaded.machine, address.seed or 0)
    return replace(loaded, machine=as_simulated(loaded.machine, true))


def known_lathe(address: LinkAddress, machine: MachineProfile) -> tuple[LinkAddress, str]:
    """Return an address with its seed drawn, and the name of the simulated lathe there, "" for a real one.

    The seed is drawn now, so that what was learned on another is refused before it starts.
    """
    if not isinstance(address, SimulatedAddress):
        return address, ""
    from drivers.simulator.plant.presets import plant_named

    true = plant_named(address.plant, machine, address.seed, address.clamping_sd_percent, mounted_by_hand=True)
    return replace(address, seed=true.seed), str(true.lathe)


def lathe_parts_of(
    options: Namespace, job: str, machine: str, true: TrueParameters | None, parts: int = 1
) -> LatheParts | None:
    """Return which parts of a job come next on the simulated lathe, None where all of its parts are alike.

    Raises SessionError: as `next_part`.
    """
    from console.session.cut.simulated_parts import LatheParts, next_part

    if true is None or not true.parts_differ:
        return None
    number = options.lathe_part or next_part(data_of(options), job, machine, true.lathe)
    return LatheParts(lathe=true.lathe, part=number, parts=parts)


def name_file_in_problems(problems: Iterable[Problem], where: str) -> tuple[Problem, ...]:
    """Return the problems, with the file in those that name no place."""
    return tuple(replace(problem, where=problem.where or where) for problem in problems)


@contextmanager
def naming(where: str) -> Iterator[None]:
    """Name the file in every problem of its contents."""
    try:
        yield
    except ProfileError as error:
        raise ProfileError(*name_file_in_problems(error.problems, where)) from error
