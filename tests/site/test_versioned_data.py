"""A data folder that is a clone: what differs is shown, and a cut keeps the commit that it was made from."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import console.session.data.version_control as git
from console.session.data.run_reader import runs, story
from console.session.data.version_control import VERSIONED, cut_from
from console.session.errors import SessionError
from console.session.station.commands import Disarm
from console.site.versioning.status import FileChange, FileChangeKind, clone_status
from profiles.store import load_job, save_job
from tests.console.floor import Floor

pytestmark = pytest.mark.skipif(
    shutil.which("git") is None, reason="git is not installed (Debian: apt-get install git)"
)

Console = Callable[..., Any]
EXPERIMENT = "lee-2001-experiment-1"


def by_git(folder: Path, *words: str) -> str:
    who = ("-c", "user.name=kim", "-c", "user.email=kim@shop", "-c", "protocol.file.allow=always")
    done = subprocess.run(["git", "-C", str(folder), *who, *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A data folder that was cloned, with two jobs; its upstream has one commit."""
    upstream = tmp_path / "upstream"
    (upstream / "jobs").mkdir(parents=True)
    by_git(upstream, "init", "-q", "-b", "main")
    for name in ("ring", "선반 링"):
        save_job(replace(load_job(EXPERIMENT).job, name=name), upstream / "jobs" / f"{name}.toml")
    (upstream / ".gitignore").write_text(
        "/records.sqlite3*\n/running/\n/locks/\n/feed/\n/flight/\n/lathe.json\n.*.tmp\n"
    )
    by_git(upstream, "add", ".")
    by_git(upstream, "commit", "-q", "-m", "jobs")
    by_git(tmp_path, "clone", "-q", str(upstream), "data")
    return tmp_path / "data"


def test_a_clone_that_is_as_its_commit(console: Console, clone: Path) -> None:
    commit = by_git(clone, "rev-parse", "HEAD")
    found = clone_status(clone)
    assert (found.commit, found.branch, found.changes) == (commit, "main", ())
    assert (found.upstream, found.ahead, found.behind) == ("origin/main", 0, 0)
    for lang, word in (("en", "nothing differs"), ("ko", "다른 것이 없습니다")):
        said = console("jobs", "status", "--data", str(clone), "--lang", lang)
        assert said.code == 0 and commit[:12] in said.out and "origin/main" in said.out and word in said.out


def test_what_differs_is_listed_and_judged(console: Console, clone: Path) -> None:
    jobs = clone / "jobs"
    (jobs / "선반 링.toml").unlink()
    (jobs / "from elsewhere.toml").write_text("schema = 1\nname = 3\n")
    with (jobs / "ring.toml").open("a") as file:
        file.write("# a comment\n")
    (clone / "machines").mkdir()
    (clone / "machines" / "ours.toml").write_text("")
    by_git(clone, "add", "machines")
    (clone / "logs").mkdir()
    (clone / "logs" / "a.txt").write_text("not of how parts are cut")
    assert clone_status(clone).changes == (
        FileChange(path="jobs/from elsewhere.toml", how=FileChangeKind.NEW),
        FileChange(path="jobs/ring.toml", how=FileChangeKind.MODIFIED),
        FileChange(path="jobs/선반 링.toml", how=FileChangeKind.DELETED),
        FileChange(path="machines/ours.toml", how=FileChangeKind.NEW),
    )
    fields = console("jobs", "status", "--data", str(clone), "--json").json
    assert [bool(each["problems"]) for each in fields["changes"]] == [True, False, False, True]
    assert (fields["judged_on"], fields["not_judged"]) == ("lee-2001-lathe", [])
    said = console("jobs", "status", "--data", str(clone))
    assert said.code == 0 and "from elsewhere.toml" in said.out and "cannot be used" in said.out
    save_job(replace(load_job(EXPERIMENT).job, name="solid", wall_thickness_mm=99.0), jobs / "solid.toml")
    said = console("jobs", "status", "--data", str(clone))
    assert "thicker than the radius" in said.out and "lee-2001-lathe" in said.out
    words = ("jobs", "status", "--data", str(clone), "--machine", str(clone / "machines" / "ours.toml"))
    said = console(*words)
    assert said.code == 0 and "solid.toml" in said.out and "not judged" in said.out
    fields = console(*words, "--json").json
    assert fields["judged_on"] is None
    assert fields["not_judged"] and all(why in said.out for why in fields["not_judged"])
    (jobs / "solid.toml").unlink()
    refused = console("preview", "from elsewhere", "--data", str(clone))
    assert refused.code == 1 and "from elsewhere.toml" in refused.err
    by_git(clone, "add", ".")
    by_git(clone, "commit", "-q", "-m", "here")
    assert (clone_status(clone).ahead, clone_status(clone).behind) == (1, 0)


def test_behind_is_known_after_a_fetch_and_without_a_network(clone: Path, tmp_path: Path) -> None:
    upstream = tmp_path / "upstream"
    with (upstream / "jobs" / "ring.toml").open("a") as file:
        file.write("# newer\n")
    by_git(upstream, "commit", "-q", "-a", "-m", "newer")
    assert clone_status(clone).behind == 0
    by_git(clone, "fetch", "-q")
    upstream.rename(tmp_path / "gone")
    assert clone_status(clone).behind == 1


PROGRAMS = (
    *(
        "core.fsmonitor",
        "core.pager",
        "core.editor",
        "core.sshCommand",
        "core.gitProxy",
        "core.alternateRefsCommand",
    ),
    *(
        "filter.x.clean",
        "filter.x.smudge",
        "filter.x.process",
        "diff.external",
        "diff.x.command",
        "diff.x.textconv",
    ),
    *("merge.x.driver", "gpg.program", "gpg.ssh.program", "credential.helper", "pager.ls-files", "pager.rev-list"),
    *("remote.origin.uploadpack", "uploadpack.packObjectsHook", "interactive.diffFilter", "trace2.eventTarget"),
)
"""Keys of a configuration by which git starts a program."""

OTHERS = {
    "core.hooksPath": "{trap}s",
    "core.attributesFile": "{trap}.attributes",
    "alias.ls-files": "!{trap}",
    "alias.rev-parse": "!{trap}",
    "log.showSignature": "true",
    "filter.x.required": "true",
    "protocol.allow": "always",
    "protocol.ext.allow": "always",
    "remote.origin.url": "ext::{trap}",
    "remote.origin.promisor": "true",
    "remote.origin.partialclonefilter": "blob:none",
    "extensions.partialClone": "origin",
}


def trapped(clone: Path, trap: Path) -> Path:
    """Let everything in the folder that git may obey start `trap`; return the file that it would leave."""
    sprung = trap.with_name("sprung")
    trap.write_text(f"#!/bin/sh\necho $0 $* >> {sprung}\ncat\n")
    trap.chmod(0o755)
    hooks = trap.with_name(f"{trap.name}s")
    hooks.mkdir()
    samples = ("post-index-change", "reference-transaction", "post-checkout", "fsmonitor-watchman", "pre-auto-gc")
    for folder in (hooks, clone / ".git" / "hooks"):
        for name in samples:
            shutil.copy(trap, folder / name)
    attributes = "* filter=x diff=x merge=x\n"
    for path in (clone / ".gitattributes", clone / ".git" / "info" / "attributes", Path(f"{trap}.attributes")):
        path.write_text(attributes)
    included = clone / ".git" / "included"
    for key, value in {**dict.fromkeys(PROGRAMS, "{trap}"), **OTHERS}.items():
        said = value.format(trap=trap)
        subprocess.run(["git", "config", "--file", str(included), key, said], check=True)
        subprocess.run(["git", "config", "--file", str(clone / ".git" / "config"), key, said], check=True)
    with (clone / ".git" / "config").open("a") as file:
        file.write(f'[include]\n\tpath = {included}\n[includeIf "gitdir:**"]\n\tpath = {included}\n')
    return sprung


def test_no_program_that_a_clone_names_is_run(console: Console, clone: Path, tmp_path: Path) -> None:
    commit = by_git(clone, "rev-parse", "HEAD")
    sprung = trapped(clone, tmp_path / "trap")
    ring = clone / "jobs" / "ring.toml"
    with ring.open("a") as file:
        file.write("# of another size\n")
    texts: dict[str, tuple[Path | None, str]] = {"job": (ring, "")}
    said = console("jobs", "status", "--data", str(clone), "--json")
    assert not sprung.exists(), sprung.read_text()
    assert (said.code, said.json["commit"], cut_from(clone, texts)) == (
        0,
        commit,
        {"commit": commit, "job_differs": True},
    )
    assert [each["path"] for each in said.json["changes"]] == ["jobs/ring.toml"]
    # A partial clone fetches what it lacks, from where its configuration says.
    for kept in (clone / ".git" / "objects").rglob("*"):
        if kept.is_file():
            kept.unlink()
    console("jobs", "status", "--data", str(clone))
    cut_from(clone, texts)
    assert not sprung.exists(), sprung.read_text()


def test_a_change_of_the_same_length_and_date_is_one(clone: Path) -> None:
    ring = clone / "jobs" / "ring.toml"
    before, dates = ring.read_bytes(), ring.stat()
    ring.write_bytes(before.replace(b"8", b"9"))
    os.utime(ring, ns=(dates.st_atime_ns, dates.st_mtime_ns))
    assert clone_status(clone).changes == (FileChange(path="jobs/ring.toml", how=FileChangeKind.MODIFIED),)
    ring.unlink()
    os.mkfifo(ring)
    assert clone_status(clone).changes == (FileChange(path="jobs/ring.toml", how=FileChangeKind.MODIFIED),)


def test_a_damaged_clone_is_not_taken_for_part_of_the_one_above(clone: Path, tmp_path: Path) -> None:
    by_git(tmp_path, "init", "-q", "-b", "above")
    (clone / ".git" / "HEAD").unlink()
    with pytest.raises(SessionError, match=r"git\.refused"):
        clone_status(clone)


def test_files_in_conflict_are_called_so(clone: Path) -> None:
    ring = clone / "jobs" / "ring.toml"
    for branch, line in (("other", "# other\n"), ("main", "# main\n")):
        by_git(clone, "checkout", "-q", "-B", branch, "origin/main")
        ring.write_text(ring.read_text() + line)
        by_git(clone, "commit", "-q", "-a", "-m", branch)
    with pytest.raises(subprocess.CalledProcessError):
        by_git(clone, "merge", "-q", "other")
    assert clone_status(clone).changes == (FileChange(path="jobs/ring.toml", how=FileChangeKind.CONFLICT),)


def test_without_a_clone_or_without_git_it_says_what_to_do(
    console: Console, clone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "plain").mkdir()
    said = console("jobs", "status", "--data", str(tmp_path / "plain"))
    assert said.code == 1 and "git init" in said.err
    inside = clone / "inside"  # of somebody's clone, and none itself
    inside.mkdir()
    assert console("jobs", "status", "--data", str(inside)).code == 1
    monkeypatch.setattr(git, "which", lambda name: None)
    said = console("jobs", "status", "--data", str(clone))
    assert said.code == 1 and "apt-get install git" in said.err
    assert cut_from(clone, {}) == {"commit": None, "problem": "git.not_installed"}
    assert console("jobs", "--data", str(clone)).code == 0


@pytest.mark.skipif(os.geteuid() != 0, reason="a folder of another account can only be made by root")
def test_a_clone_of_another_account_is_refused_with_the_words_of_git(console: Console, clone: Path) -> None:
    for path in (clone, clone / ".git"):
        os.chown(path, 61001, 61001)
    said = console("jobs", "status", "--data", str(clone))
    assert said.code == 1 and "ownership" in said.err and len(said.err.splitlines()) == 1


def test_texts_are_compared_with_the_commit(clone: Path) -> None:
    ring = clone / "jobs" / "ring.toml"
    text, commit = ring.read_text(encoding="utf-8"), by_git(clone, "rev-parse", "HEAD")
    bundled = load_job(EXPERIMENT).path
    found = cut_from(clone, {"job": (ring, text), "edited": (None, text), "machine": (bundled, "")})
    assert found == {"commit": commit, "job_differs": False, "edited_differs": True, "machine_differs": None}
    changed = cut_from(clone, {"job": (ring, f"{text}# more\n"), "new": (clone / "jobs" / "new.toml", text)})
    assert changed == {"commit": commit, "job_differs": True, "new_differs": True}
    assert cut_from(clone / "jobs", {}) is None


def test_a_cut_on_the_screens_keeps_the_commit_too(aligned: Floor) -> None:
    folder, found = aligned.context.records, list[Any]()
    folder.mkdir(exist_ok=True)
    by_git(folder, "init", "-q")
    by_git(folder, "commit", "-q", "--allow-empty", "-m", "nothing yet")
    loaded = load_job(EXPERIMENT)
    for source in (loaded, None):
        aligned.arm(loaded.job, loaded=source)
        aligned.do(Disarm())
        aligned.context.end_record()
        newest = story(folder, runs(folder)[0].run_id)
        found += [event.data for event in newest.events if event.kind == VERSIONED]
    commit = by_git(folder, "rev-parse", "HEAD")
    # Bundled, so of no commit; then as it was edited on the screen.
    assert [(each["commit"], each["job_differs"]) for each in found] == [(commit, None), (commit, True)]


@pytest.mark.long
def test_a_run_keeps_the_commit_and_whether_its_job_differs(console: Console, clone: Path) -> None:
    ring = clone / "jobs" / "ring.toml"
    ring.write_text(ring.read_text(encoding="utf-8").replace("cut_length_mm = 8.0", "cut_length_mm = 1.5"))
    for committed in (False, True):
        if committed:
            by_git(clone, "commit", "-q", "-a", "-m", "shorter")
        done = console("run", "ring", "--sim", "--strategy", "none", "--data", str(clone), "--json")
        assert done.code == 0, done.err
        newest = story(clone, runs(clone)[0].run_id)
        (event,) = [event for event in newest.events if event.kind == VERSIONED]
        commit = by_git(clone, "rev-parse", "HEAD")
        assert event.data == {"commit": commit, "job_differs": not committed, "machine_differs": None}
        assert newest.job_text == ring.read_text(encoding="utf-8")
        said = console("records", "show", newest.row.run_id, "--data", str(clone))
        assert commit[:12] in said.out and ("the job differs" in said.out) is not committed
