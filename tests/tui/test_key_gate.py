"""What becomes of a key: stop first, then the field, then the page."""

from __future__ import annotations

import string
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from textual.events import Key

from console.tui.application.scans import LONGEST, find_job, job_named, keys_of, printable_code
from console.tui.driver import Reader
from console.tui.gate import FieldKind, KeyDecision, KeySituation, is_stray, judge, stop_reason, stops_at_once
from console.tui.keymap import ACTIONS, DIGITS, KILL_KEYS, STOP_KEYS, PageName, action_of, actions_of
from console.tui.pace import APART_S, QUIET_S, KeyPace, Scan, ScanCollector
from profiles.problem import Problem
from profiles.store import LibraryEntry

situations = st.builds(
    KeySituation,
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
def test_space_stops_everywhere_but_in_free_text(now: KeySituation) -> None:
    verdict, _ = judge("space", " ", now)
    writes = now.field is FieldKind.TEXT and not now.reading
    assert verdict is (KeyDecision.FIELD if writes else KeyDecision.STOP)


@given(situations, st.sampled_from(["f12", "escape"]))
def test_f12_and_escape_stop_everywhere(now: KeySituation, key: str) -> None:
    assert judge(key, None, now)[0] is KeyDecision.STOP
    assert stops_at_once(key, now)


@given(situations)
def test_escape_closes_a_list_of_keys_only_while_it_is_known_that_nothing_moves(now: KeySituation) -> None:
    helped = replace(now, reading=True, at_rest=True)
    closes = not now.moving and not now.small
    verdict, action = judge("escape", None, helped)
    assert verdict is (KeyDecision.ACTION if closes else KeyDecision.STOP)
    assert (action is not None and action.id) == ("close" if closes else False)
    assert judge("f12", None, helped)[0] is KeyDecision.STOP


@pytest.mark.parametrize("page", PageName)
def test_what_moves_is_not_stopped_by_a_key_that_has_a_meaning_but_by_a_change_of_mind(page: PageName) -> None:
    """Looking at another page is harmless; another jog, and the drives off, are no part of what goes on."""
    cutting = KeySituation(page=page, moving=True)
    everywhere = [action for action in ACTIONS if action.page is None]
    stopping = {
        action.id
        for action in (*everywhere, *actions_of(page))
        for key in action.keys
        if judge(key, key if len(key) == 1 else None, cutting)[0] is KeyDecision.STOP
    }
    jogs = {"in", "out", "chuck", "tail", "forward", "backward"}
    # The list of traces is closed in motion, so that its keys mean nothing then.
    of_list = {"up", "down", "page_up", "page_down", "first", "last", "path", "state", "direction", "mark"}
    of_list |= {"height", "together"}
    expected = {
        PageName.ALIGN: {f"align.{way}" for way in (*jogs, "off")},
        PageName.INSPECT: {f"inspect.{way}" for way in of_list},
    }
    assert stopping == expected.get(page, set())


def test_a_jog_step_is_stopped_by_leaving_its_page_and_by_any_other_jog_key() -> None:
    jogging = KeySituation(page=PageName.ALIGN, moving=True, jogging=True, jog="align.in")
    verdicts = {key: judge(key, key, jogging)[0] for key in ("1", "4", "5", "down", "up", "left", "+", "-", "j")}
    kept = {"4", "down", "j"}
    assert {key for key, verdict in verdicts.items() if verdict is KeyDecision.ACTION} == kept
    assert {verdict for key, verdict in verdicts.items() if key not in kept} == {KeyDecision.STOP}


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
    jogging = KeySituation(page=PageName.ALIGN, moving=True, jogging=True, jog="align.in")
    verdict, action = judge(key, character, jogging)
    assert verdict in (KeyDecision.STOP, KeyDecision.KILL)
    assert stop_reason(key, character, action) == reason


@given(situations)
def test_f9_switches_the_drives_off_everywhere(now: KeySituation) -> None:
    assert judge("f9", None, now)[0] is KeyDecision.KILL


@given(situations, st.sampled_from("0123456789+-.,"))
def test_a_field_of_numbers_takes_what_numbers_are_written_with(now: KeySituation, character: str) -> None:
    if now.field is not FieldKind.NONE:
        verdict, action = judge(character, character, now)
        assert (verdict is KeyDecision.FIELD) is not now.reading, (
            "behind a list that hides the entry nothing is typed"
        )
        assert action is None


@given(situations, st.characters(categories=["L", "P", "S"], exclude_characters="+-.,"))
def test_what_no_number_is_written_with_spoils_the_entry_or_belongs_to_the_page(
    now: KeySituation, character: str
) -> None:
    """Nothing that was typed vanishes out of the middle of a number, and no key of every page acts there."""
    key = f"key_{ord(character)}"
    verdict, action = judge(key, character, now)
    if now.field is FieldKind.NUMBER and not now.reading:
        assert verdict is not KeyDecision.FIELD
        assert action is None or action.page is now.page or action.id in ("help", "messages")
        assert is_stray(key, character, now) is (verdict is KeyDecision.NOTHING)
    else:
        assert not is_stray(key, character, now)


def test_a_space_in_a_number_stops_and_spoils_the_entry() -> None:
    now = KeySituation(page=PageName.SETUP, field=FieldKind.NUMBER)
    assert judge("space", " ", now)[0] is KeyDecision.STOP and is_stray("space", " ", now)
    assert not is_stray("space", " ", KeySituation(page=PageName.SETUP))
    assert not is_stray("escape", "\x1b", now)


@given(situations, st.sampled_from(["alt+d", "ctrl+alt+x", "f11", "insert", "y", "ㅛ", "unknown"]))
def test_a_key_that_means_nothing_stops_what_moves(now: KeySituation, key: str) -> None:
    verdict, _ = judge(key, None, now)
    assert verdict is (KeyDecision.STOP if now.moving else KeyDecision.NOTHING)


@given(situations, st.sampled_from(sorted(SCROLLS)))
def test_while_a_list_is_read_the_keys_that_scroll_it_do_nothing_else(now: KeySituation, key: str) -> None:
    reading = replace(now, reading=True, small=False)
    verdict, action = judge(key, None, reading)
    assert verdict is KeyDecision.ACTION and action is not None
    assert action.id == SCROLLS[key] and not action.moves


seeking = situations.map(lambda now: replace(now, reading=True, seeking=True, field=FieldKind.TEXT))


@given(seeking, st.booleans())
def test_space_is_a_word_of_the_palette_only_while_it_is_known_that_nothing_moves(
    now: KeySituation, known: bool
) -> None:
    asked = replace(now, at_rest=known)
    types = known and not now.moving and not now.small
    assert judge("space", " ", asked)[0] is (KeyDecision.FIELD if types else KeyDecision.STOP)
    unfocused = replace(asked, field=FieldKind.NONE)
    assert judge("space", " ", unfocused)[0] is KeyDecision.STOP
    for key in ("f12", "escape"):
        closes = key == "escape" and types
        assert judge(key, None, asked)[0] is (KeyDecision.ACTION if closes else KeyDecision.STOP)
    assert judge("f9", None, asked)[0] is KeyDecision.KILL


@given(
    seeking,
    st.sampled_from(["a", "ㅋ", "5", "?", ":", "f6", "f4", "f11", "up", "enter", "tab", "backspace", "alt+d"]),
)
def test_nothing_of_the_page_is_done_behind_the_palette_and_in_motion_every_key_stops(
    now: KeySituation, key: str
) -> None:
    character = key if len(key) == 1 else None
    verdict, action = judge(key, character, now)
    if now.moving:
        assert verdict is KeyDecision.STOP and action is None
        assert stop_reason(key, character, action).startswith("unbound ")
    else:
        assert verdict in (KeyDecision.FIELD, KeyDecision.ACTION, KeyDecision.NOTHING)
        assert action is None or (action.page is None and not action.moves)
        assert (verdict is KeyDecision.FIELD) is (not now.small and (character is not None or key == "backspace"))


@given(situations)
def test_the_palette_is_no_stop_in_motion_and_opens_not_in_the_middle_of_an_entry(now: KeySituation) -> None:
    for key, character in ((":", ":"), ("colon", ":"), ("ctrl+p", "\x10")):
        verdict, action = judge(key, character, now)
        if now.field is FieldKind.NONE and not now.small:
            assert verdict is KeyDecision.ACTION and action is not None and action.id == "palette"
        else:
            assert action is None


def test_in_a_terminal_that_is_too_small_nothing_is_done_but_leaving() -> None:
    for page in PageName:
        for known in actions_of(page):
            verdict, found = judge(known.keys[0], None, KeySituation(page=page, small=True))
            assert verdict is KeyDecision.NOTHING and found is None
    assert judge("ctrl+q", None, KeySituation(page=PageName.JOBS, small=True))[0] is KeyDecision.ACTION


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


# Keys at the pace of a scanner do nothing, those of a person are taken; with a clock that is given.


SCANNED = ("W", "O", "-", "1", "0", "0", "2", "4", "enter")
LATER_S = QUIET_S + 0.01


def taken(*presses: tuple[float, str]) -> list[str]:
    """The actions that are taken of keys at these times, s; each is asked for as soon as it may be due."""
    pace, done = KeyPace[str](), list[str]()
    for at_s, key in presses:
        # The thread sleeps until something is due, or the next key comes.
        done += pace.take_due_keys(at_s - 1e-6)
        pace.hold(key, key, at_s)
    return [*done, *pace.take_due_keys(presses[-1][0] + 1.0)]


@pytest.mark.parametrize("gap_s", [0.0, 0.001, 0.008, 0.016, 0.03])
def test_of_a_scanned_number_nothing_is_taken_neither_its_first_key_nor_its_last(gap_s: float) -> None:
    assert taken(*((gap_s * n, key) for n, key in enumerate(SCANNED))) == []


@pytest.mark.parametrize("gap_s", [0.06, 0.1, 0.5])
def test_of_a_person_every_key_is_taken(gap_s: float) -> None:
    assert taken(*((gap_s * n, key) for n, key in enumerate(SCANNED))) == list(SCANNED)


@pytest.mark.parametrize("gap_s", [0.0, 0.01, 0.03, 0.09])
def test_a_key_that_is_held_down_is_no_scanner(gap_s: float) -> None:
    assert taken(*((gap_s * n, "down") for n in range(10))) == ["down"] * 10


def test_an_enter_that_a_slow_line_brings_behind_the_burst_is_not_taken() -> None:
    burst = [(0.0, "1"), (0.0, "4"), (0.2, "enter")]
    assert taken(*burst) == []
    assert taken(*burst, (LATER_S, "enter")) == ["enter"]


def test_two_keys_of_a_person_in_one_piece_are_pressed_again() -> None:
    assert taken((0.0, "down"), (0.0, "enter"), (LATER_S, "down"), (LATER_S + 0.2, "enter")) == ["down", "enter"]


def test_an_action_waits_until_it_is_known_to_have_come_alone() -> None:
    pace = KeyPace[str]()
    assert not pace.hold("4", "page 4", 10.0)
    assert pace.take_due_keys(10.0 + 0.9 * APART_S) == []
    assert pace.wait_s(10.0, 0.1) == pytest.approx(APART_S)
    assert pace.take_due_keys(10.0 + APART_S) == ["page 4"]
    assert pace.take_due_keys(11.0) == []
    assert pace.wait_s(11.0, 0.1) == 0.1


def test_a_thread_that_was_held_up_takes_no_key_for_alone_before_it_has_read_the_rest() -> None:
    pace = KeyPace[str]()
    pace.hold("4", "4", 0.0)
    # It comes late: what it reads now may have come close behind.
    assert pace.hold("enter", "enter", 0.3)
    assert pace.take_due_keys(1.0) == []


@pytest.mark.parametrize("apart_s", [0.0, 0.03])
def test_an_action_close_to_a_stop_is_not_taken(apart_s: float) -> None:
    before, behind = KeyPace[str](), KeyPace[str]()
    before.hold("f6", "f6", 0.0)
    assert before.hear("space", apart_s)
    assert before.take_due_keys(1.0) == []
    behind.hear("space", 0.0)
    assert behind.hold("f6", "f6", apart_s)
    assert behind.take_due_keys(1.0) == []


def test_what_a_scanner_writes_into_a_field_is_not_ended_by_its_enter() -> None:
    pace = KeyPace[str]()
    told = [pace.write(key, 0.01 * n, character=True) for n, key in enumerate("10024")]
    assert told == [False, False, True, True, True]
    assert pace.hold("enter", "enter", 0.05)
    assert pace.hold("enter", "enter", 0.05 + 0.9 * QUIET_S)
    assert not pace.hold("enter", "enter", 0.05 + LATER_S)


def test_what_a_person_writes_into_a_field_is_ended_by_enter() -> None:
    pace = KeyPace[str]()
    # Two characters in one piece: a slow line, or a fast hand.
    told = [pace.write(key, at_s, character=True) for key, at_s in zip("1314", (0.0, 0.1, 0.11, 0.2), strict=True)]
    assert told == [False] * 4
    assert not pace.hold("enter", "enter", 0.3)
    assert pace.take_due_keys(0.4) == ["enter"]


def test_a_backspace_that_is_held_down_in_a_field_is_no_scanner() -> None:
    pace = KeyPace[str]()
    assert not any(pace.write("backspace", 0.03 * n, character=False) for n in range(20))


@given(st.lists(st.tuples(st.floats(0.0, 0.2), st.sampled_from("14jk"))))
def test_what_is_taken_had_no_other_key_close_to_it(gaps: list[tuple[float, str]]) -> None:
    pace, at_s, heard, done = (
        KeyPace[tuple[str, float]](),
        0.0,
        list[tuple[str, float]](),
        list[tuple[str, float]](),
    )
    for gap_s, key in gaps:
        at_s += gap_s
        done += pace.take_due_keys(at_s - 1e-6)
        pace.hold(key, (key, at_s), at_s)
        heard.append((key, at_s))
    done += pace.take_due_keys(at_s + 1.0)
    for key, taken_s in done:
        assert all(other == key or abs(other_s - taken_s) > 0.9 * APART_S for other, other_s in heard)


# A code of a scanner: put together from keys that did nothing; `job:NAME` names a job, the rest means nothing.


FAST_S = 0.004


def heard(*pieces: tuple[float, str], gap_s: float = FAST_S) -> list[Scan]:
    """What is made of pieces of terminal input, each at its time, its characters a moment apart."""
    pace, codes = KeyPace[str](), ScanCollector()
    said: list[Scan | None] = []
    reader, at_s = Reader(), 0.0
    for begin_s, piece in pieces:
        at_s = max(at_s, begin_s)
        said.append(codes.take_due_scan(at_s))
        pace.take_due_keys(at_s - 1e-6)  # what was held back was done meanwhile
        for character in piece:
            at_s += gap_s
            for event in reader.read(character, at_s):
                assert isinstance(event, Key)
                burst = pace.hold(event.key, event.key, at_s)
                said.append(
                    codes.hear(event.key, event.character, at_s, burst=burst, written=False, stopped=False)
                )
    said.append(codes.take_due_scan(at_s + 10.0))
    return [each for each in said if each is not None]


@pytest.mark.parametrize("end", ["", "\r", "\n", "\r\n", "\t"])
@pytest.mark.parametrize("gap_s", [0.0, 0.01, 0.03])
def test_the_whole_code_is_there_however_it_ends(end: str, gap_s: float) -> None:
    assert [each.text for each in heard((0.0, f"job:flange-1{end}"), gap_s=gap_s)] == ["job:flange-1"]


def test_two_pieces_of_a_slow_line_are_one_code() -> None:
    assert [each.text for each in heard((0.0, "job:fla"), (0.3, "nge-1\r"))] == ["job:flange-1"]


def test_two_codes_in_a_row_are_two() -> None:
    assert [each.text for each in heard((0.0, "job:one\r\njob:two\r\n"))] == ["job:one", "job:two"]


def test_a_person_scans_nothing() -> None:
    assert heard(*((0.2 * n, key) for n, key in enumerate("job:flange-1\r"))) == []
    assert heard((0.0, "14")) == []  # two keys in one piece


def test_arrows_and_function_keys_are_no_code() -> None:
    assert heard((0.0, "\x1b[A\x1b[B1234\r")) == []


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("job:flange-1", "flange-1"),
        ("JOB:FLANGE-1", "FLANGE-1"),
        ("job: flange-1 ", "flange-1"),
        ("ㅓㅐㅠ:리뭏ㄷ-1", "flange-1"),
        ("ㅓㅐㅠ:flange-1", "flange-1"),
        ("job:플랜지", "플랜지"),
        ("b:flange-1", None),
        ("flange-1", None),
        ("job:", None),
        ("WO-10024", None),
    ],
)
def test_only_a_whole_prefix_names_a_job(code: str, name: str | None) -> None:
    assert job_named(code) == name


def test_the_keys_of_the_hangul_layout() -> None:
    """The two-set layout of KS X 5002: the key q writes ㅂ, and a syllable is written by two to five keys."""
    assert keys_of("ㅂㅈㄷㄱㅅ") == "qwert"
    assert keys_of("한글") == "gksrmf"
    assert keys_of("닭뷁괜찮다") == "ekfrqnpfrrhoscksgek"
    assert keys_of("ㅃㅖ-1") == "QP-1"


def entries(*names: str) -> list[LibraryEntry]:
    return [LibraryEntry(name=name, path=Path(f"{name}.toml"), bundled=False) for name in names]


def test_a_name_is_found_as_written_else_in_whatever_case() -> None:
    jobs = entries("flange-1", "Flange-2", "FLANGE-2", "ring")
    for name, expected in (("flange-1", "flange-1"), ("RING", "ring"), ("FLANGE-2", "FLANGE-2")):
        entry = find_job(jobs, name)
        assert isinstance(entry, LibraryEntry) and entry.name == expected
    for name, code in (("flange-2", "screen.scanned_several"), ("flange", "screen.scanned_no_job")):
        problem = find_job(jobs, name)
        assert isinstance(problem, Problem) and problem.code == code


def test_a_name_in_hangul_is_not_taken_for_its_keys() -> None:
    entry = find_job(entries("플랜지", "vmffoswl"), "플랜지")
    assert isinstance(entry, LibraryEntry) and entry.name == "플랜지"


def test_what_is_shown_is_harmless_and_short() -> None:
    assert "\x1b" not in printable_code("job:\x1b[2J")
    assert len(printable_code("x" * 500)) == LONGEST
