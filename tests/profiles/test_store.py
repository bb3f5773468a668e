"""Files of profiles: found, saved, left behind; and what a script needs."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import os
import re
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import profiles
from profiles.fields import Field, FieldType
from profiles.files import made_locked, remove_all_left, write_atomically
from profiles.job import JOB_FIELDS, Job
from profiles.problem import Problem, ProblemError, ProfileError
from profiles.store import BUNDLED_JOBS, list_jobs, list_machines, load_job, load_machine, save_job
from profiles.words.sentences import Sentences, words_of

ONE = load_job("lee-2001-experiment-1").job
BUNDLED = (
    "lee-2001-experiment-1",
    "lee-2001-experiment-2",
    "steel-bar-65",
    "thin-ring-3-jaws",
    "thin-ring-6-jaws",
    "two-jaw-tube",
)


def code_of(action: Callable[[], object]) -> str:
    with pytest.raises(ProfileError) as caught:
        action()
    assert len(caught.value.problems) == 1
    assert str(caught.value.problems[0]).isprintable()
    return caught.value.problems[0].code


def test_table_6_of_the_paper() -> None:
    two = load_job("lee-2001-experiment-2").job
    for job, values in ((ONE, (52, 2.5, 0.1, 55)), (two, (35, 1.5, 0.06, 33))):
        met = (job.diameter_mm, job.wall_thickness_mm, job.depth_of_cut_mm, job.lobe_error_um_pp)
        assert met == pytest.approx(values, abs=0)
        assert job.material == "Al"
        assert (job.spindle_speed_rpm, job.overhang_mm, job.jaws) == pytest.approx((1000, 30, 3), abs=0)
        assert job.lobe_error_source == "measured"
        # What the paper does not say must not pass for its own.
        assert {"chucking_force_n", "feed_mm_per_rev", "cut_length_mm", "lobe_phase_deg"} <= set(job.assumed)


def test_bundled_names_have_the_hash_of_their_bytes() -> None:
    assert [entry.name for entry in list_jobs()] == list(BUNDLED)
    machines = [("lee-2001-lathe", True), ("turbo-ethernet-lathe", True)]
    assert [(entry.name, entry.bundled) for entry in list_machines()] == machines
    loaded = load_job("lee-2001-experiment-1")
    assert loaded.sha256 == hashlib.sha256(loaded.path.read_bytes()).hexdigest()


def test_the_users_folder_comes_first_and_may_be_missing(tmp_path: Path) -> None:
    save_job(replace(ONE, note="mine"), tmp_path / "lee-2001-experiment-1.toml")
    assert load_job("lee-2001-experiment-1", tmp_path).job.note == "mine"
    own = [entry.name for entry in list_jobs(tmp_path) if not entry.bundled]
    assert own == ["lee-2001-experiment-1"]
    assert len(list_jobs(tmp_path)) == len(BUNDLED)
    assert len(list_jobs(tmp_path / "none")) == len(BUNDLED)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(ProfileError) as caught:
        load_job("no\nsuch")
    problem = caught.value.problems[0]
    assert (problem.code, problem.value) == ("job.unknown", '"no\\nsuch"')
    assert problem.limit == " | ".join(BUNDLED)
    assert code_of(lambda: load_machine("")) == "machine.unknown"


def test_a_path_is_taken_as_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_job(ONE, tmp_path / "a.toml")
    monkeypatch.chdir(tmp_path)
    assert load_job("a.toml").job == load_job("./a.toml").job == ONE
    with pytest.raises(ProfileError) as caught:
        load_job("./gone.toml")
    assert (caught.value.problems[0].code, caught.value.problems[0].where) == ("file.unreadable", "gone.toml")


def test_what_is_no_regular_readable_small_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "loop.toml").symlink_to(tmp_path / "loop.toml")
    names = ["pipe.toml", "folder.toml", "loop.toml", "a\0b.toml", "x" * 5000 + ".toml", "gone/a.toml"]
    for path in ["/dev/zero", "/dev/null", *(f"{tmp_path}/{name}" for name in names)]:
        assert code_of(partial(load_job, path)) == "file.unreadable"
        assert code_of(partial(load_machine, path)) == "file.unreadable"
    if os.geteuid() == 0:
        pytest.skip("root may read everything")
    save_job(ONE, tmp_path / "a.toml")
    (tmp_path / "a.toml").chmod(0)
    assert code_of(lambda: load_job(f"{tmp_path}/a.toml")) == "file.unreadable"
    (tmp_path / "a.toml").write_bytes(b"#" * 1_000_001)
    assert code_of(lambda: load_job(f"{tmp_path}/a.toml")) == "file.too_large"


def test_nothing_is_overwritten_unless_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    save_job(ONE, path)
    assert code_of(lambda: save_job(replace(ONE, jaws=4), path)) == "file.exists"
    assert load_job(str(path)).job == ONE
    save_job(replace(ONE, jaws=4), path, overwrite=True)
    assert load_job(str(path)).job.jaws == 4
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.toml"]


def test_comments_survive_a_save_and_what_is_no_job_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    text = (BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    save_job(replace(ONE, feed_mm_per_rev=0.08), path, overwrite=True)
    assert path.read_text(encoding="utf-8") == text.replace("feed_mm_per_rev = 0.05 ", "feed_mm_per_rev = 0.08 ")
    path = tmp_path / "a.toml"
    path.write_bytes(b"\xffnonsense")
    save_job(ONE, path, overwrite=True)
    assert load_job(str(path)).job == ONE


def test_bundled_places_are_never_written(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(BUNDLED_JOBS)
    for path in (BUNDLED_JOBS / "new.toml", tmp_path / "link" / "new.toml"):
        assert code_of(partial(save_job, ONE, path, overwrite=True)) == "file.bundled"
    assert len(list_jobs()) == len(BUNDLED)


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    for path in (tmp_path / "gone" / "a.toml", tmp_path / "folder.toml", Path("/dev/null"), tmp_path / "a\0"):
        assert code_of(partial(save_job, ONE, path, overwrite=True)) == "file.not_writable"
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_a_job_that_could_not_be_loaded_is_not_saved(tmp_path: Path) -> None:
    assert code_of(lambda: save_job(replace(ONE, jaws=1), tmp_path / "a.toml")) == "value.out_of_range"
    assert not list(tmp_path.iterdir())


def test_a_link_stays_a_link_and_keeps_the_mode(tmp_path: Path) -> None:
    real, link = tmp_path / "real.toml", tmp_path / "link.toml"
    save_job(ONE, real)
    real.chmod(0o640)
    link.symlink_to(real)
    save_job(replace(ONE, jaws=4), link, overwrite=True)
    assert link.is_symlink() and load_job(str(real)).job.jaws == 4
    assert stat.S_IMODE(real.stat().st_mode) == 0o640


# Everything printable in all scripts; the other categories are controls, formats and odd spaces.
LETTERS = st.characters(codec="utf-8", exclude_categories=("C", "Z"))
TEXTS = st.text(LETTERS, min_size=1, max_size=80) | st.sampled_from(["a b", "알루미늄 링", 'q"q', "b\\s", "#"])


def values_of(field: Field) -> st.SearchStrategy[object]:
    if field.kind is FieldType.CHOICE:
        return st.sampled_from(field.choices)
    if field.kind is FieldType.TEXTS:
        return st.lists(st.sampled_from(field.choices) if field.choices else TEXTS).map(tuple)
    if field.kind is FieldType.TEXT:
        return TEXTS if field.required else TEXTS | st.just("")
    assert field.at_least is not None and field.at_most is not None
    if field.kind is FieldType.WHOLE:
        return st.integers(int(field.at_least), int(field.at_most))
    return st.floats(field.at_least, field.at_most).map(lambda value: value if abs(value) >= 1e-9 else 0.0)


def without_an_unknown_error(values: dict[str, Any]) -> Job:
    return Job(**values | ({"lobe_error_um_pp": 0.0} if values["lobe_error_source"] == "none" else {}))


JOBS = st.fixed_dictionaries({field.key: values_of(field) for field in JOB_FIELDS}).map(without_an_unknown_error)


@given(job=JOBS, other=JOBS)
def test_what_is_saved_is_loaded(tmp_path_factory: pytest.TempPathFactory, job: Job, other: Job) -> None:
    path = tmp_path_factory.mktemp("jobs") / "a.toml"
    save_job(job, path)
    assert load_job(str(path)).job == job
    save_job(other, path, overwrite=True)
    assert load_job(str(path)).job == other


def test_a_plain_copy_of_a_machine_is_refused_under_its_file_name(tmp_path: Path) -> None:
    """It would be listed as lathe-3, and its runs would be those of the machine that it was copied from."""
    copy = tmp_path / "lathe-3.toml"
    copy.write_text(load_machine("lee-2001-lathe").text)
    with pytest.raises(ProfileError) as refused:
        load_machine("lathe-3", tmp_path)
    (problem,) = refused.value.problems
    assert (problem.code, problem.value, problem.limit) == ("machine.name_differs", "lathe-3", "lee-2001-lathe")
    (entry,) = (each for each in list_machines(tmp_path) if not each.bundled)
    with pytest.raises(ProfileError):
        load_machine(entry)
    assert load_machine(str(copy)).machine.name == "lee-2001-lathe"
    copy.write_text(copy.read_text().replace('name = "lee-2001-lathe"', 'name = "lathe-3"'))
    assert load_machine("lathe-3", tmp_path).machine.name == "lathe-3"


# What a killed writer has left is taken away; what somebody alive writes, or is nobody's of ours, never.

WRITES = """
import signal, sys
from pathlib import Path
from profiles import files
def wait(*_, **__):
    print("in the middle", flush=True)
    signal.pause()
files._move = wait
files.write_atomically(Path(sys.argv[1]), b"new", overwrite=True)
"""


@contextmanager
def in_the_middle(path: Path) -> Iterator[None]:
    """A process that has written its temporary file, and has not moved it yet; it is killed at the end."""
    command = [sys.executable, "-c", WRITES, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == b"in the middle\n"
            yield
        finally:
            process.kill()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_writer_that_was_killed_leaves_nothing_behind_the_next(tmp_path: Path) -> None:
    path = tmp_path / "job.toml"
    path.write_bytes(b"old")
    with in_the_middle(path):
        (left,) = set(names(tmp_path)) - {"job.toml"}
        remove_all_left(tmp_path)
        write_atomically(tmp_path / "job.toml", b"newer", overwrite=True)
        assert left in names(tmp_path), "that one is alive"
    write_atomically(tmp_path / "another.toml", b"", overwrite=False)
    assert left in names(tmp_path), "the folder may be anybody's"
    write_atomically(path, b"newest", overwrite=True)
    assert (names(tmp_path), path.read_bytes()) == (["another.toml", "job.toml"], b"newest")


def test_in_a_folder_of_ours_all_that_was_left_goes_and_nothing_else(tmp_path: Path) -> None:
    inner = tmp_path / "learned" / "machine"
    inner.mkdir(parents=True)
    stays = [
        tmp_path / "notes.tmp",
        tmp_path / ".part.csv.tmp",
        inner / "version.0123abcd.tmp",
        inner / ".x.0123ABCD.tmp",
    ]
    for path in (*stays, tmp_path / ".job.toml.0123abcd.tmp", inner / ".version-000001.json.89abcdef.tmp"):
        path.write_bytes(b"")
    os.symlink(stays[0], inner / ".link.01234567.tmp")
    os.mkfifo(inner / ".pipe.01234567.tmp")
    remove_all_left(tmp_path)
    kept = [path for path in tmp_path.rglob("*") if not path.is_dir()]
    assert sorted(kept) == sorted([*stays, inner / ".link.01234567.tmp", inner / ".pipe.01234567.tmp"])
    remove_all_left(tmp_path / "nowhere")


@pytest.mark.timeout(60)
def test_somebody_who_clears_up_takes_no_file_from_a_writer(tmp_path: Path) -> None:
    over = threading.Event()

    def clear_up() -> None:
        while not over.is_set():
            remove_all_left(tmp_path)

    clearing = threading.Thread(target=clear_up)
    clearing.start()
    try:
        for number in range(150):
            path = tmp_path / f".{number}.0123abcd.tmp"
            descriptor = made_locked(path, 0o600)
            assert os.path.samestat(os.fstat(descriptor), os.stat(path))
            os.close(descriptor)
    finally:
        over.set()
        clearing.join()


# An error speaks English by itself: what, where, value, limit and remedy, without a console.

SCRIPT = """
import sys
from profiles.store import load_job
try:
    load_job("no-such-job")
except Exception as error:
    print(error)
    assert not any(name.split(".")[0] in ("console", "drivers") for name in sys.modules)
"""


def test_an_error_is_a_sentence_with_value_limit_and_remedy() -> None:
    problem = Problem(code="schema.unsupported", where="a.toml", key="schema", value="2", limit="1")
    assert str(ProfileError(problem)) == str(problem)
    for fact in ("a.toml", "schema", "2", "1"):
        assert fact in str(problem)
    assert "schema.unsupported" not in str(problem)
    both = Problem(code="file.exists", where="b.json"), Problem(code="no.such_code", value="3 mm")
    error = ProblemError(*both)
    assert all(str(problem) in str(error) for problem in both)
    assert error.__notes__ == ["file.exists · b.json; no.such_code · actual 3 mm"]
    assert str(both[1]) == both[1].facts, "better an ugly line than none"


def test_profiles_speak_alone_and_drivers_without_a_console() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert "no-such-job" in done.stdout and done.stdout.count("\n") == 1
    script = (
        "import sys; from drivers.errors import LinkError; from profiles.problem import Problem; "
        "print(LinkError(Problem(code='link.no_device', where='serial:/dev/x', value='ENOENT'))); "
        "assert 'console' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "check the name and the cable" in done.stdout


def test_the_reason_of_the_operating_system_is_in_the_language_of_the_console() -> None:
    korean = Sentences(words_of("ko"))
    for number in (errno.EACCES, errno.ENOENT, errno.EISDIR, errno.ENOSPC, errno.EROFS, errno.ECONNREFUSED):
        problem = Problem(code="file.unreadable", where="a.toml", value=os.strerror(number))
        assert os.strerror(number) in str(problem)
        assert max(os.strerror(number).split(), key=len) not in korean.problem(problem)


# docs/api.md is the page of who works in a notebook: each of its blocks runs, and prints what stands below it.

DOCUMENT = Path(__file__).parents[2] / "docs" / "api.md"
BLOCKS = re.compile(r"^```python\n(.*?)^```\n(?:\n```\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)


def test_each_block_prints_what_stands_below_it() -> None:
    blocks = BLOCKS.findall(DOCUMENT.read_text(encoding="utf-8"))
    notebook: dict[str, object] = {}
    assert len(blocks) > 5
    for script, printed in blocks:
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(script, str(DOCUMENT), "exec"), notebook)
        assert said.getvalue() == printed, script
        assert set(re.findall(r"^(?:from|import) (\w+)", script, re.MULTILINE)) <= {"profiles", "numpy"}


# Profiles are read at start-up and in every headless command, so they bring nothing heavy with them.

HEAVY = ("scipy", "control", "matplotlib", "tomlkit")


@pytest.mark.parametrize(
    ("modules", "unwanted"),
    [
        ("profiles.job, profiles.machine, profiles.store, profiles.rules", (*HEAVY, "numpy")),
        ("profiles.roundness, profiles.traces, profiles.compensations.path, profiles.axis.servo", HEAVY),
    ],
)
def test_imports(modules: str, unwanted: tuple[str, ...]) -> None:
    code = f"import sys, {modules}; print(*(name for name in {unwanted!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


IMPORTS_SCRIPT = """
import sys
import profiles

assert "numpy" not in sys.modules and "profiles.roundness" not in sys.modules
assert {"roundness", "traces", "servo"} <= set(dir(profiles)) and not hasattr(profiles, "nothing")
print(f"{profiles.roundness.evaluate(range(0, 360, 60), [1, 0, 1, 0, 1, 0], None).ront_um:.9f}")
for name in profiles.__all__:
    assert getattr(profiles, name).__name__.startswith("profiles.")
"""


def test_a_plain_script_needs_one_import() -> None:
    """What it may name is what type checkers are told."""
    stub = Path(profiles.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    assert re.findall(r"^    \"(\w+)\",$", stub, re.MULTILINE) == profiles.__all__
    done = subprocess.run([sys.executable, "-c", IMPORTS_SCRIPT], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == ("1.000000000", "")
