"""Which simulated lathe it is: a plant and its seed, by which what was learned and cut on it is known again."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from profiles.files import printable

IDEAL = "ideal"
ALIKE = (IDEAL, "paper")  # plants of which no seed draws anything: all lathes of one are the same
HASH_DIGITS = 8

NAMED_SEED = ", seed "


@dataclass(frozen=True, slots=True, kw_only=True)
class WhichLathe:
    """One simulated lathe: its `plant`, of a file with the beginning of its hash, and its seed.

    Where the file of a plant draws nothing from the seed its lathes are `alike`, and one.
    """

    plant: str
    seed: int
    alike: bool = False

    def __str__(self) -> str:
        return self.plant if self.alike or self.plant in ALIKE else f"{self.plant}{NAMED_SEED}{self.seed}"


def which_lathe(plant: str, seed: int, *, drawn: bool = True) -> WhichLathe:
    """Return which lathe a plant (a name or a file that can be read) and a seed are; `drawn`: the seed tells."""
    alike = False
    if plant.endswith(".toml"):
        path = Path(plant)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        plant, alike = f"{printable(path.name)} {digest[:HASH_DIGITS]}", not drawn
    return WhichLathe(plant=plant, seed=seed, alike=alike)


def lathe_named(lathe: str) -> WhichLathe | None:
    """Return the lathe of such a text; None where all lathes of its plant are alike, or it is unknown."""
    plant, _, seed = lathe.rpartition(NAMED_SEED)
    return WhichLathe(plant=plant, seed=int(seed)) if plant else None


def options_of(lathe: str) -> tuple[str, ...]:
    """Return the options that lead to a lathe by its text; none where its plant is a file, or it is unknown."""
    plant, _, seed = lathe.partition(NAMED_SEED)
    if not plant or " " in plant:
        return ()
    return ("--plant", plant, *(("--seed", seed) if seed else ()))
