"""What a program will do, found out once: most tests cut one of a few parts, by one of a few programs.

To run a program through takes a tenth of a short cut in simulation, and depends on nothing but its lines and on
what is asked with them.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Mapping, Sequence

from drivers.pmac.axes import AxisDefinition
from drivers.pmac.check import CheckedProgram, run_through
from drivers.pmac.dialect import PMAC, Dialect
from drivers.pmac.program_text import ProgramText

AT_MOST = 24
"""Programs that are kept: a long one is some megabytes."""

_kept: OrderedDict[Hashable, CheckedProgram] = OrderedDict()


def run_through_once(
    text: ProgramText,
    i_variables: Mapping[int, float],
    definitions: Sequence[AxisDefinition],
    start: Mapping[int, float],
    dialect: Dialect = PMAC,
) -> CheckedProgram:
    """Run a program through as the function of that name does; the same once more is what it was."""
    settings = tuple(sorted(i_variables.items()))
    asked = (text.number, text.lines, settings, tuple(definitions), tuple(start.items()), dialect.name)
    if asked in _kept:
        _kept.move_to_end(asked)
    else:
        _kept[asked] = run_through(text, i_variables, definitions, start, dialect)
        if len(_kept) > AT_MOST:
            _kept.popitem(last=False)
    return _kept[asked]
