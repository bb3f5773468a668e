"""Configuration of this console: a file of the machine, one of the account, variables; later ones win.

The command line comes last, as one more `Layer`. A file is read strictly: what is wrong in it is a problem, and
its sound values still count, so that `console config` can show both. Without files and variables nothing is
imported.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from console.session.appearance import CHOICES, KEYS_CAP_CHARACTERS, fault_in_keys
from console.session.operator import home_of
from profiles.words.sentences import LANGUAGES

if TYPE_CHECKING:
    from profiles.fields import Field
    from profiles.problem import Problem

SITE_FILE = Path("/etc/trilobe/config.toml")
PREFIX = "TRILOBE_"
KEYS = ("data", "machine", "link", "indicator", "language", "operator", *CHOICES, "keys")
OTHER_VARIABLES = ("TRILOBE_TRACEBACK", "TRILOBE_MQTT_USER", "TRILOBE_MQTT_PASSWORD", "TRILOBE_INSTRUCT_TOKEN")
"""Variables of ours that are no settings."""

LONGEST_PATH = 1024


class SettingOrigin(StrEnum):
    """Kind of the place that a value comes from."""

    FILE = "file"
    VARIABLE = "variable"
    OPTION = "option"
    BUILT_IN = "built_in"


class State(StrEnum):
    """What became of a configuration file."""

    READ = "read"
    MISSING = "missing"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A value and where it comes from: `place` is a file, a variable or an option, "" for one that is built in."""

    value: str | None
    origin: SettingOrigin
    place: str = ""


Layer = Mapping[str, Setting]
"""Settings from one file, from all variables, or from the command line, by key."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """What all layers together say. A key that is missing in `settings` has its built-in value.

    `link_set_aside` is a link that belongs to another machine than the one in force. `unknown` are variables that
    begin like ours and mean nothing.
    """

    settings: Mapping[str, Setting]
    files: Mapping[Path, State]
    problems: tuple[Problem, ...] = ()
    unknown: tuple[str, ...] = ()
    link_set_aside: Setting | None = None

    def value(self, key: str) -> str | None:
        """Return the value of a key, None for the built-in one."""
        return self.settings[key].value if key in self.settings else None

    def with_layer(self, layer: Layer) -> Configuration:
        """Return the configuration with a layer that wins over it."""
        settings, aside = _merge_layers((self.settings, layer))
        return replace(self, settings=settings, link_set_aside=aside or self.link_set_aside)


def read_configuration(environment: Mapping[str, str], site: Path = SITE_FILE) -> Configuration:
    """Read the file of the machine, that of the account, and the variables. Nothing is raised: see `problems`."""
    paths = [path for path in (site, account_file(environment)) if path is not None]
    layers: list[Layer] = []
    files: dict[Path, State] = {}
    problems: list[Problem] = []
    for path in paths:
        layer, files[path], wrong = _from_file(path)
        layers.append(layer)
        problems += wrong
    layer, wrong = _from_variables(environment)
    settings, aside = _merge_layers((*layers, layer))
    known = (*map(variable_of, KEYS), *OTHER_VARIABLES)
    unknown = sorted(name for name in environment if name.startswith(PREFIX) and name not in known)
    return Configuration(
        settings=settings, files=files, problems=(*problems, *wrong), unknown=tuple(unknown), link_set_aside=aside
    )


def account_file(environment: Mapping[str, str]) -> Path | None:
    """Return the file of this account (XDG base directories), None for an account without a home."""
    base = environment.get("XDG_CONFIG_HOME", "")
    # The XDG Base Directory Specification says to ignore a relative path in the variable.
    if not os.path.isabs(base):
        home = home_of(environment)
        if home is None:
            return None
        base = os.path.join(home, ".config")
    return Path(base) / "trilobe" / "config.toml"


def variable_of(key: str) -> str:
    """Return the variable of a key."""
    return PREFIX + key.upper()


def _from_file(path: Path) -> tuple[Layer, State, list[Problem]]:
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return {}, State.MISSING, []
    except OSError:
        pass  # the reason is found out by reading it
    from profiles.fields import read_fields, schema_problem
    from profiles.files import printable, read_toml
    from profiles.problem import ProfileError

    where = printable(str(path))
    try:
        _, table = read_toml(path)
    except ProfileError as error:
        other = {"file.not_toml": "config.not_toml", "file.unreadable": "config.unreadable"}
        return {}, State.REFUSED, [replace(each, code=other.get(each.code, each.code)) for each in error.problems]
    if problem := schema_problem(table, where=where):
        return {}, State.REFUSED, [problem]
    given = {key: value for key, value in table.items() if key != "schema"}
    values, problems = read_fields(_fields(), given, where=where)
    layer, wrong = _validate_values(values, where=dict.fromkeys(values, where))
    made = {key: Setting(value=value, origin=SettingOrigin.FILE, place=str(path)) for key, value in layer.items()}
    problems += wrong
    return made, State.REFUSED if problems else State.READ, problems


def _from_variables(environment: Mapping[str, str]) -> tuple[Layer, list[Problem]]:
    given = {key: environment[name] for key in KEYS if environment.get(name := variable_of(key))}
    if not given:
        return {}, []
    from profiles.fields import read_fields

    values: dict[str, Any] = {}
    problems: list[Problem] = []
    for field in _fields():
        if field.key in given:
            found, wrong = read_fields((field,), {field.key: given[field.key]}, where=variable_of(field.key))
            values |= found
            problems += wrong
    layer, wrong = _validate_values(values, where={key: variable_of(key) for key in values})
    made = {
        key: Setting(value=value, origin=SettingOrigin.VARIABLE, place=variable_of(key))
        for key, value in layer.items()
    }
    return made, [*problems, *wrong]


def _fields() -> tuple[Field, ...]:
    from profiles.fields import Field, FieldType

    return (
        Field(key="data", kind=FieldType.TEXT, optional=True, longest=LONGEST_PATH),
        Field(key="machine", kind=FieldType.TEXT, optional=True, longest=LONGEST_PATH),
        Field(key="link", kind=FieldType.TEXT, optional=True, longest=LONGEST_PATH),
        Field(key="indicator", kind=FieldType.TEXT, optional=True, longest=LONGEST_PATH),
        Field(key="language", kind=FieldType.CHOICE, choices=tuple(LANGUAGES), optional=True),
        Field(key="operator", kind=FieldType.TEXT, optional=True),
        *(Field(key=key, kind=FieldType.CHOICE, choices=each, optional=True) for key, each in CHOICES.items()),
        Field(key="keys", kind=FieldType.TEXT, optional=True, longest=KEYS_CAP_CHARACTERS),
    )


def _validate_values(values: Mapping[str, Any], where: Mapping[str, str]) -> tuple[dict[str, str], list[Problem]]:
    """Return the values that can be used, and the problems of the others; None is no value."""
    sound: dict[str, str] = {}
    problems: list[Problem] = []
    for key, value in values.items():
        if value is None:
            continue
        if problem := _fault(key, value):
            problems.append(replace(problem, where=where[key], key=key))
        else:
            sound[key] = value
    return sound, problems


def _fault(key: str, value: str) -> Problem | None:
    from profiles.fields import spell_toml
    from profiles.problem import Problem, ProblemError

    if not value:
        return Problem(code="value.blank", value=spell_toml(value))
    is_path = key == "data" or (key == "machine" and (os.sep in value or value.endswith(".toml")))
    # Relative to what? The folder of the file and that in which the console was started are both guesses.
    if is_path and not os.path.isabs(value):
        return Problem(code="config.relative_path", value=spell_toml(value))
    if key == "keys" and (entry := fault_in_keys(value)):
        return Problem(code="config.bad_key", value=spell_toml(entry))
    if key in ("link", "indicator"):
        from drivers.link import address, indicator

        try:
            (address.parse_address if key == "link" else indicator.parse_indicator)(value)
        except ProblemError as error:
            return error.problems[0]
    return None


def _merge_layers(layers: Iterable[Layer]) -> tuple[dict[str, Setting], Setting | None]:
    """Return the settings of all layers, the last ones winning; and the link that was set aside.

    A link leads to one machine. Where a later layer names another, the link of an earlier one does not count.
    """
    settings: dict[str, Setting] = {}
    aside: Setting | None = None
    for layer in layers:
        machine = settings["machine"].value if "machine" in settings else None
        if "machine" in layer and layer["machine"].value != machine and "link" in settings:
            aside = settings.pop("link")
        settings |= layer
    return settings, None if "link" in settings else aside
