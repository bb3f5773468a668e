"""What a terminal sends that is no key, in a cut: its answers are dropped, and a key among them still stops."""

from __future__ import annotations

import pytest
from textual import constants, events
from textual._ansi_sequences import ANSI_SEQUENCES_KEYS

from console.tui.driver import Reader
from console.tui.gate import UNREADABLE

ANSWERS = {
    # By the control sequences of xterm, with what terminals are seen to answer.
    "background, ST": "\x1b]11;rgb:1c1c/1c1c/1c1c\x1b\\",
    "background, BEL": "\x1b]11;rgb:1c1c/1c1c/1c1c\x07",
    "palette": "\x1b]4;7;rgb:e5e5/e5e5/e5e5\x1b\\",
    "DA1, VT420": "\x1b[?64;1;2;6;9;15;16;17;18;21;22;28c",
    "DA1, tmux": "\x1b[?1;2c",
    "DA2, xterm": "\x1b[>41;377;0c",
    "DA2, PuTTY": "\x1b[>0;136;0c",
    "DA3": "\x1bP!|00000000\x1b\\",
    "XTVERSION": "\x1bP>|tmux 3.4\x1b\\",
    "XTGETTCAP": "\x1bP1+r544e=787465726d\x1b\\",
    "DECRQSS": "\x1bP1$r0m\x1b\\",
    "kitty's flags": "\x1b[?27u",
    "kitty's graphics": "\x1b_Gi=31;OK\x1b\\",
    "mode 2026": "\x1b[?2026;2$y",
    "mode 4": "\x1b[4;2$y",
    "status": "\x1b[0n",
    "colour scheme": "\x1b[?997;1n",
    "cursor": "\x1b[12;40R",
    "cursor, DECXCPR": "\x1b[?1;2R",
    "cursor, DECXCPR with page": "\x1b[?12;40;1R",
    "window": "\x1b[8;24;80t",
    "modifyOtherKeys": "\x1b[>4;2m",
    "sixel": "\x1b[?2;0;800;600S",
}
STOPS = [("\x1b[24~", "f12"), ("\x1b[27u", "escape"), (" ", "space")]
HALF_S = 0.5  # that a line takes its time within an answer
UNMISTAKABLE = 5  # characters after which every one of them is held for longer than a key


def keys_of(reader: Reader, typed: str, now_s: float) -> list[str]:
    said = [message for character in typed for message in reader.read(character, now_s)]
    said += reader.idle(now_s)
    return [each.key for each in said if isinstance(each, events.Key)]


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_that_nobody_waits_for_is_no_key_however_it_is_split(name: str) -> None:
    answer = ANSWERS[name]
    for split in range(len(answer) + 1):
        reader = Reader()
        assert keys_of(reader, answer[:split], 0.0) + keys_of(reader, answer[split:], 0.01) == [], split
        assert keys_of(reader, "x", 0.02) == ["x"]


@pytest.mark.parametrize("name", [name for name, answer in ANSWERS.items() if answer[1] + answer[2] != "[0"])
def test_an_answer_may_come_in_pieces_over_a_slow_line(name: str) -> None:
    answer = ANSWERS[name]
    if answer[2].isdigit() and answer[1] == "[":
        pytest.skip("it begins like a key: half of it is invalid input")
    for split in range(UNMISTAKABLE, len(answer)):
        if answer[split - 1] == "\x1b" or answer[split] == " ":
            continue  # after a pause these are pressed
        reader = Reader()
        assert keys_of(reader, answer[:split], 0.0) + keys_of(reader, answer[split:], HALF_S) == [], split


@pytest.mark.parametrize("name", ANSWERS)
@pytest.mark.parametrize(
    ("typed", "key"), [("\x1b[24~", "f12"), ("\x1b[27u", "escape"), (" ", "space"), ("x", "x")]
)
def test_a_key_before_between_and_after_answers_arrives(name: str, typed: str, key: str) -> None:
    answer = ANSWERS[name]
    assert keys_of(Reader(), typed + answer + typed + answer + typed, 0.0) == [key] * 3


@pytest.mark.parametrize("name", ANSWERS)
@pytest.mark.parametrize(("typed", "key"), STOPS)
def test_a_stop_key_within_an_unfinished_answer_stops(
    name: str, typed: str, key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(constants, "ESCAPE_DELAY", 0.0)
    answer = ANSWERS[name]
    for split in range(3, len(answer)):
        reader = Reader()
        for character in answer[:split]:
            reader.read(character, 0.0)
        assert key in keys_of(reader, typed, 0.3), split


@pytest.mark.parametrize("name", ANSWERS)
def test_a_bare_escape_within_an_unfinished_answer_stops(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(constants, "ESCAPE_DELAY", 0.0)
    reader = Reader()
    keys_of(reader, ANSWERS[name][:4], 0.0)
    said = keys_of(reader, "\x1b", 0.3) + keys_of(reader, "", 0.4) + keys_of(reader, "", 0.5)
    assert "escape" in said


@pytest.mark.parametrize("begun", ["\x1b]11;rgb:1c1c", "\x1b[?64;1", "\x1bP>|tmux", "\x1b_Gi=31"])
def test_an_answer_without_an_end_is_invalid_input_and_takes_no_more_keys(begun: str) -> None:
    reader = Reader()
    assert keys_of(reader, begun, 0.0) == []
    assert keys_of(reader, "", 0.9) == []
    assert keys_of(reader, "", 1.1) == [UNREADABLE]
    assert keys_of(reader, "x", 1.2) == ["x"]
    reader = Reader()
    assert UNREADABLE in keys_of(reader, begun + "y" * 500, 0.0), "nor does it become ever longer"


def test_no_key_that_is_known_is_taken_for_an_answer() -> None:
    nothing = [s for s in ANSI_SEQUENCES_KEYS if len(s) > 1 and not keys_of(Reader(), s, 0.0)]
    assert nothing == [s for s in nothing if s.startswith("\x1b\x1b") or s in ("\x1b[200~", "\x1b[201~")]


def test_an_answer_to_textual_reaches_it() -> None:
    reader = Reader()
    said = [message for character in ANSWERS["mode 2026"] for message in reader.read(character, 0.0)]
    assert [type(each).__name__ for each in said] == ["TerminalSupportsSynchronizedOutput"]


def test_the_cursor_is_heard_and_is_not_shift_f3() -> None:
    reader = Reader()
    assert keys_of(reader, "\x1b[1;2R", 0.0) == ["shift+f3"]
    said = [each for typed in ("\x1b[12;40R", "\x1b[?1;2R") for c in typed for each in reader.read(c, 0.0)]
    assert [(each.y + 1, each.x + 1) for each in said if isinstance(each, events.CursorPosition)] == [
        (12, 40),
        (1, 2),
    ]
