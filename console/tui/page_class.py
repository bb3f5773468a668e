"""Class of a page, imported when it is shown for the first time."""

from __future__ import annotations

from importlib import import_module

from console.tui.keymap import MODULES, NUMBERED, PageName
from console.tui.page import Page


def page_class(name: PageName) -> type[Page]:
    """Return `JobsPage` for jobs; pages with a digit are in `pages`, most others in `further`."""
    module = MODULES.get(name, f"console.tui.{'pages' if name in NUMBERED else 'further'}.{name}")
    found: type[Page] = getattr(import_module(module), f"{name.capitalize()}Page")
    return found
