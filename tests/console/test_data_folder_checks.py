"""What `console doctor` says of the data folder, in both languages, with the remedy."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from console.cli.machine.data_folder_checks import data_folder_checks
from console.text.catalogue import LANGUAGES, load
from console.text.checks import check_fields


def said(data: Path, language: str = "en") -> list[tuple[str, str, str]]:
    fields = check_fields(data_folder_checks(data), load(language))
    return [(str(each["code"]), str(each["outcome"]), str(each["text"])) for each in fields]


CASES = {
    0o700: ("data_folder_private", "holds", "only its owner can write"),
    0o755: ("data_folder_private", "holds", "only its owner can write"),  # and everybody can read
    0o2770: ("data_folder_shared", "holds", "shared within the group"),
    0o2777: ("data_folder_open", "fails", "chmod o-rwx"),
    0o777: ("data_folder_open", "fails", "chmod o-rwx"),
    0o2750: ("data_folder_half", "warned", "chmod 2770"),
    0o770: ("data_folder_not_setgid", "warned", "chmod 2770"),
    0o3770: ("data_folder_sticky", "warned", "chmod -t"),
}


def test_rights_that_share_too_much_or_only_half_are_said_with_the_remedy(tmp_path: Path) -> None:
    for mode, (code, outcome, words) in CASES.items():
        tmp_path.chmod(mode)
        ((found, how, text),) = said(tmp_path)
        assert (found, how, words in text, str(tmp_path) in text) == (code, outcome, True, True), text
        assert re.search(r"GB free|\([d-][rwxstST-]{9} ", text), text
        ((_, _, korean),) = said(tmp_path, "ko")
        assert str(tmp_path) in korean and korean != text and "check." not in korean


def test_what_the_group_cannot_use_is_counted_and_the_first_named(tmp_path: Path) -> None:
    tmp_path.chmod(0o2770)
    (tmp_path / "jobs").mkdir()
    (tmp_path / "jobs").chmod(0o2770)
    for name, mode in (("a.toml", 0o660), ("b.toml", 0o640), ("c.toml", 0o600)):
        (tmp_path / "jobs" / name).touch()
        (tmp_path / "jobs" / name).chmod(mode)
    ((code, outcome, text),) = said(tmp_path)
    assert (code, outcome) == ("data_folder_closed", "warned")
    assert "2 files or folders, first jobs/b.toml" in text and "-exec chmod g+s '{}' +" in text


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_missing_folder_is_no_fault_and_a_full_disk_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, language: str
) -> None:
    assert [each[:2] for each in said(tmp_path / "new", language)] == [("data_folder_missing", "noted")]

    class Full:
        f_bavail, f_frsize = 10, 4096

    tmp_path.chmod(0o700)
    monkeypatch.setattr(os, "statvfs", lambda _: Full)
    ((code, outcome, text),) = said(tmp_path, language)
    assert (code, outcome, "0.0 GB" in text) == ("data_folder_full", "warned", True)
    (tmp_path / "file").touch()
    assert [each[:2] for each in said(tmp_path / "file" / "data", language)] == [("data_folder_unusable", "fails")]
