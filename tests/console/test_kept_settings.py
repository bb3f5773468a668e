"""Settings kept in the configuration file: nothing else in it changes, and what cannot be kept is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.session.appearance import CHOICES, appearance_of, fault_in_keys, own_keys, own_keys_text
from console.session.configuration import KEYS, Origin, read_configuration
from console.session.kept_settings import keep_settings
from profiles.problem import ProfileError

GIVEN = """# of the shop
schema = 1
language = "en"   # the night shift
machine = "lathe-3"
"""

KEPT = {
    # what was in the file, what is set -> what is in it then
    (GIVEN, "language", "ko"): GIVEN.replace('"en"   #', '"ko"   #'),
    (GIVEN, "theme", "light"): GIVEN + 'theme = "light"\n',
    (GIVEN, "language", None): GIVEN.replace('language = "en"   # the night shift\n', ""),
    ("", "calm", "on"): 'calm = "on"\n',
    ("schema = 1", "calm", "on"): 'schema = 1\ncalm = "on"\n',
    ("  theme='dark'\n", "theme", "light"): 'theme = "light"\n',
}


def test_only_the_line_of_the_setting_changes(tmp_path: Path) -> None:
    path = tmp_path / "trilobe" / "config.toml"
    for (before, key, value), after in KEPT.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(before, encoding="utf-8")
        path.chmod(0o640)
        keep_settings(path, {key: value})
        assert path.read_text(encoding="utf-8") == after, (before, key)
        assert path.stat().st_mode & 0o777 == 0o640
        assert [each.name for each in path.parent.iterdir()] == ["config.toml"], "a temporary file was left"


def test_a_missing_file_is_made_with_its_folder_and_a_link_stays_one(tmp_path: Path) -> None:
    path, target = tmp_path / "a" / "b" / "config.toml", tmp_path / "dotfiles.toml"
    keep_settings(path, {"theme": "light"})
    assert path.read_text() == 'theme = "light"\n'
    target.write_text('theme = "dark"\n')
    path.unlink()
    path.symlink_to(target)
    keep_settings(path, {"theme": "contrast"})
    assert path.is_symlink() and target.read_text() == 'theme = "contrast"\n'


@pytest.mark.parametrize(
    ("content", "code"),
    [
        ('theme = """\ndark"""\n', "config.not_kept"),  # over two lines
        ('"theme" = "dark"\n', "config.not_kept"),  # a second line for the same key
        ("theme = [", "file.not_toml"),
    ],
)
def test_what_cannot_be_replaced_is_refused_and_stays(content: str, code: str, tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(content)
    with pytest.raises(ProfileError) as refused:
        keep_settings(path, {"theme": "light"})
    assert [problem.code for problem in refused.value.problems] == [code]
    assert path.read_text() == content


def test_every_setting_is_a_key_with_its_choices_and_later_places_win(tmp_path: Path) -> None:
    own = tmp_path / "trilobe" / "config.toml"
    environment = {"XDG_CONFIG_HOME": str(tmp_path)}
    for key, choices in CHOICES.items():
        assert key in KEYS
        for value in choices:
            keep_settings(own, {key: value})
            found = read_configuration(environment, tmp_path / "no-site.toml")
            assert (found.problems, found.value(key), found.settings[key].origin) == ((), value, Origin.FILE)
    found = read_configuration({**environment, "TRILOBE_THEME": "light", "TRILOBE_CALM": "yes"}, tmp_path / "no")
    assert found.settings["theme"].place == "TRILOBE_THEME"
    assert [(problem.key, problem.code) for problem in found.problems] == [("calm", "value.not_choice")]


def test_own_keys_are_read_as_they_are_written() -> None:
    keys = {"alarms.all": "q", "jobs.page_up": "f10", "recover": "z"}
    assert own_keys(own_keys_text(keys)) == keys and fault_in_keys(own_keys_text(keys)) == ""
    for wrong in ("run.arm", "run.arm=f9", "run.arm=f12", "run.arm=space", "run.arm=Q", "run.arm=f13", "=q"):
        assert fault_in_keys(f"alarms.all=q {wrong}") == wrong
    shown = appearance_of({"theme": "light", "keys": "alarms.all=q", "machine": "x"}, "ko")
    assert (shown.theme, shown.language, shown.keys, shown.glyphs) == (
        "light",
        "ko",
        {"alarms.all": "q"},
        "unicode",
    )
