"""The lock file pins everything by hash and names no server."""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from console.__main__ import main
from console.cli.whole_parser import whole_parser
from console.text.catalogue import load

ROOT = Path(__file__).parents[2]
PINNED = re.compile(r"([a-z0-9][a-z0-9._-]*)==[^ ;\\]+")
HASH = re.compile(r"--hash=sha256:[0-9a-f]{64}")


def lock() -> str:
    return (ROOT / "requirements.lock").read_text(encoding="utf-8")


def requirements() -> dict[str, list[str]]:
    """Each pinned distribution with its hashes."""
    found: dict[str, list[str]] = {}
    name = ""
    for line in lock().splitlines():
        if line.startswith((" ", "#")):
            found.setdefault(name, []).extend(HASH.findall(line))
        else:
            match = PINNED.match(line)
            assert match, line
            name = match[1]
    return found


def normal(requirement: str) -> str:
    return re.split(r"[<>=!~;\[ ]", requirement)[0].lower().replace("_", "-").replace(".", "-")


def test_no_address_and_no_option_in_the_lock() -> None:
    text = lock()
    assert "://" not in text
    assert "--index" not in text and "--find-links" not in text and "--extra-index" not in text
    assert not re.search(r"(^|\s)/\w", text), "a path of some machine"


def test_every_requirement_has_a_hash() -> None:
    assert len(requirements()) > 20
    assert [name for name, hashes in requirements().items() if not hashes] == []


def test_every_direct_dependency_is_locked() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [item for items in project["optional-dependencies"].values() for item in items]
    target = {normal(item) for item in (*project["dependencies"], *extras)}
    assert sorted(target - set(requirements())) == []


def test_the_compiled_build_brings_the_packages_whose_types_it_reads() -> None:
    """mypyc checks the types of each module that a compiled one imports, in an environment of its own."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    hook = tool["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]
    untyped = {name.split(".")[0] for each in tool["mypy"]["overrides"] for name in each["module"]}
    found: set[str] = set()
    seen, asked = set(), [ROOT / each for each in hook["modules"]]
    while asked:
        path = asked.pop()
        if path in seen:
            continue
        seen.add(path)
        for name in imported(path):
            place = ROOT.joinpath(*name.split("."))
            asked += [each for each in (place.with_suffix(".py"), place / "__init__.py") if each.is_file()]
            found.add(name.split(".")[0])
    foreign = found - sys.stdlib_module_names - {"console", "drivers", "profiles"} - untyped
    assert foreign, "the trajectories are computed with numpy"
    assert sorted(foreign - {normal(each) for each in hook["dependencies"]}) == []


def imported(path: Path) -> set[str]:
    """Each module that a file imports, and each name of it, which may be a module."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    return names


# What is deployed with systemd, udev and containers names commands and files that there are.


DEPLOY = ROOT / "docs" / "deploy"
UNITS = sorted(DEPLOY.glob("*.service"))
BUILDERS = ("podman", "buildah", "docker")
UNREACHABLE = r"pinging container registry|no such host|connection refused|i/o timeout"


def commands(unit: Path) -> list[str]:
    found = re.search(r"(?m)^ExecStart=(.*)$", unit.read_text(encoding="utf-8"))
    assert found is not None
    return shlex.split(found[1].replace("%i", "lathe-3").replace("${BROKER}", "broker.shop"))


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_unit_starts_a_command_with_options_that_it_has(unit: Path) -> None:
    program, *words = commands(unit)
    assert program == "/usr/local/bin/console"
    assert whole_parser(load("en")).parse_args(words).command == words[0]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_systemd_finds_nothing_wrong_with_a_unit(unit: Path, tmp_path: Path) -> None:
    text = unit.read_text(encoding="utf-8").replace("/usr/local/bin/console", "/bin/true")
    text = text.replace("EnvironmentFile=/etc/trilobe/", "EnvironmentFile=-/etc/trilobe/")
    copy = tmp_path / unit.name.replace("@", "@lathe-3")
    copy.write_text(text, encoding="utf-8")
    done = subprocess.run(["systemd-analyze", "verify", str(copy)], capture_output=True, text=True, check=False)
    assert [line for line in done.stderr.splitlines() if unit.name.split("@")[0] in line] == []


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_service_can_do_little_beside_its_own(unit: Path) -> None:
    words = ["systemd-analyze", "security", "--offline=true", "--threshold=20", str(unit)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout.splitlines()[-1]


def test_all_files_are_written_into_a_folder_and_nothing_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {path.relative_to(DEPLOY): path.read_bytes() for path in DEPLOY.rglob("*") if path.is_file()}
    folder = tmp_path / "new" / "deploy"
    assert main(["deploy", str(folder)]) == 0
    assert {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()} == files
    (folder / "Containerfile").write_text("mine\n")
    (folder / "trilobe-ship.service").unlink()
    assert main(["deploy", str(folder)]) == 1
    assert (folder / "Containerfile").read_text() == "mine\n" and not (folder / "trilobe-ship.service").exists()
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["deploy", "/proc/nowhere"]) == 1


@pytest.mark.long
def test_a_wheel_brings_the_files(tmp_path: Path) -> None:
    made = subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(ROOT)],
        capture_output=True,
        check=False,
    )
    if made.returncode != 0:
        pytest.skip("the build has no network")
    with zipfile.ZipFile(next(tmp_path.glob("*.whl"))) as wheel:
        found = {name.removeprefix("console/deploy/") for name in wheel.namelist() if "/deploy/" in name}
    assert found == {str(path.relative_to(DEPLOY)) for path in DEPLOY.rglob("*") if path.is_file()}


def test_the_rule_of_udev_has_the_operators_that_udev_knows() -> None:
    for line in (DEPLOY / "60-trilobe-serial.rules").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            for part in line.split(", "):
                assert re.fullmatch(r"[A-Z_]+(\{[A-Za-z_]+\})?(==|!=|\+=|=)\"[^\"]*\"", part), part


def test_a_container_is_built_from_all_that_the_wheel_needs() -> None:
    text = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
    copied = [word for line in re.findall(r"(?m)^COPY (?!--)(.*)$", text) for word in line.split()[:-1]]
    assert [word for word in copied if not (ROOT / word).exists()] == []
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"][
        "targets"
    ]
    needed = [
        *wheel["wheel"]["packages"],
        *wheel["wheel"]["shared-data"],
        *wheel["wheel"]["force-include"],
        "pyproject.toml",
        "README.md",
        "LICENSE",
    ]
    assert [
        each for each in needed if not any(each == word or each.startswith(f"{word}/") for word in copied)
    ] == []


@pytest.mark.long
@pytest.mark.timeout(600)
def test_a_container_shows_the_version() -> None:
    builder = next((name for name in BUILDERS if _works(name)), None)
    if builder is None:
        pytest.skip("no builder of containers works here (podman, buildah or docker)")
    build = [builder, "build", "-f", str(DEPLOY / "Containerfile"), "-t", "trilobe-test", str(ROOT)]
    built = subprocess.run(build, check=False, capture_output=True, text=True)
    if re.search(UNREACHABLE, built.stderr):
        pytest.skip("the base image of the container cannot be fetched here: its registry is not reached")
    assert built.returncode == 0, built.stderr
    if builder != "buildah":
        run = [builder, "run", "--rm", "trilobe-test", "--version"]
        assert subprocess.run(run, check=True, capture_output=True, text=True).stdout.startswith("trilobe")


def _works(name: str) -> bool:
    found = shutil.which(name)
    return found is not None and subprocess.run([found, "info"], capture_output=True, check=False).returncode == 0
