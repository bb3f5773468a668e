"""The user buffer in a backup: found where the controller says, every word of it kept, sent and compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.commissioning.backup import backup_text, read_backup, typed_lines
from drivers.commissioning.comparison import differences
from drivers.commissioning.configuration import Configuration
from drivers.commissioning.reading import read_configuration, whole_card
from drivers.commissioning.restoring import left_differing, refuse_other_memory, restore, restore_lines
from drivers.commissioning.user_buffer import UserWords, read_place, read_words, word_lines
from drivers.errors import LinkError, RefusedError
from drivers.pmac.dialect import DIALECTS
from profiles.findings import Severity
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from tests.drivers.commissioned import Commissioned, commissioned
from tests.drivers.families import ON_ONE, of_family
from tests.drivers.families import machine as machine  # both families

LAST = {"pmac": 0x9FFF, "turbo": 0x107FF}
"""Where the memory for buffers ends: PMAC Software Reference, Memory Map; Turbo Software Reference, I4908."""

DATE = "2026-03-01T12:00:00+00:00"
WORD = st.one_of(st.sampled_from((0, 1, 0x800000, 0xFFFFFF)), st.integers(0, 0xFFFFFF))


def plain(family: str, **changes: object) -> Configuration:
    """A configuration of which only the user buffer matters."""
    kind, read = DIALECTS[family].type_prefix, Configuration(family=family, kind="X", version="1.0", settings={})
    return replace(read, kind=kind, values={}, **changes)  # type: ignore[arg-type]


def read(card: Commissioned, *, values: bool = True) -> Configuration:
    """The user buffer, and what takes no time; the values of P, Q and M are not asked for."""
    extent = replace(whole_card(card.dialect), settings=(), pointers=(), motors=(1,), plcs=(), programs=())
    found = read_configuration(card.client, card.dialect, extent)
    words = read_words(card.client, found.user_buffer) if values and found.user_buffer else None
    return replace(found, values={} if values else None, user_words=words)


def words_of(card: Commissioned, space: str, first: int, count: int) -> list[int]:
    (text,) = card.client.request(f"RH{space}:${first:X},{count}")
    return [int(word, 16) for word in text.split()]


def test_it_is_read_where_the_controller_says(machine: MachineProfile) -> None:
    card = commissioned(machine)
    last = LAST[card.dialect.name]
    assert read_place(card.client, card.dialect) == range(last + 1, last + 1)
    card.tell("DEFINE UBUFFER 35", f"WX:${last - 34:X},$ABCDEF", f"WY:${last:X},7")
    place = read_place(card.client, card.dialect)
    assert place == range(last - 34, last + 1)
    found = read_words(card.client, place)
    assert found == UserWords(x=(0xABCDEF, *[0] * 34), y=(*[0] * 34, 7))


def test_a_backup_is_sent_to_a_fresh_controller_and_to_one_with_other_words(machine: MachineProfile) -> None:
    card = commissioned(machine)
    first = LAST[card.dialect.name] - 299
    card.tell("DEFINE UBUFFER 300", f"WX:${first:X},1,2,3", f"WY:${first + 299:X},$FFFFFF")
    card.tell(f"M9->L:${first + 100:X}", "M9=-2.5")
    text = backup_text(read(card), DATE)
    backup = read_backup(text, "file")
    assert backup_text(backup.configuration, DATE) == text

    for before in ([], ["DEFINE UBUFFER 300", f"WX:${first + 5:X},9,9,9"], ["DEFINE UBUFFER 1000"]):
        other = commissioned(machine)
        other.tell("#1DEFINE COMP 4,#2,#1,10000", "1 2 3 4", *before)
        now = read(other)
        refuse_other_memory(backup, now, "here")
        lines = restore_lines(text, backup, now)
        assert ("DEFINE UBUFFER 300" in lines) == (len(now.user_buffer or ()) != 300)
        restore(other.client, other.dialect, lines)
        assert backup_text(read(other), DATE) == text
        assert words_of(other, "X", first, 8) == [1, 2, 3, 0, 0, 0, 0, 0]
        assert words_of(other, "Y", first + 299, 1) == [0xFFFFFF]
        assert other.client.numbers(f"RL:${first + 100:X}") == (-2.5,)
        assert left_differing(backup.configuration, read(other), machine) == []


def test_a_controller_loses_a_buffer_that_the_backup_does_not_have(machine: MachineProfile) -> None:
    card = commissioned(machine)
    text = backup_text(read(card), DATE)
    backup = read_backup(text, "file")
    card.tell("DEFINE UBUFFER 20")
    now = read(card)
    (found,) = left_differing(backup.configuration, now, machine)
    assert (found.facts["what_changed"], found.found, found.wanted) == ("UBUFFER", "20", "0")
    restore(card.client, card.dialect, restore_lines(text, backup, now))
    assert not read(card).user_buffer


def test_an_older_backup_leaves_the_user_buffer_alone(machine: MachineProfile) -> None:
    """It does not say whether there was one."""
    card = commissioned(machine)
    older = read_backup(backup_text(replace(read(card), user_buffer=None), DATE), "file")
    assert older.configuration.user_buffer is None
    card.tell("DEFINE UBUFFER 20")
    now = read(card)
    refuse_other_memory(older, now, "here")
    assert not any("UBUFFER" in line for line in restore_lines("", older, now))
    assert left_differing(older.configuration, now, machine) == []


def test_the_size_is_compared_without_values_and_each_word_with_them(machine: MachineProfile) -> None:
    card = commissioned(machine)
    last = LAST[card.dialect.name]
    card.tell("DEFINE UBUFFER 16")
    before = read(card)
    card.tell(f"WX:${last - 15:X},$10", f"WY:${last:X},2")
    now = read(card)
    assert differences(before, now, machine) == [], "words are data, as P-variables are"
    found = [
        (each.facts["what_changed"], each.found, each.wanted) for each in left_differing(before, now, machine)
    ]
    assert found == [(f"X:${last - 15:X}", "$10", "$0"), (f"Y:${last:X}", "$2", "$0")]
    card.tell("DEFINE UBUFFER 48")
    (size,) = differences(before, read(card, values=False), machine)
    assert (size.facts["what_changed"], size.found, size.wanted) == ("UBUFFER", "48", "16")
    assert before.fingerprint == now.fingerprint == read(card).fingerprint


@given(st.sampled_from(sorted(DIALECTS)), st.lists(st.tuples(WORD, WORD), max_size=70))
def test_any_words_come_back(family: str, pairs: list[tuple[int, int]]) -> None:
    end = LAST[family] + 1
    place = range(end - len(pairs), end)
    x, y = (tuple(pair[part] for pair in pairs) for part in (0, 1))
    words = UserWords(x=x, y=y) if pairs else None
    text = backup_text(plain(family, user_buffer=place, user_words=words), DATE)
    found = read_backup(text, "file").configuration
    assert (found.user_buffer, found.user_words) == (place, words)
    assert backup_text(found, DATE) == text
    if words is not None:
        assert set(word_lines(place, words)) <= set(typed_lines(text))
        assert max(map(len, word_lines(place, words))) < 255, "a controller takes no longer line"


CHANGES: dict[str, Callable[[str], str]] = {
    "a word that is missing": lambda text: text.replace(",$21\n", "\n"),
    "a line that is missing": lambda text: "".join(line for line in text.splitlines(True) if "WX" not in line),
    "a line twice": lambda text: text.replace("WX", "WX:$9FFE,$1\nWX"),
    "another address": lambda text: text.replace("WY:$9FFE", "WY:$9FF0"),
    "another size": lambda text: text.replace("DEFINE UBUFFER 2", "DEFINE UBUFFER 20000"),
    "another end": lambda text: text.replace("2 words", "3 words"),
    "more than there is": lambda text: text.replace("2 words from $9FFE", "40958 words from $2"),
    "no definition": lambda text: text.replace("DEFINE UBUFFER 2\n", ""),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_backup_that_does_not_fit_together_is_refused(change: Callable[[str], str]) -> None:
    from drivers.commissioning.backup import END_OF_HEADER
    from drivers.commissioning.configuration import digest

    words = UserWords(x=(1, 0x21), y=(3, 4))
    text = backup_text(plain("pmac", user_buffer=range(0x9FFE, 0xA000), user_words=words), DATE)
    assert read_backup(text, "file").configuration.user_words == words
    changed = change(text)
    assert changed != text
    head, body = changed.split(f"{END_OF_HEADER}\n")
    signed = head.replace(head.split("; sha256 ")[1].strip(), digest(body.splitlines()))
    with pytest.raises(ProfileError) as caught:
        read_backup(f"{signed}{END_OF_HEADER}\n{body}", "file")
    assert caught.value.problems[0].code == "controller.backup_line"


def answering(card: Commissioned, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    """What this controller answers when it is asked for the beginning of its user buffer."""
    client, asked = card.client, card.client.question
    place = card.dialect.user_buffer
    assert place is not None
    line = f"RHX:${place.x_address:X}" if place.setting is None else f"I{place.setting}"

    def question(text: str, *rest: object, **more: object) -> tuple[str, ...]:
        return (answer,) if text == line else asked(text, *rest, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(client, "question", question)


@pytest.mark.parametrize("answer", ["$5", "$FFFFFF"])
def test_a_place_outside_of_memory_is_refused_where_its_words_are_wanted(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch, answer: str
) -> None:
    card = commissioned(machine)
    answering(card, monkeypatch, answer.removeprefix("$") if card.dialect.name == "pmac" else answer)
    with pytest.raises(RefusedError) as caught:
        read_configuration(card.client, card.dialect, whole_card(card.dialect, values=True))
    assert caught.value.problems[0].code == "controller.user_buffer"
    now = read(card, values=False)
    assert now.user_buffer is None, "what does not need it continues without"
    monkeypatch.undo()
    (said,) = differences(read(card, values=False), now, card.machine)
    shown = answer.removeprefix("$") if card.dialect.name == "pmac" else answer
    assert (said.code, said.severity, said.found) == ("user_buffer_misplaced", Severity.REFUSAL, shown)


def test_an_answer_that_is_no_number_is_out_of_step(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = commissioned(machine)
    answering(card, monkeypatch, "what?")
    with pytest.raises(LinkError) as caught:
        read(card)
    assert caught.value.problems[0].code == "link.out_of_step"


def test_a_controller_without_the_word_has_none_in_its_backup(machine: MachineProfile) -> None:
    card = commissioned(machine)
    dialect = replace(card.dialect, user_buffer=replace(card.dialect.user_buffer, setting=9999))  # type: ignore[type-var]
    assert read_place(card.client, dialect) is None
    text = backup_text(replace(read(card), user_buffer=None), DATE)
    assert "user buffer:" not in text and "UBUFFER" not in text


@ON_ONE
def test_a_turbo_with_extended_memory_ends_elsewhere(
    machine: MachineProfile, monkeypatch: pytest.MonkeyPatch
) -> None:
    card = commissioned(of_family(machine, "turbo"))
    card.tell("DEFINE UBUFFER 2")
    backup = read_backup(backup_text(read(card), DATE), "file")
    answering(card, monkeypatch, "$3FF00")
    place = read_place(card.client, card.dialect)
    assert place == range(0x3FF00, 0x40000)
    with pytest.raises(RefusedError) as caught:
        refuse_other_memory(backup, replace(backup.configuration, user_buffer=place), "here")
    problem = caught.value.problems[0]
    assert (problem.code, problem.value, problem.limit) == ("controller.user_buffer_end", "$3FFFF", "$107FF")
