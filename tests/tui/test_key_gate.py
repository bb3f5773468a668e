"""What becomes of a key: stop first, then the field, then the page."""

from __future__ import annotations

import string
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.tui.gate import FieldKind, Situation, Verdict, is_stray, judge, stop_reason, stops_at_once
from console.tui.keymap import ACTIONS, DIGITS, KILL_KEYS, STOP_KEYS, PageName, action_of, actions_of

situations = st.builds(
    Situation,
    page=st.sampled_from(PageName),
    field=st.sampled_from(FieldKind),
    moving=st.booleans(),
    small=st.booleans(),
    reading=st.booleans(),
)
SCROLLS = {
    "up": "list.up",
    "down": "list.down",
    "pageup": "list.up",
    "pagedown": "list.down",
    "home": "list.first",
    "end": "list.last",
}
LETTERS = set(string.ascii_letters) | {chr(code) for code in range(0x3131, 0x3164)}


@given(situations)
def test_space_stops_everywhere_but_in_free_text(now: Situation) -> None:
    verdict, _ = judge("space", " ", now)
    writes = now.field is FieldKind.TEXT and not now.reading
    assert verdict is (Verdict.FIELD if writes else Verdict.STOP)


@given(situations, st.sampled_from(["f12", "escape"]))
def test_f12_and_escape_stop_everywhere(now: Situation, key: str) -> None:
    assert judge(key, None, now)[0] is Verdict.STOP
    assert stops_at_once(key, now)


@given(situations)
def test_escape_closes_a_list_of_keys_only_while_it_is_known_that_nothing_moves(now: Situation) -> None:
    helped = replace(now, reading=True, at_rest=True)
    closes = not now.moving and not now.small
    verdict, action = judge("escape", None, helped)
    assert verdict is (Verdict.ACTION if closes else Verdict.STOP)
    assert (action is not None and action.id) == ("close" if closes else False)
    assert judge("f12", None, helped)[0] is Verdict.STOP


@pytest.mark.parametrize("page", PageName)
def test_what_moves_is_not_stopped_by_a_key_that_has_a_meaning_but_by_a_change_of_mind(page: PageName) -> None:
    """Looking at another page is harmless; another jog, and the drives off, are no part of what goes on."""
    cutting = Situation(page=page, moving=True)
    everywhere = [action for action in ACTIONS if action.page is None]
    stopping = {
        action.id
        for action in (*everywhere, *actions_of(page))
        for key in action.keys
        if judge(key, key if len(key) == 1 else None, cutting)[0] is Verdict.STOP
    }
    jogs = {"in", "out", "chuck", "tail", "forward", "backward"}
    # The list of traces is closed in motion, so that its keys mean nothing then.
    of_list = {"up", "down", "page_up", "page_down", "first", "last", "path", "state", "direction", "mark"}
    expected = {
        PageName.ALIGN: {f"align.{way}" for way in (*jogs, "off")},
        PageName.INSPECT: {f"inspect.{way}" for way in of_list},
    }
    assert stopping == expected.get(page, set())


def test_a_jog_step_is_stopped_by_leaving_its_page_and_by_any_other_jog_key() -> None:
    jogging = Situation(page=PageName.ALIGN, moving=True, jogging=True, jog="align.in")
    verdicts = {key: judge(key, key, jogging)[0] for key in ("1", "4", "5", "down", "up", "left", "+", "-", "j")}
    kept = {"4", "down", "j"}
    assert {key for key, verdict in verdicts.items() if verdict is Verdict.ACTION} == kept
    assert {verdict for key, verdict in verdicts.items() if key not in kept} == {Verdict.STOP}


@pytest.mark.parametrize(
    ("key", "character", "reason"),
    [
        ("space", " ", "space"),
        ("f9", None, "f9"),
        ("x", "x", "unbound x"),
        ("f11", None, "unbound F11"),
        ("ctrl+t", "\x14", "unbound ctrl+t"),
        ("alt+d", "d", "unbound alt+d"),
        ("left", None, "change ←"),
        ("5", "5", "page 5"),
        ("paste", None, "paste"),
        ("unreadable", None, "unreadable"),
    ],
)
def test_a_stop_says_for_which_key_it_was(key: str, character: str | None, reason: str) -> None:
    jogging = Situation(page=PageName.ALIGN, moving=True, jogging=True, jog="align.in")
    verdict, action = judge(key, character, jogging)
    assert verdict in (Verdict.STOP, Verdict.KILL)
    assert stop_reason(key, character, action) == reason


@given(situations)
def test_f9_switches_the_drives_off_everywhere(now: Situation) -> None:
    assert judge("f9", None, now)[0] is Verdict.KILL


@given(situations, st.sampled_from("0123456789+-.,"))
def test_a_field_of_numbers_takes_what_numbers_are_written_with(now: Situation, character: str) -> None:
    if now.field is not FieldKind.NONE:
        verdict, action = judge(character, character, now)
        assert (verdict is Verdict.FIELD) is not now.reading, "behind a list that hides the entry nothing is typed"
        assert action is None


@given(situations, st.characters(categories=["L", "P", "S"], exclude_characters="+-.,"))
def test_what_no_number_is_written_with_spoils_the_entry_or_belongs_to_the_page(
    now: Situation, character: str
) -> None:
    """Nothing that was typed vanishes out of the middle of a number, and no key of every page acts there."""
    key = f"key_{ord(character)}"
    verdict, action = judge(key, character, now)
    if now.field is FieldKind.NUMBER and not now.reading:
        assert verdict is not Verdict.FIELD
        assert action is None or action.page is now.page or action.id in ("help", "messages")
        assert is_stray(key, character, now) is (verdict is Verdict.NOTHING)
    else:
        assert not is_stray(key, character, now)


def test_a_space_in_a_number_stops_and_spoils_the_entry() -> None:
    now = Situation(page=PageName.SETUP, field=FieldKind.NUMBER)
    assert judge("space", " ", now)[0] is Verdict.STOP and is_stray("space", " ", now)
    assert not is_stray("space", " ", Situation(page=PageName.SETUP))
    assert not is_stray("escape", "\x1b", now)


@given(situations, st.sampled_from(["alt+d", "ctrl+alt+x", "f11", "insert", "y", "ㅛ", "unknown"]))
def test_a_key_that_means_nothing_stops_what_moves(now: Situation, key: str) -> None:
    verdict, _ = judge(key, None, now)
    assert verdict is (Verdict.STOP if now.moving else Verdict.NOTHING)


@given(situations, st.sampled_from(sorted(SCROLLS)))
def test_while_a_list_is_read_the_keys_that_scroll_it_do_nothing_else(now: Situation, key: str) -> None:
    reading = replace(now, reading=True, small=False)
    verdict, action = judge(key, None, reading)
    assert verdict is Verdict.ACTION and action is not None
    assert action.id == SCROLLS[key] and not action.moves


seeking = situations.map(lambda now: replace(now, reading=True, seeking=True, field=FieldKind.TEXT))


@given(seeking, st.booleans())
def test_space_is_a_word_of_the_palette_only_while_it_is_known_that_nothing_moves(
    now: Situation, known: bool
) -> None:
    asked = replace(now, at_rest=known)
    types = known and not now.moving and not now.small
    assert judge("space", " ", asked)[0] is (Verdict.FIELD if types else Verdict.STOP)
    unfocused = replace(asked, field=FieldKind.NONE)
    assert judge("space", " ", unfocused)[0] is Verdict.STOP
    for key in ("f12", "escape"):
        closes = key == "escape" and types
        assert judge(key, None, asked)[0] is (Verdict.ACTION if closes else Verdict.STOP)
    assert judge("f9", None, asked)[0] is Verdict.KILL


@given(
    seeking,
    st.sampled_from(["a", "ㅋ", "5", "?", ":", "f6", "f4", "f11", "up", "enter", "tab", "backspace", "alt+d"]),
)
def test_nothing_of_the_page_is_done_behind_the_palette_and_in_motion_every_key_stops(
    now: Situation, key: str
) -> None:
    character = key if len(key) == 1 else None
    verdict, action = judge(key, character, now)
    if now.moving:
        assert verdict is Verdict.STOP and action is None
        assert stop_reason(key, character, action).startswith("unbound ")
    else:
        assert verdict in (Verdict.FIELD, Verdict.ACTION, Verdict.NOTHING)
        assert action is None or (action.page is None and not action.moves)
        assert (verdict is Verdict.FIELD) is (not now.small and (character is not None or key == "backspace"))


@given(situations)
def test_the_palette_is_no_stop_in_motion_and_opens_not_in_the_middle_of_an_entry(now: Situation) -> None:
    for key, character in ((":", ":"), ("colon", ":"), ("ctrl+p", "\x10")):
        verdict, action = judge(key, character, now)
        if now.field is FieldKind.NONE and not now.small:
            assert verdict is Verdict.ACTION and action is not None and action.id == "palette"
        else:
            assert action is None


def test_in_a_terminal_that_is_too_small_nothing_is_done_but_leaving() -> None:
    for page in PageName:
        for known in actions_of(page):
            verdict, found = judge(known.keys[0], None, Situation(page=page, small=True))
            assert verdict is Verdict.NOTHING and found is None
    assert judge("ctrl+q", None, Situation(page=PageName.JOBS, small=True))[0] is Verdict.ACTION


def test_nothing_that_moves_is_on_a_letter_on_enter_or_on_a_digit() -> None:
    for action in ACTIONS:
        if action.moves:
            assert not set(action.keys) & (LETTERS | set(string.digits) | {"enter", "tab"}), action.id


def test_no_key_has_two_meanings_on_a_page() -> None:
    everywhere = [action for action in ACTIONS if action.page is None]
    for page in PageName:
        keys = [key for action in (*everywhere, *actions_of(page)) for key in action.keys]
        assert len(keys) == len(set(keys)), page
        assert not set(keys) & {*STOP_KEYS, *KILL_KEYS}


def test_a_letter_works_on_a_hangul_layout_too() -> None:
    """The jamo on the same place of the keyboard (KS X 5002)."""
    places = dict(
        zip("abcdefghijklmnopqrstuvwxyz", "ㅁㅠㅊㅇㄷㄹㅎㅗㅑㅓㅏㅣㅡㅜㅐㅔㅂㄱㄴㅅㅕㅍㅈㅌㅛㅋ", strict=True)
    )
    for action in ACTIONS:
        for key in action.keys:
            if key in places:
                assert places[key] in action.keys, action.id


def test_a_digit_leads_to_its_page() -> None:
    for page, digit in DIGITS.items():
        action = action_of(digit, digit, PageName.RUN)
        assert action is not None and action.id == f"page.{page}"
