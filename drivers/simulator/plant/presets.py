"""Named plants: files of the differences between a lathe's true values and its machine profile.

A plant is bundled (`ideal`, `paper`, `realistic`), `mounted` (the ideal one, set up by hand), or a file with the
same keys, whose path ends in `.toml`. Keys may be in any tables; factors apply to the values of the profile. A
mass, damping or thrust of the tool may be given as a value, instead of a factor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from random import Random, SystemRandom
from typing import Any

from drivers.simulator.plant.true_parameters import TrueParameters, ideal, set_up_by_hand
from profiles.fields import Field, Kind, flatten, read_fields, schema_problem, spelled
from profiles.files import printable, read_toml
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

_FOLDER = Path(__file__).parent / "presets"
MOUNTED = "mounted"
PLANTS = ("ideal", MOUNTED, "paper", "realistic")  # the names of the plants
SEEDS = 2**32

INSTEAD_OF = {"mass_kg": "mass_factor", "thrust_n_per_v": "thrust_factor"}
"""Keys that give a value, each with the factor that it excludes."""


def _factor(key: str, table: str) -> Field:
    return Field(key=key, table=table, default=1.0, above=0.0, at_most=10.0)


def _itself(key: str, unit: str, at_most: float) -> Field:
    return Field(key=key, table="tool", unit=unit, above=0.0, at_most=at_most, optional=True)


def _amount(key: str, table: str, unit: str, at_most: float) -> Field:
    return Field(key=key, table=table, unit=unit, default=0.0, at_least=0.0, at_most=at_most)


PLANT_FIELDS = (
    Field(key="schema", kind=Kind.WHOLE, default=1, at_least=1, at_most=1),
    Field(key="source", kind=Kind.TEXT, default=""),
    _factor("mass_factor", "tool"),
    _factor("thrust_factor", "tool"),
    _itself("mass_kg", "kg", 1000.0),
    _itself("damping_n_s_per_m", "N s/m", 100_000.0),
    _itself("thrust_n_per_v", "N/V", 100_000.0),
    _amount("coulomb_friction_n", "tool", "N", 100.0),
    _amount("current_lag_ms", "tool", "ms", 10.0),
    _amount("encoder_noise_um", "tool", "um", 10.0),
    Field(key="commutation_error_deg", table="tool", unit="deg", default=0.0, at_least=-180.0, at_most=180.0),
    _amount("scale_error_um", "tool", "um", 1000.0),
    _factor("inertia_factor", "spindle"),
    _amount("speed_ripple_percent", "spindle", "%", 50.0),
    Field(key="ripple_per_turn", kind=Kind.WHOLE, table="spindle", default=2, at_least=1, at_most=100),
    _amount("radial_error_um_pp", "spindle", "um", 100.0),
    _factor("lobe_factor", "chuck"),
    Field(key="lobe_error_um_pp", table="chuck", unit="um", at_least=0.0, at_most=1000.0, optional=True),
    Field(key="lobe_force_n", table="chuck", unit="N", above=0.0, at_most=100_000.0, optional=True),
    Field(key="lobe_past_jaw_deg", table="chuck", unit="deg", at_least=-180.0, at_most=180.0, optional=True),
    Field(
        key="lobe_growth_percent_per_mm", table="chuck", unit="%/mm", at_least=-20.0, at_most=20.0, optional=True
    ),
    Field(key="jaw_offset_deg", table="chuck", unit="deg", default=0.0, at_least=-360.0, at_most=360.0),
    _amount("jaw_1_harder", "chuck", "", 1.0),
    _amount("passive_force_share", "cut", "", 5.0),
    _amount("edge_force_n_per_mm", "cut", "N/mm", 100.0),
    _amount("eccentricity_um", "gauge", "um", 1000.0),
    _amount("noise_um", "gauge", "um", 10.0),
    Field(key="start_mark", kind=Kind.CHOICE, table="gauge", default="known", choices=("known", "unknown")),
)
"""Every key of a plant with its limits."""


def plant_named(
    name_or_path: str,
    machine: MachineProfile,
    seed: int | None = None,
    clamping_sd_percent: float = 0.0,
    mounted_by_hand: bool = False,
) -> TrueParameters:
    """Return the true parameters of a plant on a machine.

    Random effects use `seed`, and differ each time without one. `clamping_sd_percent` is the standard deviation of
    the chucking force from clamping to clamping; 0 makes all clampings identical. Set up by hand, the chuck is at
    any angle and the tip near its nominal radius, and the spindle has its inertia.

    Raises:
        ProfileError: `plant.unknown`, no such name; those of a file that cannot be read or has wrong keys;
            `key.instead_of`, a value and the factor that it replaces; `value.out_of_range`, a friction of
            more than all damping.
    """
    by_hand = mounted_by_hand or name_or_path == MOUNTED
    values, where = _values("ideal" if name_or_path == MOUNTED else name_or_path)
    drawn = SystemRandom().randrange(SEEDS) if seed is None else seed
    true_position = _with_friction(_changed(ideal(machine), values), values["coulomb_friction_n"], where)
    true_position = replace(true_position, seed=drawn, clamping_force_spread=clamping_sd_percent / 100.0)
    return set_up_by_hand(true_position, machine, Random(drawn)) if by_hand else true_position


def _values(name_or_path: str) -> tuple[Mapping[str, Any], str]:
    """Return the values of a plant, and its file as it is named in problems."""
    if name_or_path.endswith(".toml"):
        path = Path(name_or_path)
    elif name_or_path in PLANTS:
        path = _FOLDER / f"{name_or_path}.toml"
    else:
        limit = " | ".join((*PLANTS, "FILE.toml"))
        raise ProfileError(Problem(code="plant.unknown", value=spelled(name_or_path), limit=limit))
    where = printable(str(path))
    _, table = read_toml(path)
    leaves, problems = flatten(table, where=where)
    if refusal := schema_problem(leaves, where=where):
        raise ProfileError(refusal)
    values, found = read_fields(PLANT_FIELDS, leaves, where=where)
    found += [
        Problem(code="key.instead_of", where=where, key=key, value=factor)
        for key, factor in INSTEAD_OF.items()
        if key in leaves and factor in leaves
    ]
    if problems or found:
        raise ProfileError(*problems, *found)
    return values, where


def _with_friction(true: TrueParameters, friction_n: float, where: str) -> TrueParameters:
    """Return the parameters with this much of the damping dry; refuse a file `where` that asks for more."""
    try:
        return replace(true, coulomb_friction_n=friction_n)
    except ValueError:
        limit, value, key = f"<= {true.most_friction_n:.4g} N", f"{friction_n:g} N", "coulomb_friction_n"
        raise ProfileError(
            Problem(code="value.out_of_range", where=where, key=key, value=value, limit=limit)
        ) from None


def _changed(nominal: TrueParameters, values: Mapping[str, Any]) -> TrueParameters:
    growth_percent = values["lobe_growth_percent_per_mm"]
    return replace(
        nominal,
        moving_mass_kg=values["mass_kg"] or values["mass_factor"] * nominal.moving_mass_kg,
        damping_n_s_per_m=values["damping_n_s_per_m"] or nominal.damping_n_s_per_m,
        force_n_per_v=values["thrust_n_per_v"] or values["thrust_factor"] * nominal.force_n_per_v,
        current_lag_s=values["current_lag_ms"] / 1000.0,
        encoder_noise_um=values["encoder_noise_um"],
        commutation_error_deg=values["commutation_error_deg"],
        scale_error_um=values["scale_error_um"],
        spindle_inertia_kg_m2=values["inertia_factor"] * nominal.spindle_inertia_kg_m2,
        speed_ripple=values["speed_ripple_percent"] / 100.0,
        ripple_per_turn=values["ripple_per_turn"],
        radial_error_um_pp=values["radial_error_um_pp"],
        lobe_factor=values["lobe_factor"],
        lobe_um_pp=values["lobe_error_um_pp"],
        lobe_force_n=values["lobe_force_n"],
        lobe_past_jaw_deg=values["lobe_past_jaw_deg"],
        lobe_growth_per_mm=None if growth_percent is None else growth_percent / 100.0,
        jaw_offset_deg=values["jaw_offset_deg"],
        jaw_1_harder=values["jaw_1_harder"],
        passive_fraction=values["passive_force_share"],
        edge_n_per_mm=values["edge_force_n_per_mm"],
        gauge_eccentricity_um=values["eccentricity_um"],
        gauge_noise_um=values["noise_um"],
        gauge_mark_known=values["start_mark"] == "known",
    )
