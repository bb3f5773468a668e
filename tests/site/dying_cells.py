"""A maker of cells for tests, some of which end the process that makes them."""

from __future__ import annotations

import os
import pickle

from console.site.study.cells import MADE, Cell
from console.site.study.running import CellResult, failed, software

DIES = 3


def make_or_die(content: bytes) -> CellResult:
    """Make nothing of a cell; with the seed `DIES`, the process ends as by lack of memory."""
    cell: Cell = pickle.loads(content)
    if cell.names["seed"] == DIES:
        os._exit(9)
    return CellResult(cell.number, (failed(cell, MADE),), software())
