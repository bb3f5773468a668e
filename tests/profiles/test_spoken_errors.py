"""An error speaks English by itself: what, where, value, limit and remedy, without a console."""

import errno
import os
import subprocess
import sys

from profiles.problem import Problem, ProblemError, ProfileError
from profiles.words.sentences import Sentences, words_of

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


def test_every_problem_is_told_and_its_code_stands_in_the_traceback() -> None:
    both = Problem(code="file.exists", where="b.json"), Problem(code="no.such_code", value="3 mm")
    error = ProblemError(*both)
    assert all(str(problem) in str(error) for problem in both)
    assert error.__notes__ == ["file.exists · b.json; no.such_code · actual 3 mm"]
    assert str(both[1]) == both[1].facts, "better an ugly line than none"


def test_it_needs_neither_drivers_nor_console() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    assert "no-such-job" in done.stdout and done.stdout.count("\n") == 1


def test_the_driver_speaks_without_a_console() -> None:
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
