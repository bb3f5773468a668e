"""Named plants: files of the differences between a lathe's true values and its machine profile.

A plant is bundled, `mounted` (the ideal one, set up by hand), or a file with the same keys, whose path ends in
`.toml`. Keys may be in any tables; factors apply to the values of the profile. A mass, damping or thrust of the
tool may be given as a value, instead of a factor. A file may begin from a bundled one (`like`), and its table
`[spread]` has the standard deviations of keys from lathe to lathe: which one it is, the seed says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from random import Random, SystemRandom
from typing import Any

from drivers.simulator.plant.true_parameters import TrueParameters, ideal, set_up_by_hand
from drivers.simulator.plant.which_lathe import IDEAL, MOUNTED, which_lathe
from profiles.axis.notch import SignConvention
from profiles.fields import Field, FieldType, fault, flatten, read_fields, schema_problem, spell_toml
from profiles.files import printable, read_toml
from profiles.machine import MachineProfile
from profiles.problem import Problem, ProfileError

_FOLDER = Path(__file__).parent / "presets"
BUNDLED = ("ideal", "paper", "steady", "easy", "realistic", "hard")
PLANTS = ("ideal", MOUNTED, *BUNDLED[1:])  # the names of the plants
SEEDS = 2**32

INSTEAD_OF = {"mass_kg": "mass_factor", "thrust_n_per_v": "thrust_factor"}
"""Keys that give a value, each with the factor that it excludes."""


def _factor(key: str, table: str) -> Field:
    return Field(key=key, table=table, default=1.0, above=0.0, at_most=10.0)


def _own_field(key: str, unit: str, at_most: float) -> Field:
    return Field(key=key, table="tool", unit=unit, above=0.0, at_most=at_most, optional=True)


def _amount(key: str, table: str, unit: str, at_most: float) -> Field:
    return Field(key=key, table=table, unit=unit, default=0.0, at_least=0.0, at_most=at_most)


PLANT_FIELDS = (
    Field(key="schema", kind=FieldType.WHOLE, default=1, at_least=1, at_most=1),
    Field(key="source", kind=FieldType.TEXT, default=""),
    Field(key="like", kind=FieldType.CHOICE, default="ideal", choices=BUNDLED),
    _factor("mass_factor", "tool"),
    _factor("thrust_factor", "tool"),
    _own_field("mass_kg", "kg", 1000.0),
    _own_field("damping_n_s_per_m", "N s/m", 100_000.0),
    _own_field("thrust_n_per_v", "N/V", 100_000.0),
    _amount("coulomb_friction_n", "tool", "N", 100.0),
    _amount("presliding_um", "tool", "um", 1000.0),
    _amount("current_lag_ms", "tool", "ms", 10.0),
    _amount("encoder_noise_um", "tool", "um", 10.0),
    Field(key="commutation_error_deg", table="tool", unit="deg", default=0.0, at_least=-180.0, at_most=180.0),
    _amount("scale_error_um", "tool", "um", 1000.0),
    _amount("backlash_um", "tool", "um", 200.0),
    Field(key="flexible_hz", table="tool", unit="Hz", default=300.0, at_least=50.0, at_most=1000.0),
    Field(key="flexible_damping", table="tool", default=0.02, at_least=0.001, at_most=0.5),
    Field(key="flexible_fraction", table="tool", default=0.0, at_least=-2.0, at_most=2.0),
    Field(
        key="notch_reading",
        kind=FieldType.CHOICE,
        table="controller",
        default=str(SignConvention.STATED),
        choices=tuple(str(each) for each in SignConvention),
    ),
    _factor("inertia_factor", "spindle"),
    _amount("speed_ripple_percent", "spindle", "%", 50.0),
    Field(key="ripple_per_turn", kind=FieldType.WHOLE, table="spindle", default=2, at_least=1, at_most=100),
    _amount("radial_error_um_pp", "spindle", "um", 100.0),
    _factor("lobe_factor", "chuck"),
    Field(key="lobe_error_um_pp", table="chuck", unit="um", at_least=0.0, at_most=1000.0, optional=True),
    Field(key="lobe_force_n", table="chuck", unit="N", above=0.0, at_most=100_000.0, optional=True),
    Field(key="lobe_past_jaw_deg", table="chuck", unit="deg", at_least=-180.0, at_most=180.0, optional=True),
    Field(key="jaw_stiffness", table="chuck", above=0.0, at_most=1e6, optional=True),
    _amount("jaw_open_fraction", "chuck", "", 0.5),
    Field(key="lobe_turned_deg", table="chuck", unit="deg", default=0.0, at_least=-180.0, at_most=180.0),
    Field(key="lobe_turned_deg_per_part", table="chuck", unit="deg", default=0.0, at_least=-10.0, at_most=10.0),
    _amount("overtone_factor", "chuck", "", 10.0),
    _amount("clamping_sd_percent", "chuck", "%", 50.0),
    Field(key="jaw_offset_deg", table="chuck", unit="deg", default=0.0, at_least=-360.0, at_most=360.0),
    _amount("jaw_1_harder", "chuck", "", 1.0),
    Field(key="jaws_refitted_from_part", kind=FieldType.WHOLE, table="chuck", at_least=2, optional=True),
    _amount("oval_um_pp", "blank", "um", 500.0),
    _amount("run_out_um", "blank", "um", 500.0),
    _amount("pressed_fraction", "blank", "", 1.0),
    Field(key="drift_um", table="warm-up", unit="um", default=0.0, at_least=-200.0, at_most=200.0),
    Field(key="drift_parts", table="warm-up", default=5.0, above=0.0, at_most=1000.0),
    _amount("passive_force_share", "cut", "", 5.0),
    _amount("edge_force_n_per_mm", "cut", "N/mm", 100.0),
    Field(key="process_gain", table="cut", default=1.0, at_least=0.8, at_most=1.0),
    _amount("work_compliance_um_per_n", "cut", "um/N", 10.0),
    _amount("softer_between_jaws", "cut", "", 1.0),
    _amount("indicator_noise_um", "indicator", "um", 100.0),
    _amount("indicator_backlash_um", "indicator", "um", 100.0),
    _amount("indicator_graduation_um", "indicator", "um", 100.0),
    _amount("finger_tight_percent", "indicator", "%", 90.0),
    _amount("finger_tight_sd_percent", "indicator", "%", 30.0),
    _amount("eccentricity_um", "gauge", "um", 1000.0),
    _amount("noise_um", "gauge", "um", 10.0),
    _amount("mark_sd_deg", "gauge", "deg", 20.0),
    _amount("spindle_error_um", "gauge", "um", 1000.0),
    Field(key="spindle_error_upr", kind=FieldType.WHOLE, table="gauge", default=2, at_least=2, at_most=100),
    Field(key="spindle_error_deg", table="gauge", unit="deg", default=0.0, at_least=-180.0, at_most=180.0),
    Field(key="start_mark", kind=FieldType.CHOICE, table="gauge", default="known", choices=("known", "unknown")),
)
"""Every key of a plant with its limits."""

SPREAD = "spread"
WIDEST_SD = 3.0  # no value is further from that of the file: a lathe in 370 would be


def _width(field: Field) -> float:
    """Return the range of a field: both of its bounds are numbers."""
    low = field.at_least if field.above is None else field.above
    return (field.at_most or math.inf) - (low or 0.0)


SPREAD_FIELDS = tuple(
    replace(each, above=None, at_least=0.0, at_most=_width(each), default=0.0, optional=False)
    for each in PLANT_FIELDS
    if each.kind is FieldType.NUMBER
)
"""What a table of standard deviations may hold: one for each number of a plant, in its unit."""


def _draw_values(values: Mapping[str, Any], sd: Mapping[str, float], seed: int) -> dict[str, Any]:
    """Return the values of one lathe: each normal about that of its file, again until it is within its limits.

    Each key has random numbers of its own, so that another key in the file leaves them as they are.
    """
    found = dict(values)
    known = {each.key: each for each in PLANT_FIELDS}
    for key, width in sd.items():
        if width > 0.0:
            found[key] = _draw_value(known[key], values[key], width, Random(f"{seed} {key} of the plant"))
    return found


def _draw_value(field: Field, mean: float, sd: float, random: Random) -> float:
    while True:
        value = random.gauss(mean, sd)
        if abs(value - mean) <= WIDEST_SD * sd and not fault(field, value):
            return value


def plant_named(
    name_or_path: str,
    machine: MachineProfile,
    seed: int | None = None,
    clamping_sd_percent: float | None = None,
    mounted_by_hand: bool = False,
) -> TrueParameters:
    """Return the true parameters of a plant on a machine.

    Random effects use `seed`, and differ each time without one. `clamping_sd_percent` is the standard deviation
    of the chucking force from clamping to clamping, whatever the plant says; 0 makes all clampings identical.
    Set up by hand, the chuck is at any angle and the tip near its nominal radius, and the spindle has its
    inertia.

    Raises:
        ProfileError: `plant.unknown`, no such name; those of a file that cannot be read or has wrong keys;
            `key.instead_of`, a value and the factor that it replaces; `value.out_of_range`, a friction of
            more than all damping.
    """
    by_hand = mounted_by_hand or name_or_path == MOUNTED
    number = SystemRandom().randrange(SEEDS) if seed is None else seed
    plant = IDEAL if name_or_path == MOUNTED else name_or_path
    values, where, spread = _values(plant, number)
    true = _with_friction(_change_parameters(ideal(machine), values), values["coulomb_friction_n"], where)
    alike = not (spread or true.lathes_differ)
    true = replace(true, seed=number, lathe=which_lathe(plant, number, alike=alike))
    if clamping_sd_percent is not None:
        true = replace(true, clamping_force_spread=clamping_sd_percent / 100.0)
    return set_up_by_hand(true, machine, Random(number)) if by_hand else true


def plant_problems(name_or_path: str) -> tuple[Problem, ...]:
    """Return what is wrong in the file of a plant."""
    try:
        _values(name_or_path, 0)
    except ProfileError as error:
        return tuple(error.problems)
    return ()


def _values(name_or_path: str, seed: int) -> tuple[Mapping[str, Any], str, bool]:
    """Return the values of a plant, its file as it is named in problems, and whether any of them is drawn."""
    path = _path_of(name_or_path)
    where = printable(str(path))
    leaves, sd = _leaves(path)
    values, problems = read_fields(PLANT_FIELDS, leaves, where=where)
    widths, found = read_fields(SPREAD_FIELDS, sd, where=where, prefix=f"{SPREAD}.")
    found += [
        Problem(code="key.instead_of", where=where, key=key, value=factor)
        for key, factor in INSTEAD_OF.items()
        if key in leaves and factor in leaves
    ]
    found += [
        Problem(code="plant.spread_of_nothing", where=where, key=f"{SPREAD}.{key}", value=key)
        for key, width in widths.items()
        if width and values.get(key, 0.0) is None
    ]
    if problems or found:
        raise ProfileError(*problems, *found)
    return _draw_values(values, widths, seed), where, any(widths.values())


def _path_of(name_or_path: str) -> Path:
    if name_or_path.endswith(".toml"):
        return Path(name_or_path)
    if name_or_path in BUNDLED:
        return _FOLDER / f"{name_or_path}.toml"
    limit = " | ".join((*PLANTS, "FILE.toml"))
    raise ProfileError(Problem(code="plant.unknown", value=spell_toml(name_or_path), limit=limit))


def _leaves(path: Path) -> tuple[dict[str, object], dict[str, object]]:
    """Return the keys of a plant and its standard deviations, on top of those of the plant that it is `like`."""
    where = printable(str(path))
    _, table = read_toml(path)
    spread = table.pop(SPREAD, {})
    leaves, problems = flatten(table, where=where)
    if refusal := schema_problem(leaves, where=where):
        raise ProfileError(refusal)
    sd, found = flatten(spread, where=where) if isinstance(spread, dict) else ({SPREAD: spread}, [])
    if problems or found:
        raise ProfileError(*problems, *found)
    like = leaves.get("like")
    if like not in BUNDLED or like == path.stem:
        return leaves, sd
    before, sd_before = _leaves(_path_of(str(like)))
    given = {factor for key, factor in INSTEAD_OF.items() if key in leaves}
    return {**{k: v for k, v in before.items() if k not in given}, **leaves}, {**sd_before, **sd}


def _with_friction(true: TrueParameters, friction_n: float, where: str) -> TrueParameters:
    """Return the parameters with this much of the damping dry; refuse a file `where` that asks for more."""
    try:
        return replace(true, coulomb_friction_n=friction_n)
    except ValueError:
        limit, value, key = f"<= {true.most_friction_n:.4g} N", f"{friction_n:g} N", "coulomb_friction_n"
        raise ProfileError(
            Problem(code="value.out_of_range", where=where, key=key, value=value, limit=limit)
        ) from None


_RENAMED = {
    "lobe_error_um_pp": "lobe_um_pp",
    "passive_force_share": "passive_fraction",
    "edge_force_n_per_mm": "edge_n_per_mm",
    **{f"{key}_um": f"gauge_{key}_um" for key in ("eccentricity", "noise")},
    **{f"spindle_error_{key}": f"gauge_error_{key}" for key in ("um", "upr", "deg")},
    **{"mark_sd_deg": "gauge_mark_sd_deg", "pressed_fraction": "blank_pressed"},
    **{key: f"blank_{key}" for key in ("oval_um_pp", "run_out_um")},
}
_PERCENT = {
    "speed_ripple_percent": "speed_ripple",
    "clamping_sd_percent": "clamping_force_spread",
    "finger_tight_percent": "finger_force_fraction",
    "finger_tight_sd_percent": "finger_force_spread",
}
"""Keys of a plant whose values are parameters of another name, and those that are fractions of 100 there."""


def _change_parameters(nominal: TrueParameters, values: Mapping[str, Any]) -> TrueParameters:
    """Return the parameters with the values of a plant: each key that is the name of one, and the others."""
    names = {_RENAMED.get(key, key): value for key, value in values.items()}
    changed = {each.name: names[each.name] for each in fields(TrueParameters) if each.name in names}
    for key, name in _PERCENT.items():
        changed[name] = None if values[key] is None else values[key] / 100.0
    changed |= {
        "moving_mass_kg": values["mass_kg"] or values["mass_factor"] * nominal.moving_mass_kg,
        "damping_n_s_per_m": values["damping_n_s_per_m"] or nominal.damping_n_s_per_m,
        "force_n_per_v": values["thrust_n_per_v"] or values["thrust_factor"] * nominal.force_n_per_v,
        "current_lag_s": values["current_lag_ms"] / 1000.0,
        "spindle_inertia_kg_m2": values["inertia_factor"] * nominal.spindle_inertia_kg_m2,
        "notch_reading": SignConvention(values["notch_reading"]),
        "gauge_mark_known": values["start_mark"] == "known",
        "coulomb_friction_n": nominal.coulomb_friction_n,  # after all damping is known
    }
    return replace(nominal, **changed)
