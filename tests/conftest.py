"""Settings for every test: property tests are the same in each run unless exploration is asked for.

HYPOTHESIS_PROFILE=explore draws new examples each time; what it finds belongs into an @example.
"""

from __future__ import annotations

import asyncio
import gc
import inspect
import os
import re
import signal
import sys
from collections import Counter
from collections.abc import Generator
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

from console.rings import RINGS, is_installed
from tests.remembered import FOLDER, remember

# No deadline and no health check of speed: a loaded machine is not a defect.
EXPLORE = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("explore", EXPLORE)
# What is the same in each run is seen by its first examples or not at all; the many are for exploring.
settings.register_profile("steady", EXPLORE, derandomize=True, database=None, max_examples=30)
settings.load_profile(PROFILE := os.environ.get("HYPOTHESIS_PROFILE", "steady"))
if PROFILE == "steady":
    # Each process would read all of our modules for the numbers in them: a second, and several in a new clone.
    # What is tried would then also depend on what this process has imported before.
    providers._get_local_constants = lambda: providers._local_constants

# The tests start some hundreds of programs, and each worker imports all of the tests: without kept bytecode each
# of them compiles all of its modules anew. The workers and the programs take this from the environment.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# As the console does when it starts; the workers, and the programs that they start, take it from the environment.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Nor do tests, and the programs that they start, find the configuration of whoever runs them.
os.environ["XDG_CONFIG_HOME"] = os.path.join(os.path.dirname(__file__), "no configuration")
for _name in [name for name in os.environ if name.startswith("TRILOBE_") and name != "TRILOBE_TRACEBACK"]:
    del os.environ[_name]


# Pure functions, asked some hundreds of times for the same few programs and lathes, in many processes.
remember()


ALL_BUT_LONG = pytest.StashKey[bool]()


ABSENT = tuple(ring for ring in RINGS if not is_installed(ring))
PAGES = frozenset({"train", "more", "settings"})


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Leave out what tests a ring that is not installed: the core passes its tests without."""
    return True if ABSENT and collection_path.suffix == ".py" and _names_a_ring(collection_path) else None


def _is_of_a_ring(item: pytest.Item) -> bool:
    """Whether a case is about a page of a ring, or about one that shows which pages there are."""
    case = getattr(item, "callspec", None)
    return case is not None and not PAGES.isdisjoint(map(str, case.params.values()))


@cache
def _names_a_ring(path: Path) -> bool:
    """Whether a test, or one that it imports, names a ring that is not installed or stands in its room."""
    if not path.is_file():
        return False
    text = path.read_text(encoding="utf-8")
    if {ring.rpartition(".")[2] for ring in ABSENT} & set(path.parts) or any(ring in text for ring in ABSENT):
        return True
    used = re.findall(r"^(?:from tests\.([\w.]+) import|import tests\.([\w.]+))", text, re.MULTILINE)
    files = (Path(__file__).parent.joinpath(*(one or other).split(".")) for one, other in used)
    return any(_names_a_ring(each.with_suffix(".py")) for each in files)


def pytest_configure(config: pytest.Config) -> None:
    """Let each worker collect from another file on: what one has compiled, in a new clone, the others find."""
    everything = config.args == config.getini("testpaths")
    config.stash[ALL_BUT_LONG] = everything and not config.option.markexpr
    worker = getattr(config, "workerinput", None)
    if worker is not None and everything:
        files = sorted(str(path) for folder in config.args for path in Path(folder).rglob("test_*.py"))
        first = len(files) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
        config.args = files[first:] + files[:first]


def pytest_sessionstart(session: pytest.Session) -> None:
    """Make the folder of what all processes of this run remember: the workers begin behind it, and inherit it.

    Under `nohup` a hang-up is ignored, and what is started here would ignore it, too: tests expect it to end. A
    handler is not inherited, and this process lives on.
    """
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)
    if hasattr(session.config, "workerinput"):
        return
    folder = session.config._tmp_path_factory.getbasetemp() / "remembered"  # type: ignore[attr-defined]
    folder.mkdir()
    os.environ[FOLDER] = str(folder)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Keep what is collected out of the search for garbage: it lives to the end, and is half of all there is."""
    gc.disable()
    collected = yield
    gc.freeze()
    gc.enable()
    gc.set_threshold(50_000, 20, 20)
    return collected


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine in a loop of its own."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    given = pyfuncitem.funcargs
    asyncio.run(pyfuncitem.obj(**{name: given[name] for name in pyfuncitem._fixtureinfo.argnames}))
    return True


LONG_S = 100.0
SYSTEM_UNTIL = 0.8
"""Share of the rest behind which no test at a real terminal begins: a long one must not be the last."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Spread the tests at real terminals, which mostly wait, among those that calculate.

    The longest come first, then those that share what their file has started, which stay together. Where all tests
    are run, those marked `long` are left out; a file or a name of them, or `-m long`, runs them.
    """
    if ABSENT:
        items[:] = [item for item in items if not item.get_closest_marker("rings") and not _is_of_a_ring(item)]
    _mark_further_cases(items)
    _mark_second_cases(items)
    if config.stash[ALL_BUT_LONG]:
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("long")])
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    items.sort(key=lambda item: item.path)
    waiting = [item for item in items if item.get_closest_marker("system") is not None]
    longest = [item for item in waiting if _takes_long(item)]
    together = [item for item in waiting if _shares(item) and not _takes_long(item)]
    alone = [item for item in waiting if not _shares(item) and not _takes_long(item)]
    busy = [item for item in items if item.get_closest_marker("system") is None]
    places = [(SYSTEM_UNTIL * (i + 0.5) / len(alone), item) for i, item in enumerate(alone)]
    places += [((i + 0.5) / len(busy), item) for i, item in enumerate(busy)]
    items[:] = [*longest, *together, *(item for _, item in sorted(places, key=lambda place: place[0]))]


def _mark_further_cases(items: list[pytest.Item]) -> None:
    """Mark as `long` the cases of a test behind the `first` so many."""
    cases: Counter[str] = Counter()
    for item in items:
        marker = item.get_closest_marker("first")
        if marker is not None:
            test = item.nodeid.partition("[")[0]
            cases[test] += 1
            if cases[test] > marker.args[0]:
                item.add_marker("long")


WHOLE_IN_BOTH = frozenset(("test_goldens.py", "test_nothing_is_cut.py"))
"""Tests of the screens that run in both languages with all others: whether all is there, and nothing cut off."""

OF_THE_HOST = frozenset(
    f"test_{name}.py"
    for name in (
        *("controller_backup", "controller_proofs", "cut_cam", "heartbeat_cuts", "hold", "identifying"),
        *("kept_heartbeat", "line_checksums", "program_load", "stop_races"),
    )
)
"""Tests of what this side of the line does, which take long: of the families, the first runs with all others."""


def _mark_second_cases(items: list[pytest.Item]) -> None:
    """Mark as `long` the second language of the screens, and the second family where the host is the subject."""
    for item in items:
        case = getattr(item, "callspec", None)
        if case is None:
            continue
        folder, name = item.path.parent.name, item.path.name
        if folder == "tui" and case.params.get("language") == "ko" and name not in WHOLE_IN_BOTH:
            item.add_marker("long")
        if folder == "drivers" and name in OF_THE_HOST and "turbo" in case.id.split("-"):
            item.add_marker("long")


def _takes_long(item: pytest.Item) -> bool:
    """Whether a test needs more than the usual time limit."""
    return any(marker.args[0] > LONG_S for marker in item.iter_markers("timeout"))


def _shares(item: pytest.Item) -> bool:
    """Whether a test uses something that lives as long as its file."""
    info = getattr(item, "_fixtureinfo", None)
    return info is not None and any(found[-1].scope == "module" for found in info.name2fixturedefs.values())
