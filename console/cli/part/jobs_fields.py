"""A saved job for JSON."""

from __future__ import annotations

from console.cli.part.jobs_lines import Listed
from console.text.catalogue import Catalogue
from profiles.lobe.lobe_conditions import lobe_source
from profiles.store import LoadedJob


def job_fields(listed: Listed, text: Catalogue) -> dict[str, object]:
    """Return the job, or why it is unreadable."""
    entry, loaded = listed
    fields: dict[str, object] = {"name": entry.name, "path": str(entry.path), "bundled": entry.bundled}
    if not isinstance(loaded, LoadedJob):
        return {**fields, "problems": [text.problem(problem) for problem in loaded]}
    job = loaded.job
    return {
        **fields,
        "title": job.name,
        "sha256": loaded.sha256,
        "material": job.material,
        "diameter_mm": job.diameter_mm,
        "wall_thickness_mm": job.wall_thickness_mm,
        "overhang_mm": job.overhang_mm,
        "jaws": job.jaws,
        "chucking_force_n": job.chucking_force_n,
        "depth_of_cut_mm": job.depth_of_cut_mm,
        "feed_mm_per_rev": job.feed_mm_per_rev,
        "spindle_speed_rpm": job.spindle_speed_rpm,
        "cut_length_mm": job.cut_length_mm,
        "lobe_error_um_pp": job.lobe_error_um_pp,
        "lobe_phase_deg": job.lobe_phase_deg,
        "lobe_error_source": lobe_source(job),
        "roundness_tolerance_um": job.roundness_tolerance_um,
        "lobe_frequency_hz": job.lobe_frequency_hz,
        "assumed": list(job.assumed),
        "source": job.source,
        "copied_from": job.copied_from,
    }
