"""`console roundness --separate`: the error of the gauge apart from the part, by several placements."""

from __future__ import annotations

from argparse import ArgumentTypeError, Namespace
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from console.cli.arguments import number_or_nan
from console.cli.library import data_of, gauge_of, naming
from console.cli.parser import Parser
from console.session.data.kept_files import utc_now
from console.session.learning.evaluated_part import fold_turns
from console.session.learning.gauge_errors import (
    filed_without_error,
    keep_error,
    newest_error,
    refuse_unlike,
    spell_drift,
    undeclared_error,
)
from console.text.catalogue import Catalogue
from console.text.columns import table
from profiles.files import printable
from profiles.metrology.harmonics import HIGHEST_HARMONIC, harmonic
from profiles.metrology.separation import BY_EYE_DEG, GaugeError, OrderApart, Placement, Separation, separate
from profiles.problem import Problem, ProfileError
from profiles.roundness import evaluate, profile_of
from profiles.trace_files.gauge_error import take_error_off
from profiles.trace_files.header import header_of
from profiles.trace_files.sections import SurfacePoints, TraceSection, parse_surface
from profiles.traces import read_trace_file

LARGEST_DEG = 360.0
NO_NAME = "gauge"  # in the trace, where its error is not kept


@dataclass(frozen=True, kw_only=True)
class SeparatedFiles:
    """What readings of one part show of their gauge, the first one without it, and RONt of all as they were read.

    `kept` is the file of the gauge's error, None if it was not asked for; `drift_um` how it has changed since the
    last one, by order. `turning_sd_deg` is how exactly the part was turned, by the file of the gauge or by eye.
    """

    found: Separation
    error: GaugeError
    first: TraceSection
    read_um: tuple[float, ...]
    kept: Path | None
    drift_um: dict[int, float] | None
    turning_sd_deg: float
    told: tuple[Problem, ...]


def placements(words: str) -> tuple[Placement, ...]:
    """Return the placements in an argument such as "0,90" or "0,180r"."""
    found = []
    for word in words.split(","):
        turned_deg = number_or_nan(word.removesuffix("r"))
        if not -LARGEST_DEG <= turned_deg <= LARGEST_DEG:
            raise ArgumentTypeError(Parser.text("usage.separate", value=words))
        found.append(Placement(turned_deg=turned_deg, opposite=word.endswith("r")))
    return tuple(found)


def separate_files(options: Namespace) -> SeparatedFiles:
    """Separate the files of the command line, one section each, and keep the error of the gauge if asked to.

    Raises ProfileError: those of the files; `separation.sections`; as `refuse_unlike` and `separate`.
    """
    files, readings, sections, read_um = [], [], [], []
    for name in (options.file, *options.others):
        where = printable(name)
        content = read_trace_file(Path(name))
        surface = parse_surface(content, where=where)
        if isinstance(surface, SurfacePoints) or len(surface) > 1:
            value = surface.strategy if isinstance(surface, SurfacePoints) else str(len(surface))
            raise ProfileError(Problem(code="separation.sections", where=where, value=value, limit="1"))
        (section,) = surface
        header, _ = header_of(section.trace.meta)
        with naming(where):
            turn, _ = fold_turns(section.trace, header)
            readings.append(profile_of(turn.angle_deg, turn.deviation_um, None, radius_mm=header.radius_mm))
            upr, kind = options.filter
            result = evaluate(turn.angle_deg, turn.deviation_um, upr, radius_mm=header.radius_mm, filter_kind=kind)
        files.append((Path(name).name, content))
        sections.append(section)
        read_um.append(result.ront_um)
    refuse_unlike([(name, section.trace) for (name, _), section in zip(files, sections, strict=True)])
    z_mm = sections[0].z_mm
    for (name, _), each in zip(files, sections, strict=True):
        if z_mm is not None and each.z_mm not in (z_mm, None):
            where, value, limit = printable(name), f"{each.z_mm:g}", f"{z_mm:g}"
            raise ProfileError(
                Problem(code="separation.unlike", where=where, key="z_mm", value=value, limit=limit)
            )
    gauge = gauge_of(options)
    sd_deg = BY_EYE_DEG if gauge is None or gauge.set_up_angle_deg is None else gauge.set_up_angle_deg
    found = separate(readings, options.separate, turning_sd_deg=sd_deg)
    kept, drift_um, name = None, None, options.save_gauge_error
    error = found.error_of(name or NO_NAME, utc_now()[:10], "")
    first = take_error_off(sections[0].trace, error)
    if name is not None:
        before = newest_error(data_of(options), name)
        kept, error = keep_error(data_of(options), name, found, files)
        drift_um = None if before is None else error.drift_um(before)
    return SeparatedFiles(
        found=found,
        error=error,
        first=replace(sections[0], trace=first),
        read_um=tuple(read_um),
        kept=kept,
        drift_um=drift_um,
        turning_sd_deg=sd_deg,
        told=() if gauge is None else undeclared_error(gauge, error),
    )


def without_kept_error(
    options: Namespace, found: tuple[TraceSection, ...] | SurfacePoints
) -> tuple[tuple[TraceSection, ...] | SurfacePoints, GaugeError | None, tuple[Problem, ...]]:
    """Return readings without the kept error of their gauge, that error, and what is to be told of it.

    The gauge is that of `--gauge-error`, else that of `--gauge`, of which none need be kept. Raises ProfileError:
    `gauge.error_unknown`, none is kept; as `newest_error`.
    """
    name, gauge = options.gauge_error, gauge_of(options)
    if name is None and gauge is None:
        return found, None, ()
    error = newest_error(data_of(options), gauge.name if name is None and gauge is not None else name)
    if error is None and name is not None:
        raise ProfileError(Problem(code="gauge.error_unknown", key=printable(name)))
    found, told = filed_without_error(found, error)
    return found, error, told if gauge is None else (*told, *undeclared_error(gauge, error))


def separation_fields(apart: SeparatedFiles) -> dict[str, object]:
    """Return part and gauge by order."""
    found = apart.found
    return {
        "placements": [asdict(each) for each in found.placements],
        "turning_sd_deg": apart.turning_sd_deg,
        "noise_um": found.noise_um,
        "RONt_as_read_um": list(apart.read_um),
        "orders": [_fields(each) for each in found.orders],
        "blind": list(found.blind),
        "gauge": apart.error.gauge if apart.kept else None,
        "valid_until": apart.error.valid_until or None,
        "drift": None if apart.drift_um is None else [{"n": n, "um": um} for n, um in apart.drift_um.items()],
    }


def _fields(order: OrderApart) -> dict[str, object]:
    gauge = order.gauge
    wave = harmonic(gauge.upr, gauge.cosine_um, gauge.sine_um)
    part = harmonic(gauge.upr, order.part_um.real, -order.part_um.imag)
    return {
        "n": gauge.upr,
        "gauge_um": wave.amplitude_um,
        "gauge_phase_deg": wave.phase_deg,
        "gauge_sd_um": gauge.sd_um,
        "proven": gauge.proven,
        "turning_um": order.turning_um,
        "part_um": part.amplitude_um,
        "part_phase_deg": part.phase_deg,
        "part_sd_um": order.part_sd_um,
    }


def separation_lines(apart: SeparatedFiles, text: Catalogue) -> list[str]:
    """Return the same in words."""
    found = apart.found
    rows = [tuple(text(f"separation.{key}") for key in ("n", "gauge", "sd", "phase", "part", "sd", "off"))]
    for order in found.orders:
        told = _fields(order)
        rows.append(
            (
                str(told["n"]),
                *(f"{told[key]:.3f} um" for key in ("gauge_um", "gauge_sd_um")),
                f"{told['gauge_phase_deg']:.1f} deg",
                *(f"{told[key]:.3f} um" for key in ("part_um", "part_sd_um")),
                text("separation.yes" if order.gauge.proven else "separation.unproven"),
            )
        )
    turned, read = ", ".join(map(str, found.placements)), ", ".join(f"{um:.3f}" for um in apart.read_um)
    blind = ", ".join(map(str, found.blind))
    worst = max(found.orders, key=lambda each: each.turning_um)
    lines = [
        text("separation.head", placements=turned, read=read),
        "",
        *table(rows, numeric=(0, 1, 2, 3, 4, 5)),
        text("separation.blind", orders=blind) if blind else text("separation.not_blind"),
        text("separation.never", highest=HIGHEST_HARMONIC),
        text(
            "separation.turning",
            deg=f"{apart.turning_sd_deg:g}",
            value=f"{worst.turning_um:.3f}",
            n=worst.gauge.upr,
        ),
    ]
    if apart.kept is not None:
        error = apart.error
        lines.append(text("separation.kept", gauge=error.gauge, until=error.valid_until, file=str(apart.kept)))
    if apart.drift_um is not None:
        moved = spell_drift(apart.drift_um)
        lines.append(text("separation.drift", value=moved) if moved else text("separation.no_drift"))
    return [*lines, ""]
