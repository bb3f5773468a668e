"""Figs 3 to 6 and Eqs 1 to 3: the chuck's compliance around the turn, and the number of lobes that it makes.

The paper gives conditions, not readings: what can be compared is where the stiffness is largest and what makes it
larger. Jaw length and contacts are those of the machine profile, assumed there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.chucking.contact import Contact, Overhung, cantilever_um, overhung_deflection, stiffness_at
from profiles.chucking.holding import REFERENCE_FORCE_N, holding_of
from profiles.chucking.reaction import Reaction, amplification, eq3_um, forced_harmonics
from profiles.chucking.ring import Ring, spring_back_um_pp
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.paper.record import Curve, Figure, Record, Relation, Section, constructed

TURN_DEG = np.arange(0.0, 361.0)
CHUCKING_N = (3077.0, 6593.0)
"""The two chucking forces that the captions name; totals over three jaws."""

_FIG_3_N, _FIG_4_N, _FIG_5_N = 150.0, 150.0, 700.0
_FAR_MM = 125.0
_BARS_MM = (35.0, 68.0)
_PLACES_MM = (25.0, 75.0, 125.0)
_LOADS_N = (200.0, 400.0, 600.0)

SWINGING = Reaction(
    mass_kg=4.0,
    damping_n_s_per_m=200.0,
    stiffness_n_per_m=4.0 * (100.0 * np.pi) ** 2,
    jaws=3,
    a_n=(10.0, 4.0, 1.5, 0.5),
    b_n=(0.0, 0.8, 0.0),
    exponent=2.0,
)
"""A chuck that resonates at 50 Hz, where Eq 3 is valid; the paper gives no numbers. Eq 1 as printed."""

_RPM = 1000.0

_RATIO = 0.9
_FINE_DEG = 0.1
_INTEGRATED_UM = (154.6986, 2.809495, 0.251956)
"""Amplitudes of its first three harmonics at `_RATIO` and `_RPM`, by integrating Eq 2 in time (to 3e-8 um)."""

_NEAR_UM = 1e-3
_ROUNDING = 1e-6

_RING = Ring(outside_mm=52.0, wall_mm=2.5, length_mm=40.0, material=material_named("Al"))
_CLAMPED_N = 3 * 438.0
"""The part of experiment 1, and the total force at which three jaws make 55 um of it."""


def bar_um(
    machine: MachineProfile,
    diameter_mm: float,
    overhang_mm: float,
    load_n: float,
    chucking_n: float,
    angle: ArrayLike,
) -> Floats:
    """Return the deflection of a steel bar at the load, pushed at angles (deg) from a jaw; in their shape."""
    held = holding_of(machine)
    per_jaw_n = chucking_n / 3
    contact = Contact(
        jaws=3,
        stiffness_n_per_um=stiffness_at(
            held.stiffness_n_per_um, REFERENCE_FORCE_N, per_jaw_n, held.contact_exponent
        ),
        force_per_jaw_n=per_jaw_n,
        alpha=held.contact_exponent,
    )
    place = Overhung(jaw_length_mm=held.jaw_length_mm, overhang_mm=overhang_mm)
    bent = cantilever_um(material_named("steel"), diameter_mm, overhang_mm, load_n)
    return overhung_deflection(contact, place, load_n, angle).along_um + bent


def section(machine: MachineProfile) -> Section:
    """Return the comparison of Figs 3 to 6 and of Eq 3."""
    return Section(
        name="chuck",
        records=(*_fig_3(machine), *_fig_4_and_5(machine), *_fig_6(), *_eq_3()),
        figures=(_figure_3(machine), _figure_4(machine), *_figures_5(machine), _figure_6()),
    )


def _fig_3(machine: MachineProfile) -> tuple[Record, ...]:
    low, high = (_FIG_3_N / bar_um(machine, 65.0, _FAR_MM, _FIG_3_N, each, TURN_DEG) for each in CHUCKING_N)
    first, second = (float(TURN_DEG[low[span].argmax() + span.start]) for span in (slice(0, 60), slice(60, 180)))
    return (
        _by_the_contacts(_stiffest(first, "1", 0.0)),
        _by_the_contacts(_stiffest(second, "2", 120.0)),
        _more("fig3.force", float(high.mean() / low.mean())),
        _more("fig3.range", float(low.max() / low.min())),
    )


def _by_the_contacts(record: Record) -> Record:
    """Return a record that holds for three contacts of any stiffening exponent."""
    return constructed(record, "stiffening")


def _stiffest(ours_deg: float, at: str, expected_deg: float) -> Record:
    return Record(name="fig3.stiffest", ours=ours_deg, unit="deg", at=at, expected=expected_deg, tolerance=0.5)


def _more(name: str, ours: float) -> Record:
    return _by_the_contacts(Record(name=name, ours=ours, expected=1.0, relation=Relation.ABOVE))


def _fig_4_and_5(machine: MachineProfile) -> tuple[Record, ...]:
    around = np.arange(360.0)
    fig_4 = bar_um(machine, 35.0, _FAR_MM, _FIG_4_N, CHUCKING_N[0], around)
    waves = np.abs(np.fft.rfft(fig_4 - fig_4.mean()))
    by_load = [np.ptp(bar_um(machine, 68.0, _FAR_MM, load, CHUCKING_N[1], around)) for load in _LOADS_N]
    thin, thick = (bar_um(machine, each, _FAR_MM, 400.0, CHUCKING_N[1], around) for each in _BARS_MM)
    near, far = (
        np.ptp(bar_um(machine, 68.0, each, _FIG_5_N, CHUCKING_N[1], around))
        for each in (_PLACES_MM[0], _PLACES_MM[-1])
    )

    contacts = {"stiffness_n_per_um": holding_of(machine).stiffness_n_per_um, "force_n": REFERENCE_FORCE_N}
    return (
        _by_the_contacts(Record(name="fig4.waves", ours=float(waves.argmax()), expected=3.0)),
        Record(name="fig4.variation", ours=float(np.ptp(fig_4)), unit="um", why="contact", facts=contacts),
        _more("fig5.load", float(by_load[-1] / by_load[0])),
        Record(
            name="fig5.diameter",
            ours=float(np.ptp(thin) / np.ptp(thick)),
            expected=1.0,
            tolerance=_ROUNDING,
            relation=Relation.OTHER,
            why="diameter",
            facts={
                "thin_mm": _BARS_MM[0],
                "thick_mm": _BARS_MM[1],
                "mean_ratio": float(thin.mean() / thick.mean()),
            },
        ),
        _more("fig5.place", float(far / near)),
    )


def _fig_6() -> tuple[Record, ...]:
    facts = {"damping_n_s_per_m": SWINGING.damping_n_s_per_m, "speed_rpm": _RPM, "radius_ratio": _RATIO}
    depths = {jaws: float(np.ptp(_eq3_lobe_um(jaws, np.arange(0.0, 360.0, _FINE_DEG)))) for jaws in (2, 3, 4)}
    rings = {jaws: spring_back_um_pp(_RING, jaws, _CLAMPED_N / jaws) for jaws in depths}
    eq_3 = (
        Record(name="fig6.depth", at=f"{jaws}", ours=depth, unit="um", why="swinging", facts=facts)
        for jaws, depth in depths.items()
    )
    against = Record(
        name="fig6.order",
        ours=rings[4] / rings[2],
        expected=depths[4] / depths[2],
        tolerance=0.05,
        why="ring",
        facts={"force_n": _CLAMPED_N, "two_um": rings[2], "three_um": rings[3], "four_um": rings[4]},
    )
    return (*eq_3, against)


def _eq3_lobe_um(jaws: int, angle_deg: Floats) -> Floats:
    """Return the depth of Eq 3 about its mean, a cut of a tenth of the radius; with (r/R)^N, as it is printed."""
    swinging = replace(SWINGING, jaws=jaws, exponent=None, a_n=(0.0, *SWINGING.a_n[1:]))
    return eq3_um(swinging, _RPM, angle_deg, _RATIO)


def _eq_3() -> tuple[Record, ...]:
    """Compare Eq 3 with the general steady state: equal to its first harmonic at resonance, not far below."""
    gain, _ = amplification(0.1, 0.03)
    resonant, _ = amplification(1.0, 0.03)
    printed_um = float(np.ptp(eq3_um(SWINGING, _RPM, np.arange(360.0), 0.0))) / 2
    ours = zip(forced_harmonics(SWINGING, _RPM, _RATIO), _INTEGRATED_UM, strict=True)
    return (
        *(
            Record(
                name="eq2.harmonic",
                at=f"{wave.n}",
                ours=wave.amplitude_um,
                unit="um",
                expected=expected,
                tolerance=_NEAR_UM,
                why="integrated",
            )
            for wave, expected in ours
        ),
        Record(
            name="eq3.resonance",
            ours=_RATIO**2 * printed_um,
            unit="um",
            expected=_INTEGRATED_UM[0],
            tolerance=_NEAR_UM,
            why="integrated",
        ),
        Record(name="eq3.below", ours=resonant / gain, expected=1.0, tolerance=0.05, why="quasi_static"),
    )


def _figure_3(machine: MachineProfile) -> Figure:
    curves = (
        Curve.of(f"{force:.0f} N", TURN_DEG, _FIG_3_N / bar_um(machine, 65.0, _FAR_MM, _FIG_3_N, force, TURN_DEG))
        for force in CHUCKING_N
    )
    return Figure(name="fig3", x_unit="deg", y_unit="N/um", curves=tuple(curves))


def _figure_4(machine: MachineProfile) -> Figure:
    moved = bar_um(machine, 35.0, _FAR_MM, _FIG_4_N, CHUCKING_N[0], TURN_DEG)
    return Figure(name="fig4", x_unit="deg", y_unit="um", curves=(Curve.of("150 N", TURN_DEG, moved),))


def _figures_5(machine: MachineProfile) -> tuple[Figure, Figure]:
    def varied(overhang_mm: float, load_n: float) -> Floats:
        moved = bar_um(machine, 68.0, overhang_mm, load_n, CHUCKING_N[1], TURN_DEG)
        return floats(moved - moved.mean())

    loads = (Curve.of(f"{load:.0f} N", TURN_DEG, varied(_FAR_MM, load)) for load in _LOADS_N)
    places = (Curve.of(f"{place:.0f} mm", TURN_DEG, varied(place, _FIG_5_N)) for place in _PLACES_MM)
    return (
        Figure(name="fig5a", x_unit="deg", y_unit="um", curves=tuple(loads)),
        Figure(name="fig5b", x_unit="deg", y_unit="um", curves=tuple(places)),
    )


def _figure_6() -> Figure:
    curves = (Curve.of(f"N = {jaws}", TURN_DEG, _eq3_lobe_um(jaws, TURN_DEG)) for jaws in (2, 3, 4))
    return Figure(name="fig6", x_unit="deg", y_unit="um", curves=tuple(curves))
