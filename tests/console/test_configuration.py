"""The configuration: files, variables, command line; what is wrong is said with its place; settings kept."""

from __future__ import annotations

import os
import pwd
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import pytest
from pytest import MonkeyPatch

from console.cli.configured_options import fill_in
from console.session.appearance import CHOICES, appearance_of, fault_in_keys, own_keys, own_keys_text
from console.session.configuration import KEYS, Configuration, SettingOrigin, State, read_configuration
from console.session.kept_settings import keep_settings
from drivers.simulator.hosts.process import SimulatorProcess
from profiles.problem import ProfileError
from tests.console.commands import Console

EXPERIMENT = "lee-2001-experiment-1"
OTHER, DEFAULT = "turbo-ethernet-lathe", "lee-2001-lathe"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    path = tmp_path / "etc" / "config.toml"
    path.parent.mkdir()
    return path


@pytest.fixture
def own(tmp_path: Path, monkeypatch: MonkeyPatch) -> Path:
    """The file of this account."""
    path = tmp_path / "own" / "trilobe" / "config.toml"
    path.parent.mkdir(parents=True)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "own"))
    return path


def read(site: Path, own: Path, **variables: str) -> Configuration:
    named = {f"TRILOBE_{name}": value for name, value in variables.items()}
    return read_configuration({"XDG_CONFIG_HOME": str(own.parents[1]), **named}, site)


def test_later_ones_win_and_each_value_has_its_place(site: Path, own: Path) -> None:
    nothing = read(site, own)
    assert (nothing.settings, nothing.problems, set(nothing.files.values())) == ({}, (), {State.MISSING})
    site.write_text('schema = 1\ndata = "/var/lib/trilobe"\nmachine = "a"\nlanguage = "ko"\noperator = "line 3"\n')
    own.write_text('machine = "b"\noperator = "kim"\n')
    found = read(site, own, OPERATOR="lee", LANGUAGE="")
    assert {key: (each.value, each.place) for key, each in found.settings.items()} == {
        "data": ("/var/lib/trilobe", str(site)),
        "machine": ("b", str(own)),
        "language": ("ko", str(site)),
        "operator": ("lee", "TRILOBE_OPERATOR"),
    }
    assert (found.problems, found.unknown) == ((), ())
    assert found.files == {site: State.READ, own: State.READ}
    site.unlink()
    own.unlink()
    site.mkdir()
    os.mkfifo(own)
    unreadable = [(each.code, each.where) for each in read(site, own).problems]
    assert unreadable == [("config.unreadable", str(path)) for path in (site, own)]


REFUSED = {
    'machin = "x"': ("key.unknown", "machin", "", "machine"),
    "data = 3": ("value.not_text", "data", "3", "<= 1024 characters, one line"),
    'data = "lathe/data"': ("config.relative_path", "data", '"lathe/data"', ""),
    'data = "~/data"': ("config.relative_path", "data", '"~/data"', ""),
    'machine = "mine.toml"': ("config.relative_path", "machine", '"mine.toml"', ""),
    'link = "tcp:lathe"': ("link.bad_address", "link", "tcp:lathe", "tcp:HOST:PORT, 1 <= PORT <= 65535"),
    'language = "de"': ("value.not_choice", "language", '"de"', "en | ko"),
    'operator = ""': ("value.blank", "operator", '""', ""),
    "schema = 2": ("schema.unsupported", "schema", "2", "1"),
    "[data]\nfolder = 1": ("value.not_text", "data", "{folder}", "<= 1024 characters, one line"),
    "data = [": ("config.not_toml", "1", "9", '"data = ["'),
}


def test_what_is_wrong_in_a_file_is_named_with_file_key_value_and_limit(site: Path, own: Path) -> None:
    for content, expected in REFUSED.items():
        for path, other in ((site, own), (own, site)):
            path.write_text(content, encoding="utf-8")
            other.unlink(missing_ok=True)
            (problem,) = read(site, own).problems
            assert (problem.code, problem.key, problem.value, problem.limit) == expected
            assert problem.where == str(path)


def test_a_wrong_variable_is_named_and_one_that_means_nothing_is_noted(site: Path, own: Path) -> None:
    found = read(site, own, DATA="lathe", LANGUAGE="kr", MACHIN="x", TRACEBACK="1", LINK="tcp:lathe:1025")
    assert [(each.where, each.key) for each in found.problems] == [
        ("TRILOBE_LANGUAGE", "language"),
        ("TRILOBE_DATA", "data"),
    ]
    assert found.unknown == ("TRILOBE_MACHIN",)
    assert found.value("link") == "tcp:lathe:1025"


def test_a_link_does_not_follow_to_another_machine(site: Path, own: Path) -> None:
    site.write_text('machine = "a"\nlink = "tcp:a:1025"\n')
    cases: tuple[tuple[str, str | None], ...] = (
        ("", "tcp:a:1025"),
        ('machine = "a"', "tcp:a:1025"),
        ('machine = "b"', None),
        ('machine = "b"\nlink = "tcp:b:1025"', "tcp:b:1025"),
        ('link = "tcp:c:1025"', "tcp:c:1025"),
    )
    for content, link in cases:
        own.write_text(content)
        found = read(site, own)
        assert found.value("link") == link
        assert (found.link_set_aside is not None) == (link is None)


def test_the_command_line_beats_the_file_and_config_shows_from_where(console: Console, own: Path) -> None:
    own.write_text(f'data = "/var/lib/trilobe"\nmachine = "{OTHER}"\nlink = "tcp:lathe:1025"\n')
    said = console("--machine", DEFAULT, "config", "--json")
    settings = said.json["settings"]
    assert (said.code, settings["data"]) == (
        0,
        {"value": "/var/lib/trilobe", "origin": "file", "place": str(own)},
    )
    assert settings["machine"] == {"value": DEFAULT, "origin": "option", "place": "--machine"}
    assert settings["link"]["value"] is None and "tcp:lathe:1025" in said.json["notes"][0]
    assert settings["operator"]["value"] == pwd.getpwuid(os.getuid()).pw_name
    lines = console("config").out.splitlines()
    assert [line.split()[0] for line in lines[:7]] == [
        "setting",
        "data",
        "machine",
        "link",
        "indicator",
        "language",
        "operator",
    ]
    assert f"{own}  read" in " ".join(lines).replace("   ", "  ")


def test_the_machine_and_the_data_of_the_file_are_used(console: Console, own: Path, tmp_path: Path) -> None:
    data = tmp_path / "lathe"
    (data / "jobs").mkdir(parents=True)
    (data / "jobs" / "mine.toml").write_text("", encoding="utf-8")
    own.write_text(f'data = "{data}"\nmachine = "nowhere"\nlanguage = "ko"\n')
    assert "mine" in {job["name"] for job in console("jobs", "--json").json["jobs"]}
    assert '없는 기계: "nowhere"' in console("preview", EXPERIMENT).err
    assert '"elsewhere"' in console("preview", EXPERIMENT, "--machine", "elsewhere").err
    assert console("config").out.startswith("설정")
    assert console("config", "--lang", "en").out.startswith("setting")


def test_with_a_machine_in_the_file_plain_console_opens_the_screens(console: Console, own: Path) -> None:
    assert console().code == 2
    own.write_text(f'machine = "{OTHER}"\n')
    said = console()
    assert said.code == 1 and "the screens need a terminal" in said.err


def test_sim_simulates_whatever_link_is_configured(console: Console, own: Path, monkeypatch: MonkeyPatch) -> None:
    own.write_text(f'machine = "{OTHER}"\nlink = "tcp:192.0.2.1:1025"\n')  # an address of documentation (RFC 5737)
    started: list[object] = []

    def starts(*words: object) -> None:
        started.append(words)
        raise KeyboardInterrupt

    monkeypatch.setattr(SimulatorProcess, "start", starts)
    assert (console("--sim", "doctor").code, len(started)) == (1, 1)
    assert "does not count with --sim" in console("--sim", "config").out
    options = Namespace(data=None, machine=None, link=None, indicator=None, lang=None, sim=True)
    fill_in(options, read_configuration(os.environ, own))
    assert (options.machine, options.link) == (OTHER, None)


def test_a_broken_configuration_is_refused_by_all_but_the_commands_that_help(console: Console, own: Path) -> None:
    own.write_text('data = "x"\nlanguage = "ko"\noperatr = "kim"\n')
    for words in (("jobs",), (), ("--sim",), ("run", "x", "--sim"), ("backup", "x.tar.gz")):
        said = console("--lang", "en", *words)
        assert (said.code, said.out) == (1, "")
        assert said.err == (
            f"console: {own}: operatr is not a key of this file; possible: operator\n"
            f'console: {own}: data = "x" is no absolute path; write one that begins with /\n'
        )
    assert [console(*words).code for words in (("--help",), ("run", "--help"), ("--version",))] == [0, 0, 0]
    said = console("config", "--json")
    assert (said.code, len(said.json["problems"]), said.json["settings"]["language"]["value"]) == (1, 2, "ko")
    assert {"file": str(own), "state": "refused"} in said.json["files"]


def test_a_real_console_reads_its_variables_and_the_file_of_its_account(own: Path, tmp_path: Path) -> None:
    own.write_text(f'machine = "{OTHER}"\n')
    environment = {**os.environ, "TRILOBE_DATA": str(tmp_path / "data"), "TRILOBE_MACHIN": "x", "LANG": "C.UTF-8"}
    words = [sys.executable, "-m", "console", "config"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    rows = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if line.split()}
    assert rows["data"] == [str(tmp_path / "data"), "TRILOBE_DATA"]
    assert rows["machine"] == [OTHER, str(own)]
    assert "TRILOBE_MACHIN is no variable" in done.stdout


def test_without_a_configuration_nothing_more_is_imported() -> None:
    code = (
        "import sys, console.session.configuration as c; "
        "from pathlib import Path; "
        "c.read_configuration({'XDG_CONFIG_HOME': '/nowhere'}, Path('/nowhere/config.toml')); "
        "unwanted = ('profiles.fields', 'tomlkit', 'numpy', 'sqlite3', 'drivers'); "
        "print(*(name for name in unwanted if name in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.strip() == ""


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
    path, target = tmp_path / "a" / "b" / "config.toml", tmp_path / "dotfiles.toml"
    keep_settings(path, {"theme": "light"})
    assert path.read_text() == 'theme = "light"\n', "a missing file is made with its folder"
    target.write_text('theme = "dark"\n')
    path.unlink()
    path.symlink_to(target)
    keep_settings(path, {"theme": "contrast"})
    assert path.is_symlink() and target.read_text() == 'theme = "contrast"\n'
    for content, code in (
        ('theme = """\ndark"""\n', "config.not_kept"),  # over two lines
        ('"theme" = "dark"\n', "config.not_kept"),  # a second line for the same key
        ("theme = [", "file.not_toml"),
    ):
        target.write_text(content)
        with pytest.raises(ProfileError) as refused:
            keep_settings(target, {"theme": "light"})
        assert [problem.code for problem in refused.value.problems] == [code]
        assert target.read_text() == content


def test_every_setting_is_a_key_with_its_choices_and_later_places_win(tmp_path: Path) -> None:
    own = tmp_path / "trilobe" / "config.toml"
    environment = {"XDG_CONFIG_HOME": str(tmp_path)}
    for key, choices in CHOICES.items():
        assert key in KEYS
        for value in choices:
            keep_settings(own, {key: value})
            found = read_configuration(environment, tmp_path / "no-site.toml")
            assert (found.problems, found.value(key), found.settings[key].origin) == (
                (),
                value,
                SettingOrigin.FILE,
            )
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
