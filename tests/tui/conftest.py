"""Style sheets are read once, and nothing is painted that nobody sees: each screen here is an app of its own.

To read its style sheets takes a quarter of what it takes to start one. What is read depends on the text, on the
colours that it names, and on nothing else.

An application without a terminal paints for nobody, which takes a quarter of the rest; a test that looks at the
screen has it rendered then.
"""

from __future__ import annotations

from collections.abc import Hashable

from rich.console import RenderableType
from textual._compositor import Compositor
from textual._context import active_app, visible_screen_stack
from textual.css.model import RuleSet
from textual.css.stylesheet import Stylesheet
from textual.css.types import CSSLocation
from textual.screen import Screen

from console.tui.application import listening

_read: dict[Hashable, list[RuleSet]] = {}
_parse_rules = Stylesheet._parse_rules
_render_update = Compositor.render_update


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


def paint_nothing(
    compositor: Compositor,
    full: bool = False,
    screen_stack: list[Screen[object]] | None = None,
    simplify: bool = False,
) -> RenderableType | None:
    """Take what would be painted as painted, unless there is a terminal."""
    if not active_app.get().is_headless:
        return _render_update(compositor, full, screen_stack, simplify)
    visible_screen_stack.set([] if screen_stack is None else screen_stack)
    compositor._dirty_regions.clear()
    return None


Compositor.render_update = paint_nothing  # type: ignore[method-assign, assignment]

# However busy this computer is, no key of these tests is late; late ones are in tests/system/test_late_keys.py.
listening.OLD_S = 60.0  # type: ignore[attr-defined]
