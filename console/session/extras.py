"""Optional parts of an installation: what is missing is said with the command that installs it."""

from __future__ import annotations

from importlib.util import find_spec

from console.session.errors import SessionError
from profiles.problem import Problem


def require_extra(module: str, extra: str) -> None:
    """Refuse where the library of an optional part is not installed: SessionError `extra.missing`."""
    if find_spec(module) is None:
        raise SessionError(Problem(code="extra.missing", value=module, limit=f"pip install 'trilobe[{extra}]'"))
