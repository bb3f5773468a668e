"""Somebody who does nothing but what the guide says gets from power-up to a part that was learned from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from console.session.cut.compensated import using
from console.session.guide.refusals import refused
from console.session.guide.rows import Row, next_step
from console.session.guide.situation import Situation
from console.session.learning.part_learning import accept
from console.session.station.commands import Approach, Arm, Command, ConfirmClamping, Jog, NoteJog, TakeTouchOff
from console.session.work import Work, opened
from drivers.cutting.planning import Strategy
from drivers.lathe.snapshot import AxisName
from profiles.store import load_job, load_machine
from tests.console.floor import Floor, open_floor
from tests.system.lathe_sites import compact_text


class Novice:
    """Presses the key of the row, as far as it says; at the mark and at the part the eyes decide."""

    def __init__(self, floor: Floor, work: Work, data: Path) -> None:
        self.floor, self.work, self.data = floor, work, data
        self.open: Work | None = None

    def now(self) -> Situation:
        machine = self.work.machine.machine
        at_s = self.floor.state.at_s
        return Situation(state=self.floor.idle(), work=self.open, machine=machine, now_s=at_s)

    def follow(self, row: Row) -> None:
        self.floor.station.post(NoteJog(enabled=row.key == "align.enable"))
        if row.key == "page.jobs":
            self.open = self.work
        elif row.word == "align.jaw":
            for _ in range(2):
                seen = self.floor.idle().seen
                assert seen is not None
                self.floor.do(Jog(axis=AxisName.SPINDLE, distance=-seen.jaw_1_past_mark_deg))
            self.floor.do(self._command(row))
        elif row.word == "align.touch_off_over":
            self.floor.touch(-0.0005)
        elif row.key == "inspect.accept":
            measured = self.floor.state.measured
            assert measured is not None and measured.learning is not None
            self.open = using(self.work, accept(measured.learning, self.data))
        elif row.key not in ("align.enable", "inspect.next"):
            self.floor.do(self._command(row))

    def _command(self, row: Row) -> Command:
        work, job = self.work, self.work.job
        made: dict[type[Command], Callable[[], Command]] = {
            ConfirmClamping: lambda: ConfirmClamping(job=job),
            Approach: lambda: Approach(job=job),
            TakeTouchOff: lambda: TakeTouchOff(radius_mm=job.radius_mm),
            Arm: lambda: Arm(
                job=job, job_sha256=work.loaded.sha256, strategy=Strategy(work.strategy), loaded=work.loaded
            ),
        }
        assert row.command is not None, row.word
        return made.get(row.command, row.command)()


def test_the_guide_leads_from_power_up_to_the_learned_part(
    tmp_path: Path, job_file: Callable[..., Path], data_folder: Path
) -> None:
    lathe = tmp_path / "lathe.toml"
    lathe.write_text(compact_text("pmac"), encoding="utf-8")
    job = load_job(str(job_file(cut_length_mm="0.5", feed_mm_per_rev="0.1")))
    data, machine = data_folder / "trilobe", load_machine(str(lathe))
    novice = Novice(open_floor(data, 11, "steady", machine), opened(job, machine), data)
    said: list[str] = []
    while len(said) < 40 and (not said or said[-1] != "inspect.kept"):
        row = next_step(now := novice.now())
        assert refused(row.key or "", now) == (), row.word
        said.append(row.word)
        novice.follow(row)
    align = ["clamp", "drives", "home", "jaw_enable", "jaw", "touch_off", "touch_off_over_enable"]
    align += ["touch_off_over", "touch_off_touching"]
    after = ["run.arm", "run.armed", "inspect.measure", "inspect.failed_scatter", "inspect.kept"]
    assert said == ["run.no_job", *(f"align.{name}" for name in align), *after]
