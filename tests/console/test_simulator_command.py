"""`console simulator` and the lathe behind `--sim`: what is opened, and refused before it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytest import MonkeyPatch

from console.cli.arguments import PLANTS as OFFERED_PLANTS
from console.cli.commands import build
from console.cli.library import simulated_address, true_parameters_of
from console.cli.machine.simulator import DIALECTS as OFFERED
from console.text.catalogue import load
from drivers.link.address import SimulatedAddress, TcpAddress
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.hosts.control_address import UnixAddress
from drivers.simulator.hosts.process import SimulatorProcess
from drivers.simulator.hosts.server import Listeners
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import PLANTS
from drivers.simulator.plant.true_parameters import TrueParameters, ideal
from profiles.machine import MachineProfile
from profiles.problem import ProfileError
from profiles.store import load_job, load_machine
from tests.console.commands import Console
from tests.console.floor import known

TCP = ("--tcp", "127.0.0.1:1025")


@pytest.fixture
def served(monkeypatch: MonkeyPatch) -> list[tuple[Listeners, float]]:
    """What was to be served, by a server that ends at once."""
    calls: list[tuple[Listeners, float]] = []

    def serve(_: SimulatedLathe, listeners: Listeners, ready: Callable[[str], None], speed: float) -> None:
        calls.append((listeners, speed))
        ready("tcp:127.0.0.1:1025")
        ready("serial:/dev/pts/7")

    monkeypatch.setattr("drivers.simulator.hosts.server.serve", serve)
    return calls


def test_listeners_are_those_that_are_named(console: Console, served: list[tuple[Listeners, float]]) -> None:
    address = TcpAddress(host="127.0.0.1", port=1025)
    for words in (TCP, ("--ethernet", "127.0.0.1:1025"), ("--pty",), (*TCP, "--pty", "--speed", "0.01")):
        assert console("simulator", *words).code == 0
    assert served == [
        (Listeners(tcp=address), 1.0),
        (Listeners(ethernet=address), 1.0),
        (Listeners(pty=True), 1.0),
        (Listeners(tcp=address, pty=True), 0.01),
    ]


def test_each_listener_is_a_line(console: Console, served: list[tuple[Listeners, float]]) -> None:
    lines = [json.loads(line) for line in console("simulator", *TCP, "--pty", "--json").out.splitlines()]
    assert [line["listening"] for line in lines] == ["tcp:127.0.0.1:1025", "serial:/dev/pts/7"]
    assert all(line["simulated"] is True for line in lines)
    plain = console("simulator", *TCP, "--pty").out.splitlines()
    assert len(plain) == 2
    assert all(line.startswith("SIM ") for line in plain)
    assert plain[1].endswith("serial:/dev/pts/7")


def test_faults_have_no_listener_of_their_own(console: Console, served: list[tuple[Listeners, float]]) -> None:
    assert console("simulator", "--control", "tcp:127.0.0.1:0").code == 2
    assert console("simulator", "--pty", "--control", "tcp:[::1]:5").code == 0
    assert console("simulator", "--pty", "--control", "control:unix:/run/faults").code == 0
    assert [listeners.control for listeners, _ in served] == [
        TcpAddress(host="::1", port=5),
        UnixAddress(path="/run/faults"),
    ]


FAULTS_HERE = ("--control", "127.0.0.1", "unix:PATH")
USAGE: list[tuple[tuple[str, ...], tuple[str, ...]]] = [
    *(
        ((*TCP, "--control", f"tcp:{at}:1"), FAULTS_HERE)
        for at in ("0.0.0.0", "192.168.1.5", "[::]", "lathe.example")
    ),
    *(
        ((*TCP, f"--control={address}"), ())
        for address in ("", "tcp", "tcp:1", "unix:", "127.0.0.1:5", f"unix:/{'x' * 107}")
    ),
    ((), ("--tcp", "--ethernet", "--pty")),
    *(
        ((*TCP, f"--speed={speed}"), ("--speed", speed, "0.01 - 100"))
        for speed in ("0", "0.009", "100.1", "-1", "nan", "inf", "fast", "")
    ),
    *(((option, "nonsense"), (option, "nonsense", "HOST:PORT")) for option in ("--tcp", "--ethernet")),
    *(((*TCP, f"--clamping-sd={percent}"), ("--clamping-sd",)) for percent in ("-1", "51", "x", "nan")),
    *(
        ((*TCP, "--plant", "mounted", "--seed", seed), ("--seed", "4294967295"))
        for seed in ("", "-1", "1.5", "x", "\u0663", "4294967296")
    ),
    ((*TCP, "--seed", "7"), ("--seed", "--plant", "mounted", "steady")),
    ((*TCP, "--dialect", "power"), ("power", *OFFERED)),
    ((*TCP, "--plant", "new"), ("--plant", "new", *OFFERED_PLANTS)),
]


@pytest.mark.parametrize("language", ["en", "ko"])
def test_wrong_usage_is_one_line_that_names_what_there_is(
    console: Console, served: list[tuple[Listeners, float]], language: str
) -> None:
    for words, told in USAGE:
        said = console("simulator", *words, "--lang", language)
        assert (said.code, said.out, len(said.err.splitlines())) == (2, "", 1), words
        assert all(word in said.err for word in told), said.err
    assert served == []
    assert (sorted(OFFERED), sorted(OFFERED_PLANTS)) == (sorted(DIALECTS), sorted(PLANTS))


def test_a_file_that_save_did_not_write_is_refused_before_anything_listens(
    console: Console, served: list[tuple[Listeners, float]], tmp_path: Path
) -> None:
    other = tmp_path / "notes.json"
    other.write_text("[1, 2]", encoding="utf-8")
    result = console("simulator", *TCP, "--saved", str(other))
    assert result.code == 1
    assert "notes.json" in result.err
    assert served == []


@pytest.fixture
def lathes(monkeypatch: MonkeyPatch) -> list[SimulatedLathe]:
    """The lathes that were to be served, by a server that ends at once."""
    served: list[SimulatedLathe] = []
    monkeypatch.setattr("drivers.simulator.hosts.server.serve", lambda lathe, *_: served.append(lathe))
    return served


def jaw_1_deg(lathe: SimulatedLathe) -> float:
    return lathe.look().jaw_1_past_mark_deg


def test_chance_is_drawn_from_the_seed(console: Console, lathes: list[SimulatedLathe]) -> None:
    """Without a word the lathe is left 0.3456 turns from its index, where jaw 1 is: 124.42 deg."""
    for words in ((), ("--plant", "ideal")):
        assert console("simulator", *TCP, *words).code == 0
    assert [jaw_1_deg(lathe) for lathe in lathes] == [124.42, 124.42]
    for plant in ("mounted", "steady"):
        lathes.clear()
        for words in (("--seed", "7"), ("--seed", "7"), ("--seed", "8"), (), ()):
            assert console("simulator", *TCP, "--plant", plant, *words).code == 0
        jaws = [jaw_1_deg(lathe) for lathe in lathes]
        assert jaws[0] == jaws[1] and len(set(jaws)) > 2


def test_a_plant_may_be_a_file_of_ones_own(console: Console, lathes: list[SimulatedLathe], tmp_path: Path) -> None:
    """A slide of 1.25 times the mass goes that much less far under the same force."""
    plant = tmp_path / "heavy.toml"
    plant.write_text("[tool]\nmass_factor = 1.25\n", encoding="utf-8")
    ways = []
    for name in ("ideal", str(plant)):
        assert console("simulator", *TCP, "--plant", name).code == 0
        port = lathes[-1].connect()
        port.receive(b"#1O10\r")
        motor = lathes[-1].controller.motors[1]
        before = motor.actual
        lathes[-1].wait(0.02)
        ways.append(motor.actual - before)
    assert ways[0] / ways[1] == pytest.approx(1.25, rel=0.05)


def test_a_wrong_plant_file_says_what_is_wrong(console: Console, tmp_path: Path) -> None:
    plant = tmp_path / "mine.toml"
    plant.write_text("[tool]\nmass_facter = 1.05\ncoulomb_friction_n = 99.0\n", encoding="utf-8")
    said = console("simulator", *TCP, "--plant", str(plant))
    assert said.code == 1
    assert all(word in said.err for word in ("mine.toml", "mass_facter", "mass_factor"))


def told(*words: str) -> SimulatedAddress | None:
    machine: MachineProfile = load_machine("lee-2001-lathe").machine
    return simulated_address(build(load("en")).parse_args(["--sim", *words]), machine)


def test_a_plant_a_seed_and_a_spread_are_handed_on(tmp_path: Path) -> None:
    assert told() is None, "the lathe of every day"
    asked = told("--plant", "steady", "--seed", "7", "--clamping-sd", "2.5")
    assert asked == SimulatedAddress(plant="steady", seed=7, clamping_sd_percent=2.5)
    assert told("--seed", "7") == SimulatedAddress(seed=7)
    with pytest.raises(ProfileError, match=r"file.unreadable"):
        told("--plant", str(tmp_path / "no.toml"))


def plant(*words: str) -> TrueParameters | None:
    machine: MachineProfile = load_machine("lee-2001-lathe").machine
    return true_parameters_of(
        build(load("en")).parse_args(["run", "lee-2001-experiment-1", "--sim", *words]), machine
    )


def test_a_run_that_nobody_aligns_is_on_a_lathe_that_needs_no_alignment() -> None:
    """A seed or a spread alone leaves it as its profile says, with jaw 1 and the tip where the job has them."""
    nominal = ideal(load_machine("lee-2001-lathe").machine)
    assert plant() is None
    assert plant("--seed", "1") == replace(nominal, seed=1)
    assert plant("--seed", "1", "--clamping-sd", "3") == replace(nominal, seed=1, clamping_force_spread=0.03)
    real = known(plant("--plant", "steady", "--seed", "1"))
    assert (real.jaw_1_deg, real.home_radius_mm) == (None, nominal.home_radius_mm)


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_run_on_a_lathe_to_be_aligned_is_refused(console: Console, language: str) -> None:
    words = ("run", "lee-2001-experiment-1", "--sim", "--plant", "mounted", "--seed", "1", "--lang", language)
    said = console(*words)
    assert (said.code, said.out) == (1, "")
    assert all(word in said.err for word in ("console --sim --plant mounted", "ideal", "steady"))


def test_how_the_simulated_lathe_is_says_nothing_of_a_real_one(console: Console) -> None:
    said = console("run", "lee-2001-experiment-1", "--link", "tcp:127.0.0.1:9", "--yes", "--seed", "1")
    assert said.code == 2
    assert "--sim" in said.err


@pytest.mark.long
def test_the_process_behind_the_screen_has_the_iron_that_was_asked_for(tmp_path: Path) -> None:
    """A lobe of 1.1 times the job's, and clampings that scatter; the chuck at an angle that the seed says."""
    plant = tmp_path / "strong.toml"
    plant.write_text("lobe_factor = 1.1\n", encoding="utf-8")
    job, path = load_job("lee-2001-experiment-1").job, load_machine("lee-2001-lathe").path
    lobes, angles = [], []
    for sd_percent in (0.0, 3.0):
        process = SimulatorProcess.start(path, seed=3, plant=str(plant), clamping_sd_percent=sd_percent)
        try:
            angles.append(process.look().jaw_1_past_mark_deg)
            for _ in range(2):
                process.mount(job)
                lobes.append(abs(np.fft.rfft(process.measure().deviation_um)[3]) / 1800)
        finally:
            process.close()
    assert lobes[:2] == pytest.approx([1.1 * 27.5] * 2)
    assert len({round(lobe, 3) for lobe in lobes}) == 3
    assert angles[0] == angles[1] != 124.42
