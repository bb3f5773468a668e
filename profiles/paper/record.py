"""The elements of the comparison: a number of the paper with ours, and the curves of a figure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from profiles.arrays import Floats
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine

COMPENSATED_UM = (30.0, 14.0)  # RONt of the compensated parts, Fig 16
CONCLUDED_UM = 27.0  # what the 51 % of the conclusion would make of 55 um


class Relation(StrEnum):
    """The required relation of our value to the expected one."""

    NEAR = "="
    AT_MOST = "<="
    ABOVE = ">"
    OTHER = "!="


class Basis(StrEnum):
    """The significance of a comparison.

    One that is `COMPUTED` has other inputs than the number itself, and may miss it. One that holds by
    `CONSTRUCTION` follows from the model itself, whatever its assumptions: a number of the paper put in and taken
    out, or a trend that the model has for any value. One that is `FITTED` uses the numbers that the model was
    fitted to. One of a `READING` rests on what an ambiguous figure of the paper is taken to mean. One of a `RIVAL`
    explanation stands beside others of the same result, of which one at most is true: that it holds is no success
    of the model. Only the first kind is evidence about the paper; the others are counted separately.
    """

    COMPUTED = "computed"
    CONSTRUCTION = "by construction"
    FITTED = "fitted"
    READING = "reading"
    RIVAL = "rival"


@dataclass(frozen=True, slots=True)
class Record:
    """One number. `expected` is the paper's value or, with an acceptance `number` (1 to 12), the required one.

    `expected` is None where the paper gives none. `at` distinguishes records of one name (a frequency, an
    experiment), `why` names the reason for the difference, `facts` are the numbers in that reason, each with
    its unit in its name. `tolerance` is in `unit`. `basis` says whether it could have come out otherwise.
    """

    name: str
    ours: float
    unit: str = ""
    at: str = ""
    expected: float | None = None
    tolerance: float = 0.0
    relation: Relation = Relation.NEAR
    why: str = ""
    facts: Mapping[str, float] = field(default_factory=dict)
    number: int = 0
    basis: Basis = Basis.COMPUTED

    @property
    def difference(self) -> float | None:
        """Our value minus the expected one; None where there is none, or only a bound."""
        if self.expected is None or self.relation is not Relation.NEAR:
            return None
        return self.ours - self.expected

    @property
    def holds(self) -> bool | None:
        """Whether our value satisfies the relation; None where nothing is expected."""
        if self.expected is None:
            return None
        match self.relation:
            case Relation.AT_MOST:
                return self.ours <= self.expected
            case Relation.ABOVE:
                return self.ours > self.expected
            case Relation.OTHER:
                return abs(self.ours - self.expected) > self.tolerance
        return math.isclose(self.ours, self.expected, rel_tol=1e-12, abs_tol=self.tolerance)


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One line of a figure; `x` and `y` have shape (M,)."""

    name: str
    x: Floats
    y: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """The curves of one figure in its units; `at` distinguishes figures of one name."""

    name: str
    x_unit: str
    y_unit: str
    curves: tuple[Curve, ...]
    at: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """One part of the comparison."""

    name: str
    records: tuple[Record, ...]
    figures: tuple[Figure, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiments:
    """The machine and the jobs of experiment 1 and 2."""

    machine: MachineProfile
    jobs: tuple[Job, Job]

    @property
    def errors_um_pp(self) -> tuple[float, float]:
        """RONt of the parts without compensation, Fig 14: 55 and 33 um."""
        first, second = self.jobs
        return first.lobe_error_um_pp, second.lobe_error_um_pp


def lee_2001() -> Experiments:
    """Return them from the bundled profiles."""
    first, second = (load_job(f"lee-2001-experiment-{number}").job for number in (1, 2))
    return Experiments(machine=load_machine("lee-2001-lathe").machine, jobs=(first, second))
