"""Workpiece materials by their word in a job: cutting force and elastic constants.

kc1.1 and mc are catalogue values of the material groups of VDI 3323, good to about 50 % for chips as thin as a
finishing cut's. The yield strengths are low values for the group: stresses above them are refused, and naming
the alloy gives a higher value; they are not design values.
"""

from __future__ import annotations

from dataclasses import dataclass

from profiles.problem import Problem, ProfileError


@dataclass(frozen=True, slots=True)
class Material:
    """One group: Kienzle's two constants, Young's modulus, Poisson's ratio, yield strength, expansion."""

    name: str
    kc1_n_per_mm2: float
    chip_exponent: float
    youngs_modulus_gpa: float
    poisson: float
    yield_mpa: float
    expansion_um_per_m_k: float

    @property
    def youngs_modulus_n_per_mm2(self) -> float:
        """Young's modulus in N/mm^2."""
        return 1000 * self.youngs_modulus_gpa


MATERIALS: tuple[Material, ...] = (
    Material("aluminium, wrought, not hardenable", 700, 0.25, 70, 0.33, 120, 23.5),
    Material("aluminium, wrought, hardenable", 800, 0.25, 70, 0.33, 240, 23.5),
    Material("aluminium, cast, up to 12 % Si", 700, 0.25, 73, 0.33, 90, 21.0),
    Material("steel, below 0.25 % C", 1350, 0.21, 206, 0.30, 235, 12.0),
    Material("steel, from 0.25 % C, annealed", 1500, 0.22, 206, 0.30, 340, 11.5),
    Material("steel, below 0.55 % C, quenched and tempered", 1675, 0.24, 206, 0.30, 490, 11.5),
    Material("steel, low alloy, annealed", 1775, 0.24, 206, 0.30, 415, 12.0),
    Material("steel, low alloy, quenched and tempered", 1800, 0.24, 206, 0.30, 700, 12.0),
    Material("stainless steel, austenitic", 2150, 0.20, 193, 0.29, 205, 16.5),
)

_WORDS: dict[str, int] = {
    "al": 0, "aluminium": 0, "aluminum": 0, "알루미늄": 0, "a1050": 0, "a5052": 0, "a5083": 0,
    "a6061": 1, "6061": 1, "a7075": 1, "7075": 1, "a2017": 1, "a2024": 1,
    "adc12": 2, "ac4c": 2,
    "ss400": 3, "s20c": 3, "s235jr": 3,
    "steel": 4, "강": 4, "s45c": 4, "c45": 4,
    "s45c-h": 5, "c45+qt": 5,
    "scm440": 6, "scr420": 6, "42crmo4": 6,
    "scm440-h": 7, "42crmo4+qt": 7,
    "stainless": 8, "sus304": 8, "sts304": 8, "sus316": 8, "1.4301": 8,
}  # fmt: skip
"""The words that a job may use, in lower case, each with its row of `MATERIALS`."""


def material_or_none(word: str) -> Material | None:
    """Return the material that a job names, None if unknown; case does not matter."""
    row = _WORDS.get(word.strip().lower())
    return None if row is None else MATERIALS[row]


def material_named(word: str) -> Material:
    """Return the material that a job names.

    Raises `ProfileError`: `rule.material_unknown`, with the known words.
    """
    found = material_or_none(word)
    if found is None:
        raise ProfileError(unknown_material(word))
    return found


def unknown_material(word: str) -> Problem:
    """Return the refusal of an unknown material."""
    known = ("Al", "A6061", "ADC12", "SS400", "steel", "SCM440", "SUS304")
    return Problem(code="rule.material_unknown", key="material", value=word, limit=" | ".join(known))
