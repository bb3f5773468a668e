"""`console fault`: one line there, the answer back, and an exit code."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from tests.console.commands import Console

TIMEOUT_S = 10.0


@contextmanager
def answering(path: Path, said: bytes) -> Iterator[list[bytes]]:
    """Somebody at a socket who reads one line, and then says this."""
    lines: list[bytes] = []
    with closing(socket.socket(socket.AF_UNIX)) as listening:
        listening.bind(str(path))
        listening.listen()
        listening.settimeout(TIMEOUT_S)

        def serve() -> None:
            host, _ = listening.accept()
            with closing(host):
                host.settimeout(TIMEOUT_S)
                with host.makefile("rb") as reading:
                    lines.append(reading.readline())
                host.sendall(said)

        serving = threading.Thread(target=serve)
        serving.start()
        yield lines
        serving.join(TIMEOUT_S)


def test_the_words_are_one_line_and_the_answer_is_printed_without_its_verdict(
    console: Console, tmp_path: Path
) -> None:
    path = tmp_path / "faults"
    with answering(path, b"stranger-writes\nok\n") as lines:
        said = console("fault", f"unix:{path}", "inject", "stranger-writes", "line=#1J+ P1=3", "seed=3")
    assert (said.code, said.out, said.err) == (0, "stranger-writes\n", "")
    assert lines == [b"inject stranger-writes 'line=#1J+ P1=3' seed=3\n"]


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_refusal_is_told_in_one_line_with_its_reason(console: Console, tmp_path: Path, language: str) -> None:
    path = tmp_path / "faults"
    with answering(path, b"refused: nul: share '2' is not possible; allowed: 0 < share <= 1\n"):
        said = console("fault", f"control:unix:{path}", "inject", "nul", "share=2", "--lang", language)
    assert (said.code, said.out, len(said.err.splitlines())) == (1, "", 1)
    assert "nul: share '2' is not possible; allowed: 0 < share <= 1" in said.err


@pytest.mark.parametrize(("verdict", "reason"), [(b"ok", None), (b"refused: why", "why")])
def test_as_json_it_is_the_answer_and_the_reason(
    console: Console, tmp_path: Path, verdict: bytes, reason: str | None
) -> None:
    path = tmp_path / "faults"
    with answering(path, b"a\nb\n" + verdict + b"\n"):
        said = console("fault", f"unix:{path}", "active", "--json")
    assert json.loads(said.out) == {"schema": 1, "answer": ["a", "b"], "refused": reason, "simulated": True}
    assert said.code == (0 if reason is None else 1)


def test_a_line_feed_would_be_two_lines_and_is_refused(console: Console, tmp_path: Path) -> None:
    for language in ("en", "ko"):
        said = console("fault", f"unix:{tmp_path / 'nothing'}", "inject", "nul\nclear", "--lang", language)
        assert (said.code, said.out, len(said.err.splitlines())) == (2, "", 1)


def test_nobody_there_is_told(console: Console, tmp_path: Path) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        port = server.getsockname()[1]
    for address in (f"tcp:127.0.0.1:{port}", f"unix:{tmp_path / 'nothing'}"):
        said = console("fault", address, "list")
        assert (said.code, said.out, len(said.err.splitlines())) == (1, "", 1)


def test_an_answer_that_breaks_off_is_told(console: Console, tmp_path: Path) -> None:
    path = tmp_path / "faults"
    with answering(path, b"half a li"):
        said = console("fault", f"unix:{path}", "list")
    assert (said.code, said.out) == (1, "")


@pytest.mark.parametrize("words", [("fault",), ("fault", "unix:/run/x"), ("fault", "tcp:10.0.0.1:5", "list")])
def test_what_is_missing_or_elsewhere_is_wrong_usage(console: Console, words: tuple[str, ...]) -> None:
    said = console(*words)
    assert (said.code, said.out, len(said.err.splitlines())) == (2, "", 1)
