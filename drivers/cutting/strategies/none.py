"""`none`: the tool keeps its depth, so the lobe stays on the part."""

from __future__ import annotations

from dataclasses import replace

from drivers.cutting.strategies.pvt import by_pvt
from drivers.cutting.strategies.traits import Made, Planning, Traits


def _made(planning: Planning) -> Made:
    return by_pvt(planning, replace(planning.target, amplitude_um=0.0))


TRAITS = Traits(make=_made, follows_lobe=False)
