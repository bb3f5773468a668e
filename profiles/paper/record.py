"""What is compared: a number of the paper with ours, and the curves of a figure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Relation(StrEnum):
    """How ours must stand to what is expected."""

    NEAR = "="
    AT_MOST = "<="
    ABOVE = ">"
    OTHER = "!="


class Basis(StrEnum):
    """What a comparison is worth.

    One that is true by `CONSTRUCTION` follows from what the model is, whatever is assumed in it: a formula of the
    paper put in and taken out, or a trend that the model has for any value. One that is `FITTED` is with the very
    numbers that the model was fitted to. Neither tells anything of the paper, and both are counted apart.
    """

    COMPUTED = "computed"
    CONSTRUCTION = "by construction"
    FITTED = "fitted"


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One number. `expected` is what the paper says or, with an acceptance `number` (1 to 12), what must come out.

    `expected` is None where the paper says nothing. `at` tells records of one name apart (a frequency, an
    experiment), `why` names the reason that is given for the difference, `facts` are the numbers in that reason,
    each with its unit in its name. `tolerance` is in `unit`. `basis` says whether it could have come
    out otherwise.
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
        """Ours minus what is expected; None where nothing is, or only a bound."""
        if self.expected is None or self.relation is not Relation.NEAR:
            return None
        return self.ours - self.expected

    @property
    def holds(self) -> bool | None:
        """Whether ours stands to what is expected as it must; None where nothing is expected."""
        if self.expected is None:
            return None
        if self.relation is Relation.AT_MOST:
            return self.ours <= self.expected
        if self.relation is Relation.ABOVE:
            return self.ours > self.expected
        if self.relation is Relation.OTHER:
            return abs(self.ours - self.expected) > self.tolerance
        return math.isclose(self.ours, self.expected, rel_tol=1e-12, abs_tol=self.tolerance)


def constructed(record: Record, why: str) -> Record:
    """Return a record that is true by construction, and why."""
    return replace(record, basis=Basis.CONSTRUCTION, why=why)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One line of a figure; `x` and `y` have shape (M,)."""

    name: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]

    @classmethod
    def of(cls, name: str, x: ArrayLike, y: ArrayLike) -> Curve:
        """Return the curve through these points."""
        return cls(name=name, x=np.asarray(x, dtype=np.float64), y=np.asarray(y, dtype=np.float64))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Figure:
    """The curves of one figure in its units; `at` tells figures of one name apart."""

    name: str
    x_unit: str
    y_unit: str
    curves: tuple[Curve, ...]
    at: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """One part of the comparison."""

    name: str
    records: tuple[Record, ...]
    figures: tuple[Figure, ...] = ()
