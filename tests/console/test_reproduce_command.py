"""`console reproduce`: the paper beside ours."""

from __future__ import annotations

from functools import cache

import pytest

from console.cli.measured import comparison
from profiles.paper.experiments import lee_2001
from profiles.paper.record import Record, Section
from profiles.paper.reproduction import sections
from tests.console.commands import Console


@pytest.fixture
def console_without_numerics(console: Console, monkeypatch: pytest.MonkeyPatch) -> Console:
    """The sections computed once; they are tested elsewhere."""
    monkeypatch.setattr(comparison, "sections", lambda _: computed())
    return console


@cache
def computed() -> tuple[Section, ...]:
    return tuple(sections(lee_2001()))


@pytest.mark.parametrize("language", ["en", "ko"])
def test_every_row_has_its_sentence_and_its_reason(console_without_numerics: Console, language: str) -> None:
    """A key without a sentence shows itself."""
    said = console_without_numerics("reproduce", "--quick", "--plot", "--lang", language)
    assert said.code == 0
    assert "reproduce." not in said.out
    assert "55.25 Hz" in said.out and "80 Hz" in said.out and "✗" in said.out
    assert "⠉" in said.out, "the figures"
    assert "1, 5, 6, 7, 8, 9" in said.out.splitlines()[-1], "what was left out is told"


def test_json_is_not_rounded_and_has_the_curves(console_without_numerics: Console) -> None:
    found = console_without_numerics("reproduce", "--quick", "--json").json
    by_name = {record["name"]: record for section in found["sections"] for record in section["records"]}
    assert by_name["eq9.overshoot"]["ours"] == pytest.approx(2.309, abs=1e-3)
    assert len(str(by_name["eq9.overshoot"]["ours"])) > 10
    assert by_name["slip.concluded"]["holds"] is False and "27 um" in by_name["slip.concluded"]["why"]
    assert {figure["name"] for section in found["sections"] for figure in section["figures"]} >= {"fig3", "fig12"}
    assert found["acceptance"] == {"2": True, "3": True, "4": True, "10": True, "11": True, "12": True}


def test_a_missed_number_is_the_exit_code(console: Console, monkeypatch: pytest.MonkeyPatch) -> None:
    missed = Record(name="accept.servo", at="gain", ours=0.5, expected=0.7455, tolerance=0.0037, number=2)
    monkeypatch.setattr(comparison, "sections", lambda _: (Section(name="acceptance", records=(missed,)),))
    assert console("reproduce", "--quick").code == 1


def test_what_tells_nothing_of_the_paper_is_marked_and_counted_apart(console_without_numerics: Console) -> None:
    said = console_without_numerics("reproduce", "--quick").out
    rows = {
        line.split("  ")[0]: line.split()[-1] for line in said.splitlines() if line.startswith(("Fig", "Table"))
    }
    assert rows["Fig 4: undulations of the deflection per revolution"] == "≡"
    assert rows["Fig 5a: variation of 35 mm over that of 68 mm"] == "✗"
    assert rows["Table 5: amplitude error, 50 Hz, fitted loop"] == "(✓)"
    assert rows["Table 5: phase error, 10 Hz, fitted loop"] == "(✗)"
    counted = next(line for line in said.splitlines() if "Counted separately" in line)
    assert rows["Fig 11: bandwidth, as the controller samples it"] == "(✓)"
    assert rows["Table 5: amplitude error, 50 Hz, Eq 9"] == "(✗)"
    # The rows of docs/paper.md, counted: 2 ✓ of 32 that could have come out otherwise, 29 ≡, and in brackets 8 of
    # Table 5, 4 by a reading of it, two explanations of Fig 11 and, for two parts, ten explanations of Fig 16.
    assert [int(word) for word in counted.replace(".", " ").split() if word.isdigit()] == [2, 32, 29, 8, 4, 22]
    found = console_without_numerics("reproduce", "--quick", "--json").json
    by_name = {record["name"]: record for section in found["sections"] for record in section["records"]}
    assert by_name["eq4.speed"]["basis"] == "by construction"
