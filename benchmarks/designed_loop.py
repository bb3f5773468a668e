"""Gains of the tool as `console tune show` proposes them for a simulated lathe, from its two sweeps.

The commands are those that an operator types (docs/tuning.md), each on a simulated lathe of its own; nothing of
the proposal is written into a controller: a machine profile has it.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from console.__main__ import main as console
from console.session.tuning.bounds import FAST_SWEEP, SLOW_SWEEP
from profiles.axis.servo_gains import gains_from_variables, with_variables
from profiles.store import load_machine

MACHINE = "lee-2001-lathe"


def told(*words: str) -> dict[str, Any]:
    """Return what a command prints with `--json`. Raises RuntimeError: it has failed."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        code = console([*words, "--json"])
    if code:
        raise RuntimeError(f"{' '.join(words)}: exit code {code}")
    answer: dict[str, Any] = json.loads(said.getvalue())
    return answer


def sweep(plant: str, seed: int, data: Path) -> None:
    """Measure the tool of a simulated lathe in the two sweeps that a design needs, with the published gains."""
    for asked in (SLOW_SWEEP, FAST_SWEEP):
        told("identify", "--sim", "--plant", plant, "--seed", str(seed), "--data", str(data), *asked.split())


def proposed(data: Path, machine: str = MACHINE) -> dict[str, Any]:
    """Return the proposal of `console tune show` for a machine. Raises RuntimeError: there is none."""
    shown = told("tune", "show", "--machine", machine, "--data", str(data))
    if shown["proposal"] is None:
        raise RuntimeError(f"no gains are proposed: {shown['reasons']}")
    proposal: dict[str, Any] = shown["proposal"]
    return proposal


def machine_text(settings: Mapping[str, float]) -> str:
    """Return the bundled machine profile with these variables of its tool, and with the gains that they are."""
    gains = gains_from_variables(with_variables(load_machine(MACHINE).machine, settings))
    behind = gains.at_rest
    values = {
        **settings,
        "gain_kp_v_per_m": behind.kp_v_per_m,
        "gain_ki_v_per_m_s": behind.ki_v_per_m_s,
        "gain_kd_v_s_per_m": behind.kd_v_s_per_m,
        **dict(zip(("notch_n1", "notch_n2", "notch_d1", "notch_d2"), gains.notch.coefficients, strict=True)),
    }
    text = (files("profiles.library.machines") / f"{MACHINE}.toml").read_text(encoding="utf-8")
    for name, value in values.items():
        text, count = re.subn(rf"(?m)^{name} *= *[^\s#]+", f"{name} = {value}", text)
        if not count and value:  # a filter, which the bundled machine has none of
            table = "[tool]" if name.startswith("notch") else "[controller.variables]"
            text = text.replace(f"{table}\n", f"{table}\n{name} = {value}\n", 1)
    return text
