"""Job files: what is read, refused, labelled."""

from __future__ import annotations

import hashlib
import math
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from console.text.catalogue import load
from profiles.calibration.table import read_table
from profiles.fields import spell_toml
from profiles.files import parse_toml
from profiles.fingerprint.readings import read_readings
from profiles.job import JOB_FIELDS, Job, job_from_table
from profiles.problem import Problem, ProfileError
from profiles.store import BUNDLED_JOBS, load_job, load_machine, relabel_job, rename_job, save_job
from profiles.traces import read_trace

SOUND = (BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")


def flat() -> dict[str, Any]:
    table: dict[str, Any] = {}
    for key, value in tomllib.loads(SOUND).items():
        table.update(value if isinstance(value, dict) else {key: value})
    return table


def codes(table: dict[str, Any]) -> list[tuple[str, str]]:
    with pytest.raises(ProfileError) as caught:
        job_from_table(table, where="a.toml")
    assert all(problem.where == "a.toml" for problem in caught.value.problems)
    return [(problem.code, problem.key) for problem in caught.value.problems]


def test_a_flat_file_and_one_with_tables_are_the_same_job() -> None:
    assert job_from_table(flat()) == job_from_table(tomllib.loads(SOUND))
    table = flat()
    deep = {"a": {"b": {"c": {"jaws": table.pop("jaws")}}}}
    assert job_from_table(table | deep).jaws == 3


def test_texts_assumptions_and_derived_values_of_a_job() -> None:
    job = job_from_table(flat())
    assert (job.lobe_frequency_hz, job.lobe_amplitude_um, job.radius_mm) == (50.0, 27.5, 26.0)
    assert job_from_table(flat() | {"name": "알루미늄 링"}).name == "알루미늄 링"
    assert codes(flat() | {"assumed": ["diameter"]}) == [("value.not_choice", "assumed")]


def test_every_problem_is_reported_at_once() -> None:
    table = flat()
    del table["material"]
    table |= {"jaws": 3.0, "diameter_mm": True, "feed_mm_per_rev": math.nan, "colour": 1, "name": "a\nb"}
    table |= {"lobe_error_source": "guess", "spindle_speed_rpm": 5001, "chuck": {"cut_length_mm": 8}}
    assert sorted(codes(table)) == sorted(
        [
            ("key.twice", "cut_length_mm"),
            ("key.unknown", "colour"),
            ("key.missing", "material"),
            ("value.not_whole", "jaws"),
            ("value.not_number", "diameter_mm"),
            ("value.not_finite", "feed_mm_per_rev"),
            ("value.not_text", "name"),
            ("value.not_choice", "lobe_error_source"),
            ("value.out_of_range", "spindle_speed_rpm"),
        ]
    )


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("diameter_mm", [1e-3, 500, 500.0], [0, -1, 500.1]),
        ("wall_thickness_mm", [0.01, 250], [0, 250.1]),
        ("overhang_mm", [1000], [0, 1000.1]),
        ("jaws", [2, 12], [1, 13]),
        ("chucking_force_n", [1, 100_000], [0, 100_001]),
        ("depth_of_cut_mm", [0.001, 5], [0, 5.1]),
        ("feed_mm_per_rev", [1], [0, 1.1]),
        ("spindle_speed_rpm", [5000], [0, 5001, 10**400]),
        ("cut_length_mm", [1000], [0, 1001]),
        ("lobe_error_um_pp", [0, 1000], [-0.1, 1000.1]),
        ("lobe_phase_deg", [-360, 360], [-361, 361]),
        ("roundness_tolerance_um", [1000], [0, 1001]),
    ],
)
def test_bounds(key: str, good: list[float], bad: list[float]) -> None:
    for value in good:
        assert getattr(job_from_table(flat() | {key: value}), key) == value
    for value in bad:
        assert codes(flat() | {key: value}) == [("value.out_of_range", key)]


@pytest.mark.parametrize("value", ["52", [52.0], {}, None, tomllib.loads("a = 2026-01-01")["a"]])
def test_what_is_no_number(value: object) -> None:
    expected = [("key.missing", "diameter_mm")] if value == {} else [("value.not_number", "diameter_mm")]
    assert codes(flat() | {"diameter_mm": value}) == expected


@pytest.mark.parametrize("value", ["", "   ", "a" * 81, "tab\there", "\u202ereversed", 3, ["a"]])
def test_what_is_no_text(value: object) -> None:
    assert codes(flat() | {"name": value}) == [("value.not_text", "name")]


def test_the_nearest_key_is_offered() -> None:
    table = flat()
    table["diametre_mm"] = table.pop("diameter_mm")
    with pytest.raises(ProfileError) as caught:
        job_from_table(table)
    first = caught.value.problems[0]
    assert (first.code, first.key, first.limit) == ("key.unknown", "diametre_mm", "diameter_mm")


@pytest.mark.parametrize("schema", [2, "1", True, 1.0])
def test_another_schema_is_refused_alone(schema: object) -> None:
    assert codes(flat() | {"schema": schema, "new_key": 1}) == [("schema.unsupported", "schema")]


def test_problems_carry_value_and_limit_with_units_or_are_none() -> None:
    with pytest.raises(ProfileError) as caught:
        job_from_table(flat() | {"diameter_mm": 900.5, "lobe_error_source": "guess"})
    facts = [(problem.value, problem.limit) for problem in caught.value.problems]
    assert facts == [("900.5", ">= 0.001, <= 500 mm"), ('"guess"', "measured | fitted | model | assumed | none")]
    table = flat() | {"lobe_error_source": "none"}
    assert codes(table) == [("job.lobe_unknown", "lobe_error_um_pp")]
    assert job_from_table(table | {"lobe_error_um_pp": 0}).lobe_amplitude_um == 0.0


@pytest.mark.parametrize(
    "content",
    [
        b"\xff\xfe",
        b"a = ",
        b"a = 1\na = 2",
        b"a = " + b"[" * 900,
        b"\n".join([b"a = ["] + [b"["] * 3000),
        b"a = " + b"9" * 4000 + b"9" * 90,
        b"a = " + b"x" * 5000,
        b"a = '\x00'",
        b"a = 2026-13-45",
    ],
)
def test_what_is_no_toml_gives_one_problem_of_one_line(content: bytes) -> None:
    with pytest.raises(ProfileError) as caught:
        job_from_table(parse_toml(content, "a.toml"), where="a.toml")
    for problem in caught.value.problems:
        assert str(problem).isprintable()
    assert caught.value.problems[0].code in {"file.not_toml", "file.key_twice", "key.unknown"}


@pytest.mark.parametrize(
    "content",
    [
        b"\n".join(b"k%d = 1" % number for number in range(60_000)),
        b"\n".join(b"[t%d]\nk%d = 1\nk%d = 2" % (n, n // 2, n) for n in range(20_000)),
        b"\n".join(b"a%d" % number + b".a" * 2000 + b" = 1" for number in range(240)),
        b"\n".join(b"a%d" % number + b".a" * 100 + b" = 1" for number in range(2000)),
        b"a = [" + b"\n".join([b"[1]," * 1000] * 120) + b"]",
    ],
    ids=["keys", "tables", "long keys", "dotted keys", "lists"],
)
@pytest.mark.timeout(20)
@pytest.mark.first(2)
def test_a_hostile_file_neither_floods_nor_hangs(content: bytes) -> None:
    with pytest.raises(ProfileError) as caught:
        job_from_table(parse_toml(content, "a.toml"))
    assert len(caught.value.problems) < 60


def test_a_byte_order_mark_is_taken_and_other_bytes_have_a_place() -> None:
    with pytest.raises(ProfileError) as caught:
        parse_toml(b"name = 'a'\nb = '\xb5m'\n", "a.toml")
    (problem,) = caught.value.problems
    assert (problem.code, problem.key, problem.value) == ("file.not_toml", "2", "6")
    content = b"\xef\xbb\xbf" + SOUND.replace("\n", "\r\n").encode()
    assert job_from_table(parse_toml(content, "")) == job_from_table(flat())


@pytest.mark.parametrize(
    ("content", "code", "line", "column", "shown"),
    [
        (b"a = 1\nb = 2x\n", "file.not_toml", "2", "6", '"b = 2x"'),
        (b"a = 1\nb = \n", "file.not_toml", "2", "5", '"b ="'),
        (b"a = 1\nlist = [1,\n\n", "file.not_toml", "2", "11", '"list = [1,"'),
        (b"a = 1\nb = 2\na = 3\n", "file.key_twice", "3", "6", '"a = 3"'),
        (b"[t]\na = 1\n[t]\n", "file.key_twice", "3", "3", '"[t]"'),
        (b"a = 1\nb = " + b"[" * 900, "file.not_toml", "2", "1", '"b = ' + "[" * 35 + '…"'),
    ],
)
def test_what_cannot_be_read_is_told_by_line_and_column_and_in_no_language(
    content: bytes, code: str, line: str, column: str, shown: str
) -> None:
    """The words of the parser are English: they are in no problem, whose sentence each language has of its own."""
    with pytest.raises(ProfileError) as caught:
        job_from_table(parse_toml(content, "a.toml"))
    problem = caught.value.problems[0]
    assert (problem.code, problem.key, problem.value) == (code, line, column)
    assert problem.limit == shown


PIECES = st.sampled_from(
    [*SOUND.splitlines(), "[cut]", "[[cut]]", "jaws = true", "x = nan", "a.b.c = 1", '"" = 1', "[", "=", '"""']
)


@given(st.binary(max_size=200) | st.lists(PIECES, max_size=30).map(lambda lines: "\n".join(lines).encode()))
def test_any_bytes_are_a_job_or_a_refusal(content: bytes) -> None:
    try:
        job = job_from_table(parse_toml(content, "a"), where="a")
    except ProfileError as error:
        assert error.problems and all(str(problem).isprintable() for problem in error.problems)
    else:
        assert isinstance(job, Job)


VALUES = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.text())


@given(st.dictionaries(st.sampled_from([*flat(), "strange", "a\n"]), VALUES, max_size=3).map(flat().__or__))
def test_any_values_are_a_job_or_a_refusal(table: dict[str, Any]) -> None:
    try:
        job = job_from_table(table)
    except ProfileError as error:
        assert all(str(problem).isprintable() for problem in error.problems)
    else:
        assert 0 < job.diameter_mm <= 500


@pytest.mark.parametrize(
    ("value", "text"), [(True, "true"), (1.5, "1.5"), (math.inf, "inf"), ('a"b', r'"a\"b"'), ([1, 2], "[1, 2]")]
)
def test_values_are_shown_as_toml_spells_them(value: object, text: str) -> None:
    assert spell_toml(value) == text


def test_a_huge_integer_is_shown() -> None:
    assert len(spell_toml(16**5000)) <= 60


# Note and tags of a job: kept in its file, of which nothing else changes, and no part of its hash.

SOURCE = BUNDLED_JOBS / "lee-2001-experiment-1.toml"


@pytest.fixture
def own(tmp_path: Path) -> Path:
    return Path(shutil.copy(SOURCE, tmp_path / "ring.toml"))


def test_a_label_changes_neither_the_hash_nor_any_other_byte(own: Path) -> None:
    bytes_before = own.read_bytes()
    labelled = relabel_job(own, note='soft jaws, "bored" to 52', tags=("urgent", "고객"))
    assert (labelled.job.note, labelled.job.tags) == ('soft jaws, "bored" to 52', ("urgent", "고객"))
    assert labelled.sha256 == hashlib.sha256(bytes_before).hexdigest() == load_job(str(SOURCE)).sha256
    assert own.read_bytes().endswith(bytes_before)
    again = relabel_job(own, note="other", tags=())
    assert (again.job.note, again.job.tags, again.sha256) == ("other", (), labelled.sha256)
    relabel_job(own, note="", tags=())
    assert own.read_bytes() == bytes_before


def test_any_other_changed_byte_changes_the_hash(own: Path) -> None:
    before = relabel_job(own, note="n", tags=("t",)).sha256
    own.write_bytes(own.read_bytes().replace(b"1000", b"1001", 1))
    assert load_job(str(own)).sha256 != before


@pytest.mark.parametrize(
    "spelling", ["note = 'by hand'\n", 'note = """by hand"""\n', "tags = [\n  'by', 'hand',\n]\n", "\ufeff"]
)
def test_labels_written_by_hand_are_replaced(own: Path, spelling: str) -> None:
    own.write_text(spelling + SOURCE.read_text(encoding="utf-8"), encoding="utf-8")
    labelled = relabel_job(own, note="new", tags=("a",))
    assert (labelled.job.note, labelled.job.tags) == ("new", ("a",))
    assert labelled.job == load_job(str(SOURCE)).job


@pytest.mark.parametrize("note", ["two\nlines", "x" * 81, "\x1b[2J", "  "])
def test_a_note_of_no_line_of_eighty_characters_is_refused(own: Path, note: str) -> None:
    before = own.read_bytes()
    with pytest.raises(ProfileError) as refused:
        relabel_job(own, note=note, tags=())
    assert refused.value.problems[0].key == "note"
    assert own.read_bytes() == before


def test_a_bundled_job_takes_no_label_and_one_without_is_written_as_before(tmp_path: Path) -> None:
    for change in (lambda: relabel_job(SOURCE, note="x", tags=()), lambda: rename_job(SOURCE, "x")):
        with pytest.raises(ProfileError, match="bundled"):
            change()
    assert not SOURCE.with_name("x.toml").exists()
    save_job(load_job(str(SOURCE)).job, tmp_path / "new.toml")
    assert "note" not in (tmp_path / "new.toml").read_text() and "tags" not in (tmp_path / "new.toml").read_text()


def test_a_renamed_job_keeps_comments_and_comes_back_with_its_hash(own: Path) -> None:
    own.write_text("# ours\n" + SOURCE.read_text(encoding="utf-8").replace("lee-2001-experiment-1", "ring", 1))
    before = own.read_bytes()
    path = rename_job(own, "disc")
    assert not own.exists() and path.read_text(encoding="utf-8").startswith("# ours\n")
    assert load_job(str(path)).job.name == "disc"
    rename_job(path, "ring")
    assert own.read_bytes() == before


def test_a_name_that_is_taken_is_not_overwritten(own: Path, tmp_path: Path) -> None:
    (tmp_path / "disc.toml").write_text("mine")
    with pytest.raises(ProfileError) as refused:
        rename_job(own, "disc")
    assert refused.value.problems[0].code == "file.exists"
    assert own.exists() and (tmp_path / "disc.toml").read_text() == "mine"


# An empty file is one mistake, not fifteen; a few missing keys are each their own.

REQUIRED = [field.key for field in JOB_FIELDS if field.required]


def problems(table: dict[str, object]) -> list[Problem]:
    with pytest.raises(ProfileError) as caught:
        job_from_table(table, where="mine.toml")
    return list(caught.value.problems)


def test_every_missing_key_is_told_at_once_or_with_other_mistakes() -> None:
    (problem,) = problems({})
    assert (problem.code, problem.where) == ("key.missing_several", "mine.toml")
    assert problem.key.split(", ") == REQUIRED
    assert problem.value == str(len(REQUIRED))
    found = problems({"name": 3})
    assert [problem.code for problem in found] == ["value.not_text", *["key.missing"] * (len(REQUIRED) - 1)]


# UTF-16 without a byte order mark is named as such in one sentence, by every reader of a text from outside.

TRACE = "# state: free\nangle_deg,deviation_um\n" + "".join(f"{a},{a % 7}\n" for a in range(360))
JOB = (BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize(
    ("read", "text"),
    [
        (read_trace, TRACE),
        (read_readings, "# fingerprint: 1\nangle_deg,reading_um\n0,1\n"),
        (read_table, "torque_n_m,force_n\n1,2\n"),
        (lambda path: load_job(str(path)), JOB),
        (lambda path: load_machine(str(path)), "schema = 1\n"),
    ],
    ids=["trace", "fingerprint", "calibration", "job", "machine"],
)
def test_a_text_in_utf_16_is_told_to_be_saved_as_utf_8(
    read: Callable[[Path], object], text: str, encoding: str, tmp_path: Path
) -> None:
    path = tmp_path / "part.toml"
    path.write_bytes(text.encode(encoding))
    with pytest.raises(ProfileError) as caught:
        read(path)
    (problem,) = caught.value.problems
    assert problem.code == "file.nul_bytes"
    assert "part.toml" in problem.where
    for language in ("en", "ko"):
        said = load(language).problem(problem)
        assert "UTF-8" in said and "UTF-16" in said and "\\x00" not in said


def test_with_a_byte_order_mark_a_trace_is_read_as_before(tmp_path: Path) -> None:
    path = tmp_path / "part.csv"
    path.write_bytes(TRACE.encode("utf-16"))
    assert read_trace(path).angle_deg.size == 360
