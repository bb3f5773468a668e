"""Which simulated lathe it is: a plant and its seed, by which what was learned and cut on it is known again."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

from profiles.files import printable
from profiles.machine import ONE_LOBE, MachineProfile

LATHE = "lathe"
"""Which simulated lathe it was: a header line of a trace, and a key of the record and of JSON."""

WHICH = "which"
"""In the record, the key below `LATHE` that has it as the header line of a trace has it."""

IDEAL, MOUNTED = "ideal", "mounted"
ONE_LOBE_PLANTS = (IDEAL, MOUNTED, "paper")  # whose parts have one lobe along Z, as the paper evaluates them
HASH_DIGITS = 8

NAMED_SEED = ", seed "


def with_one_lobe(machine: MachineProfile) -> MachineProfile:
    """Return a profile that says of its chuck that the lobe is the same along Z."""
    return replace(machine, chuck=replace(machine.chuck, lobe_along=ONE_LOBE))


@dataclass(frozen=True, slots=True, kw_only=True)
class WhichLathe:
    """One simulated lathe: its `plant`, of a file with the beginning of its hash, and its seed.

    Where the seed draws nothing of the lathe itself all lathes of the plant are `alike`, and one.
    """

    plant: str
    seed: int
    alike: bool = False

    def __str__(self) -> str:
        return self.plant if self.alike else f"{self.plant}{NAMED_SEED}{self.seed}"


def which_lathe(plant: str, seed: int, *, alike: bool = False) -> WhichLathe:
    """Return which lathe a plant (a name or a file that can be read) and a seed are.

    What is set up by hand is the ideal lathe: its chuck angle and its tip are found before a cut.
    """
    if plant.endswith(".toml"):
        path = Path(plant)
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        plant = f"{printable(path.name)} {digest[:HASH_DIGITS]}"
    return WhichLathe(plant=IDEAL if plant == MOUNTED else plant, seed=seed, alike=alike)


def options_of(lathe: str) -> tuple[str, ...]:
    """Return the options that lead to a lathe by its text; none where its plant is a file, or it is unknown."""
    plant, named, seed = lathe.rpartition(NAMED_SEED)
    if not named:
        plant = lathe
    if not plant or " " in plant or (named and not seed.isdecimal()):
        return ()
    return ("--plant", plant, *(("--seed", seed) if named else ()))
