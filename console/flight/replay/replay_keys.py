"""Keys of a replay. Those of the machine do nothing here, and say so."""

from __future__ import annotations

from dataclasses import dataclass

from console.flight.playback import Playback
from console.text.catalogue import Catalogue
from console.tui.key_help import KEY_WIDTH
from console.tui.lines import BLANK, Line, dim, fitted, line, width_of, wrapped
from console.tui.theme import Token

LITTLE_S, MUCH_S = 10.0, 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayKey:
    """One action: its keys by their Textual names or characters, and how they are written."""

    id: str
    keys: tuple[str, ...]
    shown: str


KEYS = (
    ReplayKey(id="play", keys=("space",), shown="Space"),
    ReplayKey(id="back", keys=("left",), shown="←"),
    ReplayKey(id="on", keys=("right",), shown="→"),
    ReplayKey(id="minute_back", keys=("pageup",), shown="PgUp"),
    ReplayKey(id="minute_on", keys=("pagedown",), shown="PgDn"),
    ReplayKey(id="frame_back", keys=(",",), shown=","),
    ReplayKey(id="frame_on", keys=(".",), shown="."),
    ReplayKey(id="event_back", keys=("b", "ㅠ"), shown="b"),
    ReplayKey(id="event_on", keys=("n", "ㅜ"), shown="n"),
    ReplayKey(id="slower", keys=("-",), shown="-"),
    ReplayKey(id="faster", keys=("+", "="), shown="+"),
    ReplayKey(id="begin", keys=("home",), shown="Home"),
    ReplayKey(id="end", keys=("end",), shown="End"),
    ReplayKey(id="follow", keys=("f", "ㄹ"), shown="f"),
    ReplayKey(id="quit", keys=("q", "ㅂ", "ctrl+q"), shown="q"),
)

_ROW = (
    ("Space", "play"),
    ("←→", "seek"),
    (",.", "frame"),
    ("b n", "event"),
    ("+-", "speed"),
    ("f", "follow"),
    ("q", "quit"),
    ("?", "help"),
)


def key_of(key: str, character: str | None) -> ReplayKey | None:
    """Return the action of a key, None where it has none here."""
    return next((each for each in KEYS if key in each.keys or character in each.keys), None)


def move(playback: Playback, action: str) -> None:
    """Go to another time, or at another speed."""
    match action:
        case "play":
            playback.toggle()
        case "back" | "on":
            playback.seek(LITTLE_S if action == "on" else -LITTLE_S)
        case "minute_back" | "minute_on":
            playback.seek(MUCH_S if action == "minute_on" else -MUCH_S)
        case "frame_back" | "frame_on":
            playback.step(1 if action == "frame_on" else -1)
        case "event_back" | "event_on":
            playback.to_event(1 if action == "event_on" else -1)
        case "slower" | "faster":
            playback.change_speed(1 if action == "faster" else -1)
        case "begin" | "end":
            length_s = playback.recording.length_s
            playback.seek(length_s if action == "end" else -length_s)


def keys_line(text: Catalogue, width: int) -> Line:
    """Return the row of the keys, as far as they fit."""
    pieces: list[tuple[str, Token]] = [(" ", Token.TEXT)]
    for written, name in _ROW:
        fresh = [(written, Token.KEY), (f" {text(f'replay.key.{name}')}  ", Token.DIM)]
        if width_of((*pieces, *fresh)) > width + 2:
            break
        pieces += fresh
    return tuple(pieces)


def replay_help(text: Catalogue, width: int) -> list[Line]:
    """Return the list of the keys, and the marks of the time bar."""
    rows = [line((text("replay.help"), Token.TITLE))]
    pairs = [(each.shown, text(f"replay.help.{each.id}")) for each in KEYS]
    for shown, said in (*pairs, ("1-6 8", text("replay.help.pages")), ("! ■ ·", text("replay.help.marks"))):
        head, *more = wrapped(said, max(width - KEY_WIDTH, 1))
        rows.append(((fitted(shown, KEY_WIDTH), Token.KEY), *head))
        rows += [(dim(" " * KEY_WIDTH), *row) for row in more]
    return [*rows, BLANK, *(wrapped(text("replay.help.not_shown"), width, Token.DIM))]
