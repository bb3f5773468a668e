"""Style sheets that are read once: each screen here is an application of its own, with the same few of them.

To read them takes a quarter of what it takes to start one. What is read depends on the text, on the colours that
it names, and on nothing else.
"""

from __future__ import annotations

from collections.abc import Hashable

from textual.css.model import RuleSet
from textual.css.stylesheet import Stylesheet
from textual.css.types import CSSLocation

_read: dict[Hashable, list[RuleSet]] = {}
_parse_rules = Stylesheet._parse_rules


def parse_rules_once(
    sheet: Stylesheet,
    css: str,
    read_from: CSSLocation,
    is_default_rules: bool = False,
    tie_breaker: int = 0,
    scope: str = "",
) -> list[RuleSet]:
    """Read a style sheet as the method of that name does; the same once more is what it was."""
    variables = frozenset(sheet._variables.items())
    asked = (css, read_from, is_default_rules, tie_breaker, scope, variables)
    if asked not in _read:
        _read[asked] = _parse_rules(sheet, css, read_from, is_default_rules, tie_breaker, scope)
    return _read[asked]


Stylesheet._parse_rules = parse_rules_once  # type: ignore[method-assign, assignment]
