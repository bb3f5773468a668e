"""`console calibrate lobe`: the error of a job from the trace of a part that was cut without compensation."""

from __future__ import annotations

import hashlib
from argparse import Namespace
from pathlib import Path

from console.cli.judgement import lobe_place_line
from console.cli.library import SIM_OPTION, data_of, job_of, machine_of, name_file_in_problems, naming
from console.cli.output import show, tell
from console.session.learning.calibrating import keep_lobe, lobe_record, lobe_step
from console.session.learning.evaluated_part import read_section_file
from console.text.catalogue import Catalogue
from console.text.columns import table
from console.text.part_sentences import at_height
from profiles.calibration.lobe import FoundLobe, find_lobe
from profiles.files import printable
from profiles.problem import ProfileError
from profiles.store import LoadedJob


def calibrate_lobe(options: Namespace, text: Catalogue) -> int:
    """Fit the lobe of a trace; with `--keep` write it to the job, unless something speaks against it."""
    loaded, machine, where = job_of(options), machine_of(options, SIM_OPTION).machine, printable(options.file)
    with naming(where):
        filed = read_section_file(Path(options.file), loaded.job)
        content, trace = filed.content, filed.trace
        extra = options.extra or ()
        found = find_lobe(trace, loaded.job, extra=extra, robust=options.robust, practice=options.sim)
    reasons = name_file_in_problems(found.reasons, where)
    step = None if options.keep else lobe_step(loaded.job, found)
    doubts = () if step is None else (step.problem(where=where),)
    warnings = tell(
        (*name_file_in_problems(found.warnings, where), *doubts, *(() if options.keep else reasons)), text
    )
    written = kept = None
    if options.keep and not reasons:
        sha256 = hashlib.sha256(content).hexdigest()
        of_file = {"file": options.file, "file_sha256": sha256}
        written, kept = keep_lobe(loaded, found, machine, data_of(options), typed=options.confirm, **of_file)
    place = {"job": written and str(written.path), "revision": written and written.sha256}
    show(
        options,
        lambda: {**lobe_record(found), **place, "kept": kept and str(kept), "warnings": warnings},
        lambda: [
            at_height(filed.section_z_mm, text),
            *_lines(found, text),
            *_end(written, kept, options.keep, text),
        ],
    )
    if options.keep and reasons:
        raise ProfileError(*reasons)
    return 0


def _end(written: LoadedJob | None, kept: Path | None, asked: bool, text: Catalogue) -> list[str]:
    """Return where it was kept; nothing where that was requested and failed."""
    if written is None:
        return [] if asked else ["", text("calibrate.not_kept")]
    job = text("calibrate.job_kept", job=printable(str(written.path)), revision=written.sha256[:6])
    return ["", job, text("calibrate.kept", file=printable(str(kept)))]


def _lines(found: FoundLobe, text: Catalogue) -> list[str]:
    fit = found.fit
    columns = ("n", "pp", "confidence", "phase", "confidence", "significant")
    harmonics = [tuple(text(f"calibrate.column.{name}") for name in columns)]
    harmonics += [
        (
            str(each.n),
            f"{2.0 * each.amplitude_um:.3f} um",
            f"{2.0 * each.ci_um:.3f}",
            f"{each.phase_deg:.2f} deg",
            f"{each.ci_deg:.2f}",
            text("calibrate.yes" if each.significant else "calibrate.no"),
        )
        for each in fit.harmonics
    ]
    facts = [(text("calibrate.error"), f"{fit.error_um_pp:.3f}", f"± {2 * fit.lobe.ci_um:.3f} um p-p")]
    if found.phase_deg is not None:
        facts.append((text("calibrate.phase"), f"{found.phase_deg:.2f}", f"± {fit.lobe.ci_deg:.2f} deg"))
    if found.past_jaw_deg is not None:
        facts.append((text("calibrate.past_jaw"), f"{found.past_jaw_deg:z.2f}", "deg"))
    facts.append((text("calibrate.noise"), f"{fit.noise_um:.3f}", "um"))
    return [
        text("calibrate.lobe_head", jaws=fit.jaws, points=fit.points, turns=fit.turns, left_out=fit.left_out),
        "",
        *table(harmonics, numeric=(0, 1, 2, 3, 4)),
        "",
        *table(facts, numeric=(1,)),
        *([] if found.diagnosis is None else [lobe_place_line(found.diagnosis, text)]),
    ]
