"""Build a wheel with the inner loops of the simulated controller compiled: same source, same bits, faster.

Off by default: the wheel is pure Python. `HATCH_BUILD_HOOK_ENABLE_CUSTOM=1 pip install .` turns it on; it needs a
C compiler. mypyc compiles the modules that `pyproject.toml` lists, and the wheel brings both forms of each.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

SAME_BITS = "-ffp-contract=off"  # else a C compiler may round a product and a sum once instead of twice


class CompiledWheel(BuildHookInterface[Any]):
    """The build hook of hatch."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and add what comes of it to the wheel, which is then one of this platform."""
        if version == "editable":
            raise RuntimeError("compiled modules do not follow an editable install: leave out -e")
        found = Path(tempfile.mkdtemp(prefix="compiled-"))
        for place in compiled(Path(self.root), self.config["modules"], found):
            build_data["force_include"][str(place)] = str(place.relative_to(found / "lib"))
        build_data["pure_python"] = False
        build_data["infer_tag"] = True


def compiled(root: Path, modules: list[str], found: Path) -> list[Path]:
    """Compile modules of the checkout into `found`; return the files, which lie below its `lib`."""
    from mypyc.build import mypycify
    from setuptools import Distribution
    from setuptools.command.build_ext import build_ext

    before = Path.cwd()
    os.chdir(root)
    try:
        extensions = mypycify(["--config-file", "pyproject.toml", *modules], target_dir=str(found / "c"))
        for extension in extensions:
            extension.extra_compile_args.append(SAME_BITS)
        command = build_ext(Distribution({"ext_modules": extensions}))
        command.build_lib, command.build_temp = str(found / "lib"), str(found / "o")
        command.ensure_finalized()
        command.run()
    finally:
        os.chdir(before)
    return [place for place in (found / "lib").rglob("*") if place.is_file()]
