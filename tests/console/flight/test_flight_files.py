"""A file that is no sound recording is refused, with the place; the ring of a killed console becomes one."""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import pickle
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from console.flight import recording as reading
from console.flight.frozen_recordings import frozen_in
from console.flight.recording import read_header, read_recording
from console.flight.ring import SegmentRing
from profiles.problem import ProfileError
from tests.console.flight.bench import FlightBench, reasons
from tests.console.floor import known
from tests.preloaded import completed


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound recording of some seconds."""
    bench = FlightBench(tmp_path_factory.mktemp("sound"))
    bench.runs(3.0)
    bench.alarms()
    bench.runs(6.0)
    (path,) = frozen_in(bench.data)
    return path


def refusal(path: Path) -> tuple[str, str]:
    """The code of a refusal, and the line that it names."""
    with pytest.raises(ProfileError) as refused:
        read_recording(path)
    (problem,) = refused.value.problems
    assert problem.where == str(path)
    return problem.code, problem.key


def lines_of(path: Path) -> list[Any]:
    return [json.loads(line) for line in gzip.decompress(path.read_bytes()).splitlines()]


def packed(path: Path, lines: list[Any]) -> Path:
    """Write a recording whose sum is right, whatever its lines are: by somebody who knows how."""
    rest = b"".join(json.dumps(line).encode() + b"\n" for line in lines[1:])
    head = {**lines[0], "lines": len(lines) - 1, "sha256": hashlib.sha256(rest).hexdigest()}
    path.write_bytes(gzip.compress(json.dumps(head).encode() + b"\n" + rest))
    return path


def test_every_flipped_byte_and_every_cut_is_refused(sound: Path, tmp_path: Path) -> None:
    content, path = sound.read_bytes(), tmp_path / "x.flight"
    for place in range(10, len(content), 97):  # the first ten bytes are of no meaning to what is in it
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :])
        if not says_the_same(path, content):
            assert refusal(path)[0] in ("flight.damaged", "flight.not_one")
        path.write_bytes(content[:place])
        assert refusal(path)[0] in ("flight.damaged", "flight.not_one")


def says_the_same(path: Path, content: bytes) -> bool:
    """Whether a flipped bit is one of those that gzip does not use."""
    try:
        return gzip.decompress(path.read_bytes()) == gzip.decompress(content)
    except (OSError, EOFError, zlib.error):
        return False


def test_a_flipped_digit_in_what_was_unpacked_and_packed_again_is_refused(sound: Path, tmp_path: Path) -> None:
    content = gzip.decompress(sound.read_bytes())
    path = tmp_path / "x.flight"
    assert b":243848.0" in content
    path.write_bytes(gzip.compress(content.replace(b":243848.0", b":243849.0")))
    assert refusal(path) == ("flight.damaged", "0")


def test_what_is_no_recording_at_all(tmp_path: Path) -> None:
    path = tmp_path / "x.flight"
    for content in (
        b"",
        b"{}",
        b"\x1f\x8b",
        gzip.compress(b""),
        gzip.compress(b"[]\n"),
        gzip.compress(b"{" * 50_000),
    ):
        path.write_bytes(content)
        assert refusal(path)[0] in ("flight.not_one", "flight.damaged")
    path.write_bytes(gzip.compress(pickle.dumps({"flight": 1})))
    assert refusal(path)[0] == "flight.not_one"
    path.write_bytes(gzip.compress(b'{"flight": 2}\n'))
    assert refusal(path) == ("schema.unsupported", "flight")
    os.mkfifo(tmp_path / "pipe")
    for strange in (tmp_path / "pipe", tmp_path, tmp_path / "missing"):
        assert refusal(strange)[0] == "file.unreadable"


def test_a_bomb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "MOST_BYTES", 3_000_000)
    path = tmp_path / "x.flight"
    path.write_bytes(gzip.compress(b"0" * 5_000_000))
    assert refusal(path)[0] == "file.too_large"


def changed(place: int, change: Callable[[Any], object]) -> Callable[[list[Any]], object]:
    return lambda lines: change(lines[place])


HOSTILE: dict[str, tuple[Callable[[list[Any]], object], str]] = {
    "unknown key of the header": (changed(0, lambda head: head.update(run="x")), "1"),
    "another schema of the machine": (changed(0, lambda head: head["machine"].update(schema=7)), "1"),
    "a spindle without counts": (
        changed(0, lambda head: head["machine"]["spindle"].update(counts_per_rev=0.0)),
        "1",
    ),
    "a time of day that is none": (changed(0, lambda head: head.update(utc_s=1e15)), "1"),
    "a length of years": (changed(0, lambda head: head.update(ended_s=1e12)), "1"),
    "not a number": (changed(0, lambda head: head.update(began_s="nan")), "1"),
    "no first state": (lambda lines: lines.pop(1), "2"),
    "a huge number": (changed(1, lambda line: line["full"]["state"].update(at_s=1e300)), "2"),
    "a whole number of 400 digits": (changed(1, lambda line: line["full"]["state"].update(holder=10**400)), "2"),
    "control characters": (changed(1, lambda line: line["full"]["state"].update(machine="\x1b[2J")), "2"),
    "an unknown activity": (changed(2, lambda line: line["set"].update({"state.activity": "flying"})), "3"),
    "a change of what is not there": (changed(2, lambda line: line["set"].update({"state.cut.turn": 1.0})), "3"),
    "time that goes back": (changed(3, lambda line: line.update(t=lines_begin)), "4"),
    "a time in another century": (changed(3, lambda line: line.update(t=1e10)), "4"),
    "a time that is a text": (changed(3, lambda line: line.update(t="1")), "4"),
    "neither state nor note": (lambda lines: lines.append({"t": 1003.0}), "13"),
    "a list": (lambda lines: lines.append([1]), "13"),
    "a note of an unknown kind": (lambda lines: lines.append({"t": 1003.0, "kind": "x", "text": ""}), "13"),
}
lines_begin = 1000.0


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_file_with_a_right_sum_is_refused_with_its_line(what: str, sound: Path, tmp_path: Path) -> None:
    change, line = HOSTILE[what]
    lines = lines_of(sound)
    change(lines)
    code, named = refusal(packed(tmp_path / "x.flight", lines))
    assert (code, named) == ("flight.damaged", line if line != "13" else str(len(lines)))


def test_the_ring_of_a_killed_console_is_frozen_once_and_a_running_one_is_left_alone(tmp_path: Path) -> None:
    killed = FlightBench(tmp_path)
    killed.runs(40.0)
    ring = known(killed.recorder._ring)
    other = FlightBench(tmp_path)
    other.recorder._freeze_left()
    assert (frozen_in(tmp_path), other.recorder.alarms) == ([], ())
    newest = ring.segments()[-1]
    newest.write_bytes(newest.read_bytes()[:-20])  # killed in the middle of a line
    ring.close(remove=False)  # what the kernel does with the lock of a killed process
    other.recorder._freeze_left()
    (recording,) = other.frozen
    assert reasons(recording) == ["killed"]
    assert recording.length_s == pytest.approx(38.0, abs=2.0)
    (alarm,) = other.recorder.alarms
    assert (alarm.problem.code, alarm.problem.value) == ("flight.killed_found", recording.path.name)
    other.recorder._freeze_left()
    assert len(frozen_in(tmp_path)) == 1


def test_the_ring_of_another_machine_waits_for_a_start_on_that_one(tmp_path: Path) -> None:
    ring = SegmentRing(tmp_path, "another-lathe")
    ring.begin(0.0, {"flight": 1})
    ring.close(remove=False)
    bench = FlightBench(tmp_path)
    bench.recorder._freeze_left()
    assert ring.folder.is_dir()


@pytest.mark.long
def test_the_commands_list_print_and_refuse(sound: Path, tmp_path: Path) -> None:
    data = str(sound.parents[1])
    listed = completed(["replay", "--data", data], 30.0)
    assert (listed.returncode, sound.name in listed.stdout) == (0, True)
    printed = completed(["replay", sound.name, "--data", data, "--text"], 30.0)
    assert "ALARM" in printed.stdout and "frozen for: alarm: the spindle has stopped" in printed.stdout
    as_json = json.loads(
        completed(["replay", sound.name.removesuffix(".flight"), "--data", data, "--json"], 30.0).stdout
    )
    assert [event["code"] for event in as_json["events"] if event["kind"] == "alarm"] == ["cut.spindle_stands"]
    broken = tmp_path / "broken.flight"
    broken.write_bytes(sound.read_bytes()[:-30])
    for words in ([str(broken), "--text"], [str(broken)], ["missing", "--lang", "ko"], [str(sound)]):
        done = completed(["replay", *words, "--data", data], 30.0)
        assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (1, "", 1)
        assert "Traceback" not in done.stderr
    assert completed(["replay", "--list", "--data", str(tmp_path / "empty")], 30.0).stdout == "no recordings\n"


def test_the_header_alone_is_read_for_the_list(sound: Path) -> None:
    assert read_header(sound).causes == read_recording(sound).header.causes
