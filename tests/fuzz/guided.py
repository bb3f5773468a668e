"""The coverage-guided fuzzer (Atheris over libFuzzer), in a process of its own: one target, then it ends.

python -m tests.fuzz.guided TARGET FOLDER --inputs N --seconds S --seed N
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.mutating import TOO_LONG_S, Outcome
from tests.fuzz.target import LONGEST, Target

MEMORY_MB = 2048
PACKAGES = ("drivers", "profiles", "console")
_DONE = re.compile(r"stat::number_of_executed_units:\s*(\d+)")


def is_installed() -> bool:
    """Whether the coverage-guided fuzzer is there (the extra `fuzz`)."""
    return find_spec("atheris") is not None


def guide(target: Target, *, inputs: int, seconds: float, seed: int) -> Outcome:
    """Run it; it ends with the inputs, the time, or the first input that breaks the reader."""
    began_s = time.monotonic()
    with TemporaryDirectory() as folder:
        corpus, found = Path(folder, "corpus"), Path(folder, "found")
        corpus.mkdir()
        found.mkdir()
        for place, data in enumerate(target.starts()):
            (corpus / str(place)).write_bytes(data)
        words = [target.name, folder, "--inputs", str(inputs), "--seconds", str(seconds), "--seed", str(seed)]
        done = subprocess.run([sys.executable, "-m", "tests.fuzz.guided", *words], capture_output=True, text=True)
        said, broken = done.stderr + done.stdout, sorted(found.iterdir())
        count = _DONE.search(said)
        if count is None and not broken:
            raise RuntimeError(said[-2000:])
        return Outcome(
            tried=int(count[1]) if count else 0,
            accepted=len(list(corpus.iterdir())),
            seconds=time.monotonic() - began_s,
            broken_by=broken[0].read_bytes() if broken else None,
            error=said[-2000:] if broken else "",
        )


def main() -> None:
    """Fuzz until libFuzzer ends this process."""
    import atheris

    parser = argparse.ArgumentParser()
    parser.add_argument("target")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--inputs", type=int)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--seed", type=int)
    options = parser.parse_args()
    with atheris.instrument_imports(include=list(PACKAGES), enable_loader_override=False):
        from tests.fuzz.all_targets import TARGETS
    target = TARGETS[options.target]
    limits = (
        f"-runs={options.inputs}",
        f"-max_total_time={max(1, round(options.seconds))}",
        f"-seed={options.seed}",
    )
    bounds = (f"-max_len={LONGEST}", f"-timeout={TOO_LONG_S:.0f}", f"-rss_limit_mb={MEMORY_MB}")
    places = (f"-artifact_prefix={options.folder}/found/", str(options.folder / "corpus"))
    with target.trying() as one:

        def attempt(data: bytes) -> None:
            one(data)

        atheris.Setup([sys.argv[0], *limits, *bounds, "-print_final_stats=1", *places], attempt)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
