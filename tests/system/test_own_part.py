"""A part of one's own on a machine without a gauge: from a blank form to a round part, by what the screens say."""

from __future__ import annotations

import asyncio
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest

from console.session.data.kept_files import jobs_folder
from console.session.data.stop_records import simulated_record, store
from console.session.data.trace_folder import trace_folder
from drivers.pmac.dialect import DIALECTS
from drivers.simulator.hosts.connection import HostConnection, PlainStream
from drivers.simulator.hosts.real_time import Host, keep_time, patient
from drivers.simulator.machine import SimulatedLathe
from drivers.simulator.plant.presets import plant_named
from drivers.simulator.plant.workshop_view import WorkshopView
from profiles.store import load_job, load_machine
from profiles.traces import Trace, write_trace
from tests.signed_profile import signed
from tests.system.lathe_sites import compact_text
from tests.terminal import Terminal
from tests.trainee import CLOSE_DEG, CLOSE_MM, SETTLES_DEG, SETTLES_MM, SPINDLE_STEPS, TOOL_STEPS, Trainee

pytestmark = [pytest.mark.system, pytest.mark.timeout(240), pytest.mark.long]


Result = TypeVar("Result")
SEED = 11
RONT = r"RONt\D*?(\d+\.\d+)\D+?(\d+\.\d+)"
TIMEOUT_S = 20.0
LOOK_S = 0.03


@dataclass
class Heard:
    """When each connected console was last heard: the computer may keep any of them waiting."""

    at_s: dict[int, float] = field(default_factory=dict)

    @property
    def oldest_s(self) -> float | None:
        """When the one was heard that has been silent longest; None while none is connected."""
        return min(self.at_s.values(), default=None)


class HeardConnection(HostConnection):
    """A host for which the lathe waits while the computer is busy, as behind `console --sim`."""

    def __init__(self, lathe: SimulatedLathe, hosts: set[Host], heard: Heard) -> None:
        super().__init__(lathe, hosts, PlainStream)
        self._heard = heard

    def data_received(self, data: bytes) -> None:
        self._heard.at_s[id(self)] = time.monotonic()
        super().data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._heard.at_s.pop(id(self), None)
        super().connection_lost(exc)


class Shop:
    """The lathe behind its address, and the people around it."""

    def __init__(self, data: Path) -> None:
        text = compact_text("pmac").replace("home_radius_mm = 29.0", "home_radius_mm = 33.0")
        self.profile = data / "shop-3.toml"
        self.profile.write_text(signed(text).replace('name = "lee-2001-lathe"', 'name = "shop-3"'), "utf-8")
        self.machine = load_machine(str(self.profile)).machine
        self.data = data
        # The chuck was mounted nearly as it should be: to jog far is not the subject.
        true = plant_named("steady", self.machine, SEED, mounted_by_hand=True)
        tip_mm = self.machine.tool.home_radius_mm + 0.02
        self.true = replace(true, jaw_1_deg=1.3, home_radius_mm=tip_mm)
        self.lathe = SimulatedLathe(self.machine, self.true)
        self._loop = asyncio.new_event_loop()

    @contextmanager
    def served(self) -> Iterator[str]:
        """Serve the lathe in real time, and yield its address; it has the record of its stops."""
        thread = threading.Thread(target=self._loop.run_forever, name="shop")
        thread.start()
        hosts: set[Host] = set()
        heard = Heard()

        async def begin() -> tuple[asyncio.Server, asyncio.Task[None]]:
            connect = partial(HeardConnection, self.lathe, hosts, heard)
            server = await self._loop.create_server(connect, "127.0.0.1", 0)
            advance = patient(self.lathe.wait, lambda: heard.oldest_s, time.monotonic)
            return server, asyncio.create_task(keep_time(advance, hosts))

        async def end() -> None:
            keeping.cancel()
            server.close()
            await server.wait_closed()

        try:
            server, keeping = asyncio.run_coroutine_threadsafe(begin(), self._loop).result(TIMEOUT_S)
            address = f"tcp:127.0.0.1:{server.sockets[0].getsockname()[1]}"
            record = simulated_record(self.machine, DIALECTS["pmac"], date.today())
            store(self.data, self.machine, replace(record, address=address))
            try:
                yield address
            finally:
                asyncio.run_coroutine_threadsafe(end(), self._loop).result(TIMEOUT_S)
        finally:
            self._loop.call_soon_threadsafe(self._loop.stop)
            thread.join(TIMEOUT_S)
            self._loop.close()

    def at_the_lathe(self, act: Callable[[], Result]) -> Result:
        """Do something between two moments of the lathe."""

        async def acts() -> Result:
            return act()

        return asyncio.run_coroutine_threadsafe(acts(), self._loop).result(TIMEOUT_S)

    def clamps(self, name: str) -> None:
        """Clamp a blank of a job."""
        job = load_job(name, jobs_folder(self.data)).job
        self.at_the_lathe(lambda: self.lathe.mount(job))

    def jaw_to_go_deg(self) -> float | None:
        """Degrees until jaw 1 is at the mark, by an indicator; None while its needle moves."""
        before, after = self._looks()
        settled = before.jaw_1_past_mark_deg == after.jaw_1_past_mark_deg
        return -after.jaw_1_past_mark_deg if settled else None

    def gap_mm(self) -> float | None:
        """Between tool and part, by a feeler gauge; None beside the part, and while the tool moves."""
        before, after = self._looks()
        return after.tool_gap_mm if before.tool_gap_mm == after.tool_gap_mm else None

    def _looks(self) -> tuple[WorkshopView, WorkshopView]:
        """Look twice, a moment apart."""

        async def looks() -> tuple[WorkshopView, WorkshopView]:
            before = self.lathe.look()
            await asyncio.sleep(LOOK_S)
            return before, self.lathe.look()

        return asyncio.run_coroutine_threadsafe(looks(), self._loop).result(TIMEOUT_S)

    def measures(self, name: str) -> None:
        """Take the part out and measure it in another room: against the spindle, from the mark of jaw 1."""
        trace = self.at_the_lathe(self.lathe.measure)
        assert self.true.jaw_1_deg is not None
        angle_deg = np.mod(self.true.jaw_1_deg - trace.angle_deg, 360.0)
        order = np.argsort(angle_deg)
        meta = {"state": "free", "direction": "ccw", "start_mark": "jaw 1", "radius_mm": trace.meta["radius_mm"]}
        found = Trace(angle_deg=angle_deg[order], deviation_um=trace.deviation_um[order], meta=meta)
        write_trace(trace_folder(self.data) / name, found)


class Operator(Trainee):
    """Works at a machine that shows no more than a machine does."""

    def __init__(self, terminal: Terminal, language: str, shop: Shop) -> None:
        super().__init__(terminal, language)
        self.shop = shop

    def clamps_a_blank(self, job: str) -> None:
        self.sees("align_page.next.clamp")
        self.shop.clamps(job)
        self.press("enter")
        self.sees("align_page.next.drives")

    def aligns_it(self) -> None:
        self.does_step("align_page.next.home")
        self.starts_homing()
        self.sees("align_page.next.jaw_enable", 60.0)
        self.finds_jaw_1()
        self.touches_off()

    def aligns_what_is_left(self) -> None:
        """Drives on, and whatever is not valid for the part in the chuck."""
        self.does_step("align_page.drives_on")
        home, valid = "align_page.next.home", "align_page.valid_title"
        beside, over = "align_page.next.touch_off", "align_page.next.touch_off_over_enable"
        if (offered := self.sees_one(home, beside, over, valid)) == home:
            self.starts_homing()
            self.sees("align_page.next.jaw_enable", 60.0)
            self.finds_jaw_1()
        if offered == over:  # the tool stands where it was left, over the part before
            self.jogs_to_the_part()
        elif offered != valid:
            self.touches_off()
        self.sees(valid)

    def sees_one(self, *keys: str) -> str:
        """Wait for one of these sentences, and return which it is."""
        patterns = {key: re.compile(self._pattern(key)) for key in keys}
        self.terminal.wait_for(lambda text: any(each.search(text) for each in patterns.values()), 20.0)
        return next(key for key in keys if patterns[key].search(self.terminal.text))

    def offers(self, key: str) -> bool:
        """Whether a sentence is on the screen, a moment from now."""
        with suppress(AssertionError):
            self.sees(key, 1.0)
            return True
        return False

    def finds_jaw_1(self) -> None:
        self.press("j")
        self._jogs(self.shop.jaw_to_go_deg, ("pageup", "pagedown"), SPINDLE_STEPS, CLOSE_DEG, SETTLES_DEG, "°")
        self.press("enter")
        self.sees("align_page.next.touch_off")

    def touches_off(self) -> None:
        self.press("f4")
        self.terminal.wait_for(lambda _: self.shop.gap_mm() is not None, 60.0)
        self.sees("activity.ready", 30.0)
        self.jogs_to_the_part()

    def jogs_to_the_part(self) -> None:
        self.press("j")
        self._jogs(self.shop.gap_mm, ("down", "up"), TOOL_STEPS[:2], CLOSE_MM, SETTLES_MM, "mm")
        self.press("enter")
        self.sees("align_page.valid_title")

    def cuts(self) -> None:
        self.starts_the_cut()
        self.sees("run_page.next.take_out", 60.0)

    def takes_out_and_brings_the_trace(self, name: str) -> None:
        self.press("4", "f3")
        self.sees("align_page.drives_off", 20.0)
        self.shop.measures(name)
        self.press("6", "i")
        self.terminal.wait_for(re.escape(name), 5.0)
        self.sees("trace_import.next.take", 10.0)
        self.press("enter")
        self.terminal.wait_for(
            lambda text: name not in text and re.search(r"RONt[^\n\d]*\d", text) is not None, 20.0
        )

    def goes_on(self, job: str) -> None:
        self.press("enter")
        self.clamps_a_blank(job)
        self.does_step("align_page.valid_title")

    def diameter(self) -> str:
        """The row with the verdict on the diameter."""
        found = re.search(r"[✓✗] D [^\n]*", self.terminal.text)
        assert found is not None, self.terminal.text
        return found[0]

    def ront_um(self) -> float:
        self.terminal.wait_for(RONT, 10.0)
        found = re.search(RONT, self.terminal.text)
        assert found is not None, self.terminal.text
        return float(found[2])


VALUES = ("steel", "60", "1.5", "25", "4", "2500", "0.1", "0.05", "600", "1", "5", "-", "30")
JOB = "steel-60"


def makes_a_job(operator: Operator) -> None:
    """On a blank form, with a value in each of its fields."""
    operator.press("n")
    operator.sees("setup.new_title")
    operator.press("enter")
    for value in VALUES:
        operator.press(*value, "tab")
    operator.sees("setup.next.save_new")
    operator.press("s")
    operator.terminal.wait_for(rf"\[{JOB} ", 5.0)
    operator.press("enter")
    operator.sees("setup.next.plain")


@pytest.mark.parametrize("language", ["en", "ko"])
def test_a_part_of_ones_own_becomes_round_on_a_machine_without_a_gauge(language: str, tmp_path: Path) -> None:
    shop = Shop(tmp_path)
    with shop.served() as address:
        words = ("--machine", str(shop.profile), "--link", address, "--data", str(tmp_path), "--lang", language)
        with Terminal([sys.executable, "-m", "console", *words], columns=80, rows=24) as terminal:
            operator = Operator(terminal, language, shop)
            operator.sees("activity.ready", 30.0)
            makes_a_job(operator)
            operator.press("4")
            operator.clamps_a_blank(JOB)
            operator.aligns_it()
            operator.cuts()
            operator.takes_out_and_brings_the_trace("plain.csv")
            operator.sees("inspect_page.next.lobe")
            operator.press("a")
            operator.sees("inspect_page.next.lobe_taken")
            operator.goes_on(JOB)
            operator.cuts()
            operator.takes_out_and_brings_the_trace("first.csv")
            first_um = operator.ront_um()
            operator.press("a")
            operator.sees("inspect_page.next.kept")
            operator.press("o")
            operator.sees("inspect_page.diameter_taken")
            operator.goes_on(JOB)
            operator.cuts()
            operator.takes_out_and_brings_the_trace("second.csv")
            assert operator.ront_um() < min(
                first_um, load_job(JOB, jobs_folder(tmp_path)).job.roundness_tolerance_um
            )
            assert "✓" in operator.diameter()
            operator.press("4", "ctrl+q")
            assert terminal.wait_exit(15.0) == 0
