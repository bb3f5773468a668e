"""Lines of SHDR, in which an adapter tells an MTConnect agent what has changed. Pure.

The protocol is that of the agent's documentation: fields with `|` between them, a timestamp first; a value with a
`|` in it is quoted, the `|` with a backslash before it.
"""

from __future__ import annotations

from console.site.exchange.conditions import NORMAL, TYPES, Condition
from console.site.exchange.data_items import UNAVAILABLE, Published

PING = b"* PING"


def pong_line(heartbeat_s: float) -> str:
    """Return the answer to a ping: how often the agent has to send one."""
    return f"* PONG {round(heartbeat_s * 1000)}"


def shdr_lines(now: Published, before: Published | None) -> list[str]:
    """Return the lines that take an agent from what it was told `before` to `now`; None: nothing yet."""
    told = {} if before is None else before.values
    changed = {key: value for key, value in now.values.items() if told.get(key) != value}
    pairs = [field for key, value in changed.items() for field in (key, value)]
    lines = [_line(now.at_utc, *pairs)] if pairs else []
    for key in TYPES:
        lines += _of_condition(key, now, before)
    return lines


def _of_condition(key: str, now: Published, before: Published | None) -> list[str]:
    """Return the lines of a condition. NORMAL without a code clears all of them, with a code that one."""
    if now.conditions is None:
        known = before is not None and before.conditions is None
        return [] if known else [_line(now.at_utc, key, UNAVAILABLE, "", "", "", "")]
    active = now.conditions[key]
    if before is None or before.conditions is None:
        anew = [_line(now.at_utc, key, NORMAL, "", "", "", "")]
        return anew + [_active_line(now.at_utc, key, each) for each in active]
    were, codes = before.conditions[key], {each.code for each in active}
    if were and not active:
        return [_line(now.at_utc, key, NORMAL, "", "", "", "")]
    ended = [_line(now.at_utc, key, NORMAL, each.code, "", "", "") for each in were if each.code not in codes]
    return ended + [_active_line(now.at_utc, key, each) for each in active if each not in were]


def _active_line(at_utc: str, key: str, each: Condition) -> str:
    return _line(at_utc, key, each.level, each.code, each.priority, "", each.text)


def _line(*fields: str) -> str:
    return "|".join(_field(each) for each in fields)


def _field(value: str) -> str:
    """Return a value as a field: on one line, and quoted where it could be taken for more than one field."""
    value = " ".join(value.split())
    if "|" not in value and not value.startswith('"'):
        return value
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("|", "\\|")
    return f'"{escaped}"'
