"""The report of a run: everything of it in one file that any browser shows, with nothing left to believe."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import subprocess
from datetime import UTC, timedelta, timezone
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from console.__main__ import main
from console.report.page import write_report
from console.report.quantities import against_limit, exact
from console.session.data.record_file import FILE_NAME
from console.session.data.run_reader import measured_parts, story
from console.session.data.run_rows import problem_events
from console.session.learning.opened_run import OpenedRun, open_for_report
from console.session.stages import Stage
from console.text.catalogue import LANGUAGES, load
from profiles.problem import Problem
from profiles.trace_files.header import header_of
from tests.console.reported_runs import (
    COMPLETE,
    PROGRAM,
    change_trace,
    execute,
    job_named,
    lobed,
    recorded,
)
from tests.console.test_run_reader import page_of as first_page

PASSED_3 = math.exp(-math.pi * (math.sqrt(math.log(2.0) / math.pi) * 3.0 / 50.0) ** 2)
"""What the Gaussian filter of ISO 16610-21 passes of 3 undulations at a cut-off of 50."""

PRINTABLE = "<script>alert('1')</script> ]]> &amp; \"q\""
HOSTILE = f"{PRINTABLE} \x1b[2J\u202e"
ENDED = (Problem(code="cut.ended_early", value="7", limit="40"), Problem(code="x.y"))
EARLY: tuple[str, dict[str, object]] = ("ended_early", {"turns": 7, **problem_events(ENDED)})
ELEMENTS = {
    *"html head meta title style body div span small b strong main header section h1 h2 h3 p ul li".split(),
    *"table caption thead tbody tr th td figure figcaption details summary pre".split(),
    *"svg desc path line circle rect text".split(),
}


class Page(HTMLParser):
    """A page as a browser reads it: faults in its structure, its texts by element, its attributes."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.faults: list[str] = []
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(page)
        self.close()
        self.faults += [f"{tag} stays open" for tag in self.open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"{tag} closes another")

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts.append((self.open[-1], data))

    def said(self, *elements: str) -> str:
        return "\n".join(text for tag, text in self.texts if not elements or tag in elements)


def run_of(folder: Path, run_id: str, zone: Any = UTC) -> OpenedRun:
    found = story(folder, run_id)
    points = measured_parts(folder, found.row.job, found.row.machine, found.row.simulated)
    return open_for_report(found, points, zone)


def page_of(folder: Path, run_id: str, language: str = "en", zone: Any = UTC) -> str:
    return write_report(run_of(folder, run_id, zone), load(language))


def words(page: str) -> str:
    """The text of a page as it is read: one line."""
    body = re.sub(r"<style>.*?</style>|<pre>.*?</pre>", "", page, flags=re.DOTALL)
    return " ".join(Page(re.sub(r"(</t[hd]>|</li>|</p>)", r" \1", body)).said().split())


def check(page: str, language: str) -> Page:
    """Whether a page is sound, needs nothing else, and can be read out."""
    found = Page(page)
    assert found.faults == []
    assert page.startswith("<!DOCTYPE html>\n") and {tag for tag, _ in found.tags} <= ELEMENTS
    assert found.tags[0] == ("html", {"lang": language})
    attributes = [(name, value or "") for _, each in found.tags for name, value in each.items()]
    names = [value for name, value in attributes if name == "id"]
    assert len(names) == len(set(names))
    assert [each for each in attributes if each[0] in ("src", "href") or each[0].startswith("on")] == []
    assert re.findall(r"@import|url\(|https?:", page) == []
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    for drawing in drawings:
        root = ElementTree.fromstring(drawing)
        labels = [root.find(f".//*[@id='{name}']") for name in root.get("aria-labelledby", "").split()]
        assert root.get("role") == "img" and len(labels) == 2
        assert all(label is not None and label.text for label in labels)
    tables = re.findall(r"<table.*?</table>", page, re.DOTALL)
    assert tables and all("<caption>" in each and "<th scope" in each for each in tables)
    assert "report." not in words(page).replace("console.report", "")  # a text that is missing shows its key
    return found


def test_every_kind_of_run_gives_a_sound_page_in_both_languages(tmp_path: Path) -> None:
    good = {"before": lobed(27.0), "after": lobed(1.0)}
    folder = tmp_path / "new"
    runs = [
        recorded(folder, good),
        recorded(folder, {}, end=("ended", {"reason": "stopped (SIGINT)", "stopped": True, "by": "kim"})),
        recorded(folder, {"": lobed(0.0)}, strategy="none", simulated=0),
        recorded(folder, {"partial": lobed(14.0)}, stage=Stage.PARTIAL, end=None, operator=None),
        recorded(folder, good, job_text_sha256="schema = 9", setup=None, program=""),
        recorded(folder, {f"part {number}": lobed(1.0 + 0.1 * number) for number in range(9)}),
    ]
    for run in runs:
        reported = run_of(folder, run)
        for language in LANGUAGES:
            check(write_report(reported, load(language)), language)


def test_names_from_outside_are_text_and_nothing_else(tmp_path: Path) -> None:
    program = f"; {HOSTILE}</pre><img src=x>\n\tX1\n"
    run = recorded(
        tmp_path,
        {HOSTILE: lobed(1.0, compensation="<b>")},
        job=job_named(PRINTABLE, material="<i>Al</i>", source="</style><script>"),
        end=("cut", {"reason": HOSTILE, HOSTILE: HOSTILE}),
        **dict.fromkeys(("machine", "operator", "software", "controller", "strategy"), HOSTILE),  # type: ignore[arg-type]
        program=program,
    )
    execute(tmp_path, "INSERT INTO events VALUES (?, 99, '', ?, '{}')", (run, HOSTILE))
    page = page_of(tmp_path, run)
    found = check(page, "en")
    assert not any(character in page for character in "\x1b\x00\u202e")
    shown = f"{PRINTABLE} \\x1b[2J\\u202e"
    assert found.said("td").count(shown) >= 3 and "<i>Al</i>" in found.said("td")
    assert found.said("pre") == "\n" + program.replace(HOSTILE, shown)


def test_the_same_run_gives_the_same_bytes_whatever_is_recorded_later(tmp_path: Path) -> None:
    recorded(tmp_path, {"after": lobed(1.5)})
    run = recorded(tmp_path, {"before": lobed(27.0), "after": lobed(1.0)})
    page = page_of(tmp_path, run)
    recorded(tmp_path, {"after": lobed(9.0)})
    assert page_of(tmp_path, run) == page
    assert page_of(tmp_path, run, zone=timezone(timedelta(hours=9))) != page


def test_figures_are_those_of_the_part(tmp_path: Path) -> None:
    # 2 x 10 um x 0.99751 of the filter; the mean radius is 25.9 mm + 3 um.
    run = recorded(tmp_path, {"before": lobed(27.0), "after": lobed(10.0, 3.0)})
    page = page_of(tmp_path, run, zone=timezone(timedelta(hours=9)))
    said = words(page)
    um_pp, before = f"{20.0 * PASSED_3:.3f}", f"{54.0 * PASSED_3:.3f}"
    assert f"RONt LSC {2.0 * 27.0 * PASSED_3:.3f} {2.0 * 10.0 * PASSED_3:.3f}" in said
    assert f"3 ◂ {before} {um_pp} 0.00" in said  # the first maximum is at jaw 1
    assert "Mean diameter 51.8060 mm (least squares circle), nominal 51.8000 mm, difference +6.0 µm" in said
    assert "UTC+09:00" in said and run in said and "kim" in said
    assert "chucking force, total 1314 N (assumed)" in said and "roundness tolerance 5 µm RONt" in said
    # Along the part only: neither the way to it nor the tool on its way out.
    assert "at 59 status polls while the tool was fed along the part: -3.0 to 3.9 µm" in said
    assert "after: the recorded trace gives the recorded figures." in said
    assert Page(page).said("pre") == "\n" + PROGRAM


def said(judgement: str) -> tuple[str, dict[str, object]]:
    """The end of a complete cut with this verdict, whose tool took 9.1 um of roundness and may take 3.5 um."""
    sizes = {"size_um": 20.0, "size_limit_um": None}
    return COMPLETE[0], {
        **COMPLETE[1],
        "cut_verdict": judgement,
        "tool": {"roundness_um": 9.1, "roundness_limit_um": 3.5, **sizes},
    }


def test_the_verdict_names_its_reason_and_needs_no_colour(tmp_path: Path) -> None:
    good, bad = {"": lobed(1.0)}, {"": lobed(4.0)}
    exact, wide = job_named(diameter_tolerance_um=4.0), {"": lobed(1.0, 3.0)}
    cases: list[tuple[str, str, str]] = [
        (recorded(tmp_path, good), "✓ PASS", "within its tolerance of 5.000 µm"),
        (recorded(tmp_path, bad), "✗ FAIL", f"RONt (LSC) {8.0 * PASSED_3:.3f} µm is outside"),
        (recorded(tmp_path, wide, job=exact), "✗ FAIL", "51.8060 mm is off by 6.000 µm, outside ± 4.000 µm"),
        (recorded(tmp_path, good, job=exact), "✓ PASS", "is off by 0.000 µm, within ± 4.000 µm"),
        (recorded(tmp_path, good, end=("held", {"turn": 3.0})), "✗ FAIL", "not the planned cut; after 3.0 turns"),
        (recorded(tmp_path, good, end=EARLY), "✗ FAIL", "at turn 7 of 40: this part is not measured"),
        (recorded(tmp_path, good, end=None), "– NOT JUDGED", "The record has no end"),
        (recorded(tmp_path, good, stage=Stage.PARTIAL), "– NOT JUDGED", "Half of the compensation"),
        (recorded(tmp_path, {}, stage=Stage.AIR), "– NOT JUDGED", "Air cut: no part was touched."),
        (recorded(tmp_path, {}), "– NOT JUDGED", "The part was not measured"),
        (recorded(tmp_path, good, end=said("not_proven"), proven=False), "– NOT JUDGED", "neither good nor bad"),
        (recorded(tmp_path, good, end=said("tool_error")), "✓ PASS", "off its plan by 9.100 µm of roundness"),
        (recorded(tmp_path, good, end=said("as_planned")), "✓ PASS", "within its tolerance of 5.000 µm"),
    ]
    for run, sign, reason in cases:
        found = Page(page_of(tmp_path, run))
        assert sign in found.said("strong") and reason in " ".join(found.said("li", "p").split()), reason


def test_a_value_is_shown_as_typed_and_one_beyond_its_limit_not_as_equal_to_it() -> None:
    for value, shown in (
        *((0.931476016162, "0.9315 µm"), (55.0, "55 µm"), (0.125, "0.125 µm"), (51.80012, "51.80012 µm")),
        *((1234.56789012345, "1234.5679 µm"), (0.0000123456789, "1.235e-05 µm")),
    ):
        assert exact(value, "µm") == shown
    assert against_limit(5.0000004, 5.0) == ("5.0000004", "5.0000000")
    assert against_limit(4.9999996, 5.0) == ("5.000", "5.000")  # within: nothing contradicts it
    assert against_limit(5.0, 5.0) == ("5.000", "5.000")
    assert against_limit(11.3029, 5.0) == ("11.303", "5.000")


def test_one_changed_digit_or_a_verdict_that_was_turned_round_takes_the_verdict_away(tmp_path: Path) -> None:
    run = recorded(tmp_path, {"after": lobed(1.0)})
    change_trace(tmp_path, run, b"\n90.0,1.0\n", b"\n90.0,1.1\n")
    said = words(page_of(tmp_path, run))
    assert "? NO VERDICT" in said and "does NOT give the recorded figures (RONt" in said
    assert "does NOT have its recorded hash; it was changed" in said
    assert "Trace and recorded figures contradict each other: after." in said
    run = recorded(tmp_path, {"after": lobed(1.0)})
    execute(tmp_path, "DROP TRIGGER traces_are_kept")
    execute(tmp_path, "UPDATE traces SET content = x'0102' WHERE run_id = ?", (run,))
    said = words(page_of(tmp_path, run))
    assert "? NO VERDICT" in said and "Damaged, left out of this report: trace of measurement 1." in said
    run = recorded(tmp_path / "other", {"after": lobed(4.0)})
    execute(tmp_path / "other", "DROP TRIGGER measurements_stay")
    execute(tmp_path / "other", "UPDATE measurements SET passed = 1")
    said = words(page_of(tmp_path / "other", run))
    assert "? NO VERDICT" in said and "The recorded verdict does not follow" in said and "PASS" not in said


@pytest.mark.parametrize("table", ["events", "measurements", "telemetry", "traces", "texts"])
def test_a_report_says_what_is_damaged(tmp_path: Path, table: str, capsys: pytest.CaptureFixture[str]) -> None:
    run = recorded(tmp_path, {"before": lobed(27.0), "after": lobed(1.0)})
    root, size = first_page(tmp_path / FILE_NAME, table)
    with open(tmp_path / FILE_NAME, "r+b") as file:
        file.seek((root - 1) * size)
        file.write(bytes(range(256)) * (size // 256))
    output = tmp_path / "damaged.html"
    assert main(("report", run, "--data", str(tmp_path), "--output", str(output))) == 0
    page = output.read_text(encoding="utf-8")
    check(page, "en")
    assert "? NO VERDICT" in words(page) and "left out of this report:" in words(page)
    assert "gap" in words(page) and capsys.readouterr().err == ""


def test_simulated_is_said_in_the_title_and_at_the_top_of_each_page_and_only_then(tmp_path: Path) -> None:
    for language, word in (("en", "SIMULATED"), ("ko", "시뮬레이션")):
        page = page_of(tmp_path, recorded(tmp_path, {}), language)
        assert word in Page(page).said("title")
        running = page.split('class="head"')[1].split("<main")[0]
        assert word in running and "font-size: 28px" in page
        page = page_of(tmp_path, recorded(tmp_path, {}, simulated=0), language)
        assert word not in words(page)


def test_an_imported_trace_is_judged_as_it_was_with_the_answers_of_the_operator(tmp_path: Path) -> None:
    run = recorded(tmp_path, {"": lobed(1.0)})
    bare = b"angle_deg,deviation_um\n" + b"".join(b"%.1f,%d\n" % (at / 2, at % 2) for at in range(720))
    execute(tmp_path, "DROP TRIGGER traces_stay")
    execute(tmp_path, "DROP TRIGGER measurements_stay")
    change_trace_to(tmp_path, run, bare)
    answers = {"answers": {"state": "free", "direction": "ccw", "start_mark": "jaw 1"}, "radius_mm": 25.9}
    name = "UPDATE measurements SET data = ?, trace_name = 'gauge.csv', ront_um = ?, diameter_mm = NULL"
    from profiles.roundness import evaluate
    from profiles.traces import parse_trace

    trace = parse_trace(bare)
    assert header_of(trace.meta)[0].state == "unknown"
    ront_um = evaluate(trace.angle_deg, trace.deviation_um, 50.0, radius_mm=25.9).ront_um
    execute(tmp_path, name, (json.dumps(answers), ront_um))
    said = words(page_of(tmp_path, run))
    assert "part: free" in said and "Trace from the file gauge.csv" in said and "jaw 1" in said
    assert "part: the recorded trace gives the recorded figures." in said


def change_trace_to(folder: Path, run: str, content: bytes) -> None:
    import hashlib
    import zlib

    execute(folder, "UPDATE traces SET content = ? WHERE run_id = ?", (zlib.compress(content), run))
    sha256 = hashlib.sha256(content).hexdigest()
    execute(folder, "UPDATE measurements SET trace_sha256 = ? WHERE run_id = ?", (sha256, run))


def test_the_run_chart_has_the_parts_up_to_this_one(tmp_path: Path) -> None:
    runs = [recorded(tmp_path, {"": lobed(1.0 + 0.1 * (number % 3))}) for number in range(10)]
    recorded(tmp_path, {"": lobed(5.0)}, stage=Stage.PARTIAL)
    said = words(page_of(tmp_path, runs[8]))
    mean = 2.0 * 1.1 * PASSED_3
    # The moving ranges of 0, 1, 2, 0, 1, 2 ... tenths: five or so of 1, the others of 2.
    reach = 3.0 / 1.128 * 2.0 * 0.1 * PASSED_3 * (6 * 1 + 2 * 2) / 8
    limits = f"limits of the individuals chart {mean - reach:.3f} µm to {mean + reach:.3f} µm"
    assert "RONt of the last 9 whole parts" in said and f"Mean {mean:.3f} µm; {limits}" in said
    assert "Run chart" not in words(page_of(tmp_path, runs[0]))
    # It claims no more than the page Records: limits start over with another compensation or strategy.
    recorded(tmp_path, {"": lobed(9.0)}, strategy="none")
    for number in range(20):
        run = recorded(tmp_path, {"": lobed(1.0 + 0.1 * (number % 3))}, compensation=2)
    said = words(page_of(tmp_path, run))
    assert "RONt of the last 30 whole parts" in said and "Limits and indices: the last 20 parts" in said
    assert "Cpk: not claimed from 20 parts made alike: it takes 30." in said


def test_the_command_writes_the_newest_run_once_and_says_which(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, here = tmp_path / "data", tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    assert main(("report", "--data", str(data))) == 1
    assert "no run is recorded" in capsys.readouterr().err and not data.exists()
    older = recorded(data, {"after": lobed(1.0)}, job=job_named("../a b<c>"))
    newest = recorded(data, {"after": lobed(4.0)})
    command = ("report", "--data", str(data))
    assert main(command) == 0
    (written,) = here.iterdir()
    assert re.fullmatch(r"ring-\d{4}-\d\d-\d\d-\d{6}\.html", written.name)
    said = capsys.readouterr().out
    assert newest in said and "newest" in said and written.name in said
    content = written.read_bytes()
    assert newest.encode() in content
    assert main(command) == 1 and "--overwrite" in capsys.readouterr().err
    assert written.read_bytes() == content and main((*command, "--overwrite")) == 0
    assert main((*command, older[:8], "--lang", "ko")) == 0
    assert [
        each.name for each in here.iterdir() if each.name.startswith("a-b-c")
    ] and older in capsys.readouterr().out
    output = tmp_path / "one.html"
    assert main((*command, newest[:10], "--output", str(output), "--json")) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["run"], facts["verdict"], facts["simulated"]) == (newest, "bad", True)
    assert facts["file"] == str(output) and output.exists()
    assert main((*command, "zz")) == 1 and "zz" in capsys.readouterr().err
    assert main((*command, newest, "--output", str(tmp_path / "no" / "one.html"))) == 1
    assert "cannot be written" in capsys.readouterr().err


CHROMIUM = shutil.which("chromium")


PRINTS = pytest.mark.skipif(
    CHROMIUM is None or not shutil.which("pdftotext"), reason="no chromium, or no pdftotext"
)


def printed_pages(page: str, folder: Path) -> list[str]:
    """The words of each sheet that a real browser prints of a page; all sheets are A4."""
    source, paper = folder / "report.html", folder / "report.pdf"
    source.write_text(page, encoding="utf-8")
    quiet = "--headless --no-sandbox --disable-gpu --no-first-run --disable-sync --disable-background-networking"
    options = [*quiet.split(), "--disable-component-update", f"--user-data-dir={folder / 'browser'}"]
    call = [str(CHROMIUM), *options, f"--print-to-pdf={paper}", "--no-pdf-header-footer", source.as_uri()]
    homeless = {**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder)}
    subprocess.run(call, capture_output=True, timeout=50, check=True, env=homeless)
    width, height = map(float, re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", paper.read_bytes())[0])
    assert abs(width - 595.3) < 1.0 and abs(height - 841.9) < 1.0
    text = subprocess.run(["pdftotext", str(paper), "-"], capture_output=True, timeout=20, check=True).stdout
    return text.decode().split("\f")[:-1]


@pytest.mark.system
@pytest.mark.long
@PRINTS
def test_a_real_browser_prints_simulated_on_every_page(tmp_path: Path) -> None:
    run = recorded(tmp_path, {"before": lobed(27.0), "after": lobed(1.0)})
    pages = printed_pages(page_of(tmp_path, run), tmp_path)
    assert len(pages) >= 3 and all("SIMULATED" in each and run[:8] in each for each in pages)
    assert "CLOSE" in pages[-1]  # the program is printed, at the end
