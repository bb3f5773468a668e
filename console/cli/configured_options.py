"""The configuration on the command line: what the options leave open is filled in."""

from __future__ import annotations

import os
from argparse import Namespace

from console.session.configuration import Configuration, Setting, SettingOrigin
from console.session.operator import VARIABLE

OPTIONS = {"data": "data", "machine": "machine", "link": "link", "indicator": "indicator", "language": "lang"}
"""Option of each key that has one; the language was chosen before the parser existed."""


def with_options(configuration: Configuration, options: Namespace) -> Configuration:
    """Return the configuration with what the command line gives, which wins."""
    given = {key: getattr(options, name) for key, name in OPTIONS.items()}
    return configuration.with_layer(
        {
            key: Setting(value=value, origin=SettingOrigin.OPTION, place=f"--{OPTIONS[key]}")
            for key, value in given.items()
            if value is not None
        }
    )


def fill_in(options: Namespace, configuration: Configuration) -> None:
    """Set the options that were not given to what the configuration says.

    With --sim the link of the configuration does not count: nothing real moves. The operator has no option; the
    name is left in the environment of this process, where the records look for it.
    """
    options.configuration = found = with_options(configuration, options)
    options.data, options.machine = found.value("data"), found.value("machine")
    if not options.sim:
        options.link = found.value("link")
    if operator := found.value("operator"):
        os.environ[VARIABLE] = operator
