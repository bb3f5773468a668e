"""A lathe has one identity, made once; what needs an optional part says which one."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import console.session.extras as extras
from console.session.errors import SessionError
from console.site.shop.identity import LatheIdentity, lathe_identity
from profiles.problem import ProblemError
from tests.console.test_run_reader import record

Console = Callable[..., Any]


def test_it_is_made_once_also_by_consoles_that_start_together(tmp_path: Path) -> None:
    found: list[LatheIdentity] = []
    threads = [threading.Thread(target=lambda: found.append(lathe_identity(tmp_path))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set(found)) == 1 and len(found) == 8
    assert lathe_identity(tmp_path) == found[0]
    other = tmp_path / "other"
    other.mkdir()
    assert lathe_identity(other).lathe_id != found[0].lathe_id


def test_the_name_may_be_edited_and_the_id_stays(tmp_path: Path) -> None:
    first = lathe_identity(tmp_path)
    path = tmp_path / "lathe.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "name": "선반 3"}), encoding="utf-8")
    assert lathe_identity(tmp_path) == LatheIdentity(first.lathe_id, "선반 3")


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{}",
        "[]",
        '{"schema": 2}',
        '{"schema": 1, "id": "x", "name": "a"}',
        '{"schema": 1, "id": 3, "name": "a"}',
        f'{{"schema": 1, "id": "{"0" * 32}", "name": " "}}',
        f'{{"schema": 1, "id": "{"0" * 32}", "name": "a\\u001b"}}',
    ],
)
def test_a_file_that_is_none_is_refused_and_not_replaced(content: str, tmp_path: Path) -> None:
    path = tmp_path / "lathe.json"
    path.write_text(content)
    with pytest.raises(ProblemError) as error:
        lathe_identity(tmp_path)
    assert error.value.problems[0].code == "ship.identity"
    assert path.read_text() == content


def test_a_folder_that_is_not_there_is_not_made(tmp_path: Path) -> None:
    with pytest.raises(SessionError) as error:
        lathe_identity(tmp_path / "typo")
    assert error.value.problems[0].code == "ship.no_folder"
    assert not (tmp_path / "typo").exists()


def test_without_the_optional_part_it_says_which_to_install(
    console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path / "lathe", 2.0)
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    for words in (
        ("ship", "--data", str(tmp_path / "lathe")),
        ("ship", "--once", "--data", str(tmp_path / "lathe")),
        ("records", "list", "--shop", "dbname=shop"),
    ):
        said = console(*words)
        assert (said.code, said.out) == (1, "")
        assert "pip install 'trilobe[shop]'" in said.err and "psycopg" in said.err
    said = console("records", "list", "--data", str(tmp_path / "lathe"), "--lang", "ko")
    assert said.code == 0 and "2.00" in said.out
