"""A job file is read strictly, every problem at once; no content of a file can do worse."""

import math
import tomllib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from profiles.fields import spelled
from profiles.files import parse_toml
from profiles.job import Job, job_from_table
from profiles.problem import ProfileError
from profiles.store import BUNDLED_JOBS

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


def test_any_table_may_hold_a_key() -> None:
    table = flat()
    deep = {"a": {"b": {"c": {"jaws": table.pop("jaws")}}}}
    assert job_from_table(table | deep).jaws == 3


def test_derived_values_of_experiment_1() -> None:
    job = job_from_table(flat())
    assert (job.lobe_frequency_hz, job.lobe_amplitude_um, job.radius_mm) == (50.0, 27.5, 26.0)


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


def test_a_text_may_be_korean() -> None:
    assert job_from_table(flat() | {"name": "알루미늄 링"}).name == "알루미늄 링"


def test_assumed_names_keys_only() -> None:
    assert codes(flat() | {"assumed": ["diameter"]}) == [("value.not_choice", "assumed")]


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


def test_problems_carry_value_and_limit_with_units() -> None:
    with pytest.raises(ProfileError) as caught:
        job_from_table(flat() | {"diameter_mm": 900.5, "lobe_error_source": "guess"})
    facts = [(problem.value, problem.limit) for problem in caught.value.problems]
    assert facts == [
        ("900.5", ">= 0.001, <= 500 mm"),
        ('"guess"', "measured | fitted | model | assumed | none"),
    ]


def test_an_error_whose_source_is_none_is_no_error() -> None:
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


def test_a_position_is_given_for_bytes_that_are_not_utf_8() -> None:
    with pytest.raises(ProfileError) as caught:
        parse_toml(b"name = 'a'\nb = '\xb5m'\n", "a.toml")
    (problem,) = caught.value.problems
    assert (problem.code, problem.key, problem.value) == ("file.not_toml", "2", "6")


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


def test_a_byte_order_mark_and_windows_line_ends_are_taken() -> None:
    content = b"\xef\xbb\xbf" + SOUND.replace("\n", "\r\n").encode()
    assert job_from_table(parse_toml(content, "")) == job_from_table(flat())


PIECES = st.sampled_from(
    [
        *SOUND.splitlines(),
        "[cut]",
        "[[cut]]",
        "jaws = true",
        "x = nan",
        "a.b.c = 1",
        '"" = 1',
        "[",
        "=",
        '"""',
    ]
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
    ("value", "text"),
    [(True, "true"), (1.5, "1.5"), (math.inf, "inf"), ('a"b', r'"a\"b"'), ([1, 2], "[1, 2]")],
)
def test_values_are_shown_as_toml_spells_them(value: object, text: str) -> None:
    assert spelled(value) == text


def test_a_huge_integer_is_shown() -> None:
    assert len(spelled(16**5000)) <= 60
