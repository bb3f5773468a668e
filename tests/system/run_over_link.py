"""`console run` as a process of its own, on a lathe with short ways at the end of a socket."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property
from pathlib import Path

import profiles.store
from console.session.data.stop_records import simulated_record, store
from drivers.commissioning.stop_record import StopRecord
from drivers.pmac.dialect import DIALECTS
from profiles.job import Job
from profiles.machine import MachineProfile
from profiles.store import load_job, load_machine
from tests.preloaded import Preloaded
from tests.signed_profile import signed
from tests.system.lathe_sites import compact_text


@dataclass(frozen=True, kw_only=True)
class Order:
    """What is to be cut on what: files of one operator, with the folder of his data."""

    job_file: Path
    machine_file: Path
    data: Path

    @property
    def job(self) -> Job:
        return load_job(str(self.job_file)).job

    @property
    def machine(self) -> MachineProfile:
        return load_machine(str(self.machine_file)).machine

    def command(self, address: str, *more: str) -> list[str]:
        words = ("run", str(self.job_file), "--machine", str(self.machine_file), "--data", str(self.data))
        return [sys.executable, "-m", "console", *words, "--link", address, "--strategy", "pvt", *more]

    def prove_stops(self, address: str) -> None:
        """Write the stop record of this machine, as `console doctor --prove` does over this link."""
        store(self.data, self.machine, replace(self._stops, address=address))

    @cached_property
    def _stops(self) -> StopRecord:
        return simulated_record(self.machine, DIALECTS["pmac"], date.today())

    @contextmanager
    def running(self, address: str) -> Iterator[subprocess.Popen[str]]:
        """Cut, with the agreement of whoever has typed --yes."""
        words = self.command(address, "--yes", "--json")
        with Preloaded(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            try:
                yield process
            finally:
                if process.poll() is None:
                    process.kill()

    @contextmanager
    def proven(self, address: str) -> Iterator[subprocess.Popen[str]]:
        """Cut on a machine whose stops were proven over this very link."""
        self.prove_stops(address)
        with self.running(address) as process:
            yield process


def order(folder: Path, cut_length_mm: float) -> Order:
    """Experiment 1 of the paper, with another length of cut, on a lathe that somebody has signed for."""
    text = (profiles.store.BUNDLED_JOBS / "lee-2001-experiment-1.toml").read_text(encoding="utf-8")
    assert text.count("cut_length_mm = 8.0") == 1
    made = Order(job_file=folder / "job.toml", machine_file=folder / "lathe.toml", data=folder / "data")
    made.job_file.write_text(text.replace("cut_length_mm = 8.0", f"cut_length_mm = {cut_length_mm}"), "utf-8")
    made.machine_file.write_text(signed(compact_text("pmac")), encoding="utf-8")
    return made
