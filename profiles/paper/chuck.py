"""Figs 3 to 6 and Eqs 1 to 3: the chuck's compliance around the turn, and the number of lobes that it makes.

The paper gives conditions, not readings: what can be compared is where the stiffness is largest and what makes it
larger. Jaw length and contacts are those of the machine profile, assumed there.

Eq 1: F(t) = N a0 q_0 / 2 + N sum q_n (a_n cos n N w t + b_n sin n N w t), with q_0 = r/R and q_n = (r/R)^(p_n).
Eq 2: M x'' + B x' + K x = F.
Steady state with all harmonics, W_n = n N w, D_n = sqrt((K - M W_n^2)^2 + (B W_n)^2),
psi_n = atan2(B W_n, K - M W_n^2):

    x = N a0 q_0 / (2 K) + sum N q_n (a_n cos(W_n t - psi_n) + b_n sin(W_n t - psi_n)) / D_n

The change of the depth of cut is x(R) - x(r). Eq 3 as printed is the first harmonic at resonance,
(N w)^2 = K / M. The paper writes (r/R)^(2n) in Eq 1 and (r/R)^N in Eq 3; a harmonic field of order m decays as
r^m, so that p_n = N n is consistent, and the exponent stays a parameter. Forces in N, x in um, + into the work.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from profiles.arrays import Floats, floats
from profiles.chucking.contact import Contact, cantilever_um, overhung_deflection, stiffness_at
from profiles.chucking.holding import REFERENCE_FORCE_N, holding_of
from profiles.chucking.ring import Ring, spring_back_um_pp
from profiles.machine import MachineProfile
from profiles.materials import material_named
from profiles.paper.record import Basis, Curve, Figure, Record, Relation, Section

TURN_DEG = np.arange(0.0, 361.0)
CHUCKING_N = (3077.0, 6593.0)  # the two chucking forces that the captions name; totals over three jaws
_FIG_3_N, _FIG_4_N, _FIG_5_N = 150.0, 150.0, 700.0
_FAR_MM = 125.0
_BARS_MM = (35.0, 68.0)
_PLACES_MM = (25.0, 75.0, 125.0)
_LOADS_N = (200.0, 400.0, 600.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reaction:
    """Chuck and part as one mass on a spring. `a_n` begins with a0, `b_n` with b1; even symmetry makes b_n 0.

    `exponent` is p_1 of (r/R)^(p_n), p_n = n p_1; None is the number of jaws.
    """

    mass_kg: float
    damping_n_s_per_m: float
    stiffness_n_per_m: float
    jaws: int
    a_n: tuple[float, ...]
    b_n: tuple[float, ...] = ()
    exponent: float | None = None

    @property
    def decay_exponent(self) -> float:
        """p_1, the power of r/R with which the first harmonic decays towards the axis."""
        return self.jaws if self.exponent is None else self.exponent


@dataclass(frozen=True, slots=True, kw_only=True)
class ForcedHarmonic:
    """One harmonic of the steady state: cos_um cos(n N angle) + sin_um sin(n N angle), lag included.

    `dynamic_n_per_m` is D_n, `lag_rad` is psi_n.
    """

    n: int
    dynamic_n_per_m: float
    lag_rad: float
    cos_um: float
    sin_um: float

    @property
    def amplitude_um(self) -> float:
        """Half of the peak-to-peak motion."""
        return math.hypot(self.cos_um, self.sin_um)


def forced_harmonics(
    reaction: Reaction, spindle_speed_rpm: float, radius_ratio: float = 1.0
) -> tuple[ForcedHarmonic, ...]:
    """Return the steady state of Eq 2 under Eq 1, harmonic by harmonic from n = 1; `radius_ratio` is r/R."""
    return tuple(
        _harmonic(reaction, n, spindle_speed_rpm, radius_ratio)
        for n in range(1, max(len(reaction.a_n) - 1, len(reaction.b_n)) + 1)
    )


def _harmonic(reaction: Reaction, n: int, rpm: float, radius_ratio: float) -> ForcedHarmonic:
    omega = n * reaction.jaws * 2 * math.pi * rpm / 60
    spring = reaction.stiffness_n_per_m - reaction.mass_kg * omega**2
    dash = reaction.damping_n_s_per_m * omega
    stiffness, lag = math.hypot(spring, dash), math.atan2(dash, spring)
    even_n = reaction.a_n[n] if n < len(reaction.a_n) else 0.0
    odd_n = reaction.b_n[n - 1] if n <= len(reaction.b_n) else 0.0
    scale = 1e6 * reaction.jaws * radius_ratio ** (n * reaction.decay_exponent) / stiffness
    return ForcedHarmonic(
        n=n,
        dynamic_n_per_m=stiffness,
        lag_rad=lag,
        cos_um=scale * (even_n * math.cos(lag) - odd_n * math.sin(lag)),
        sin_um=scale * (even_n * math.sin(lag) + odd_n * math.cos(lag)),
    )


def eq3_um(reaction: Reaction, spindle_speed_rpm: float, angle_deg: ArrayLike, radius_ratio: float) -> Floats:
    """Return Eq 3 as printed, valid at resonance and for the first harmonic only.

    N a0 (1 - r/R) / (2 K) + (1 - (r/R)^p) (a1 sin N w t - b1 cos N w t) / (w B). Far below its resonance, where
    chucks work, it overstates the lobe by 1 / (2 zeta) and turns it by a quarter of a lobe.
    """
    phase = reaction.jaws * np.radians(floats(angle_deg))
    omega = 2 * math.pi * spindle_speed_rpm / 60
    mean = reaction.jaws * reaction.a_n[0] * (1 - radius_ratio) / (2 * reaction.stiffness_n_per_m)
    b1 = reaction.b_n[0] if reaction.b_n else 0.0
    lobe = (reaction.a_n[1] * np.sin(phase) - b1 * np.cos(phase)) / (omega * reaction.damping_n_s_per_m)
    return floats(1e6 * (mean + lobe * (1 - radius_ratio**reaction.decay_exponent)))


def amplification(frequency_ratio: float, damping_ratio: float) -> tuple[float, float]:
    """Return (gain over the static deflection, lag in deg) of one mode at f / f_n."""
    spring, dash = 1 - frequency_ratio**2, 2 * damping_ratio * frequency_ratio
    return 1 / math.hypot(spring, dash), math.degrees(math.atan2(dash, spring))


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

RPM = 1000.0

RATIO = 0.9
_FINE_DEG = 0.1
# Amplitudes of its first three harmonics at `RATIO` and `RPM`, by integrating Eq 2 in time (to 3e-8 um).
_INTEGRATED_UM = (154.6986, 2.809495, 0.251956)
_NEAR_UM = 1e-3
_ROUNDING = 1e-6

LENGTH_MM = 40.0  # of the jaws: assumed
_SLITS, _SMALL_UM = 12, 0.5  # of a collet, taken as jaws; a lobe that no gauge of a shop finds: assumed
_RING = Ring(outside_mm=52.0, wall_mm=2.5, length_mm=LENGTH_MM, material=material_named("Al"))
_CLAMPED_N = 3 * 438.0  # the part of experiment 1, and the total force at which three jaws make 55 um of it

_by_the_contacts = partial(Record, basis=Basis.CONSTRUCTION, why="stiffening")
"""A record that holds for three contacts of any stiffening exponent."""

_more = partial(_by_the_contacts, expected=1.0, relation=Relation.ABOVE)


def bar_um(
    machine: MachineProfile,
    diameter_mm: float,
    overhang_mm: float,
    load_n: float,
    chucking_n: float,
    angle: ArrayLike,
) -> Floats:
    """Return the deflection of a steel bar at the load, pushed at angles (deg) from a jaw; in their shape."""
    held, per_jaw_n = holding_of(machine), chucking_n / 3
    alpha = held.contact_exponent
    contact = Contact(
        jaws=3,
        stiffness_n_per_um=stiffness_at(held.stiffness_n_per_um, REFERENCE_FORCE_N, per_jaw_n, alpha),
        force_per_jaw_n=per_jaw_n,
        alpha=alpha,
    )
    bent = cantilever_um(material_named("steel"), diameter_mm, overhang_mm, load_n)
    return overhung_deflection(contact, overhang_mm / held.jaw_length_mm, load_n, angle).along_um + bent


def section(machine: MachineProfile) -> Section:
    """Return the comparison of Figs 3 to 6 and of Eq 3."""
    return Section(
        "chuck", (*_fig_3(machine), *_fig_4_and_5(machine), *_fig_6(), *_eq_3()), tuple(_figures(machine))
    )


def _fig_3(machine: MachineProfile) -> tuple[Record, ...]:
    low, high = (_FIG_3_N / bar_um(machine, 65.0, _FAR_MM, _FIG_3_N, each, TURN_DEG) for each in CHUCKING_N)
    first, second = (float(TURN_DEG[low[span].argmax() + span.start]) for span in (slice(0, 60), slice(60, 180)))
    return (
        _by_the_contacts("fig3.stiffest", first, "deg", at="1", expected=0.0, tolerance=0.5),
        _by_the_contacts("fig3.stiffest", second, "deg", at="2", expected=120.0, tolerance=0.5),
        _more("fig3.force", float(high.mean() / low.mean())),
        _more("fig3.range", float(low.max() / low.min())),
    )


def _fig_4_and_5(machine: MachineProfile) -> tuple[Record, ...]:
    around = np.arange(360.0)
    fig_4 = bar_um(machine, 35.0, _FAR_MM, _FIG_4_N, CHUCKING_N[0], around)
    harmonics = np.abs(np.fft.rfft(fig_4 - fig_4.mean()))
    by_load = [np.ptp(bar_um(machine, 68.0, _FAR_MM, load, CHUCKING_N[1], around)) for load in _LOADS_N]
    by_place = [np.ptp(bar_um(machine, 68.0, place, _FIG_5_N, CHUCKING_N[1], around)) for place in _PLACES_MM]
    thin, thick = (bar_um(machine, each, _FAR_MM, 400.0, CHUCKING_N[1], around) for each in _BARS_MM)
    contacts = {"stiffness_n_per_um": holding_of(machine).stiffness_n_per_um, "force_n": REFERENCE_FORCE_N}
    bars = {"thin_mm": _BARS_MM[0], "thick_mm": _BARS_MM[1], "mean_ratio": float(thin.mean() / thick.mean())}
    other = partial(Record, expected=1.0, tolerance=_ROUNDING, relation=Relation.OTHER)
    return (
        _by_the_contacts("fig4.waves", float(harmonics.argmax()), expected=3.0),
        Record("fig4.variation", float(np.ptp(fig_4)), "um", why="contact", facts=contacts),
        _more("fig5.load", float(by_load[-1] / by_load[0])),
        other("fig5.diameter", float(np.ptp(thin) / np.ptp(thick)), why="diameter", facts=bars),
        _more("fig5.place", float(by_place[-1] / by_place[0])),
    )


def _fig_6() -> tuple[Record, ...]:
    facts = {"damping_n_s_per_m": SWINGING.damping_n_s_per_m, "speed_rpm": RPM, "radius_ratio": RATIO}
    depths = {jaws: float(np.ptp(_eq3_lobe_um(jaws, np.arange(0.0, 360.0, _FINE_DEG)))) for jaws in (2, 3, 4)}
    rings = {jaws: spring_back_um_pp(_RING, jaws, _CLAMPED_N / jaws) for jaws in depths}
    ring = {"slits": _SLITS, "force_n": _CLAMPED_N, "two_um": rings[2], "three_um": rings[3], "four_um": rings[4]}
    collet = partial(_by_the_contacts, expected=0.0, tolerance=_SMALL_UM, why="collet")
    order = partial(Record, "fig6.order", tolerance=0.05, why="ring", facts=ring)
    return (
        *(Record("fig6.depth", um, "um", at=f"{n}", why="swinging", facts=facts) for n, um in depths.items()),
        order(rings[4] / rings[2], expected=depths[4] / depths[2]),
        collet("collet.lobe", spring_back_um_pp(_RING, _SLITS, _CLAMPED_N / _SLITS), "um", facts=ring),
    )


def _eq3_lobe_um(jaws: int, angle_deg: Floats) -> Floats:
    """Return the depth of Eq 3 about its mean, a cut of a tenth of the radius; with (r/R)^N, as it is printed."""
    swinging = replace(SWINGING, jaws=jaws, exponent=None, a_n=(0.0, *SWINGING.a_n[1:]))
    return eq3_um(swinging, RPM, angle_deg, RATIO)


def _eq_3() -> tuple[Record, ...]:
    """Compare Eq 3 with the general steady state: equal to its first harmonic at resonance, not far below."""
    gain, _ = amplification(0.1, 0.03)
    resonant, _ = amplification(1.0, 0.03)
    printed_um = float(np.ptp(eq3_um(SWINGING, RPM, np.arange(360.0), 0.0))) / 2
    ours = zip(forced_harmonics(SWINGING, RPM, RATIO), _INTEGRATED_UM, strict=True)
    near = partial(Record, unit="um", tolerance=_NEAR_UM, basis=Basis.CONSTRUCTION, why="integrated")
    return (
        *(near("eq2.harmonic", each.amplitude_um, at=f"{each.n}", expected=um) for each, um in ours),
        near("eq3.resonance", RATIO**2 * printed_um, expected=_INTEGRATED_UM[0]),
        Record("eq3.below", resonant / gain, expected=1.0, tolerance=0.05, why="quasi_static"),
    )


def _figures(machine: MachineProfile) -> Iterator[Figure]:
    def curves(unit: str, each: Mapping[float, Floats]) -> tuple[Curve, ...]:
        return tuple(Curve(f"{value:.0f} {unit}", TURN_DEG, y) for value, y in each.items())

    def varied(overhang_mm: float, load_n: float) -> Floats:
        moved = bar_um(machine, 68.0, overhang_mm, load_n, CHUCKING_N[1], TURN_DEG)
        return floats(moved - moved.mean())

    stiffness = {n: _FIG_3_N / bar_um(machine, 65.0, _FAR_MM, _FIG_3_N, n, TURN_DEG) for n in CHUCKING_N}
    yield Figure("fig3", "deg", "N/um", curves("N", stiffness))
    moved = bar_um(machine, 35.0, _FAR_MM, _FIG_4_N, CHUCKING_N[0], TURN_DEG)
    yield Figure("fig4", "deg", "um", curves("N", {_FIG_4_N: moved}))
    yield Figure("fig5a", "deg", "um", curves("N", {load: varied(_FAR_MM, load) for load in _LOADS_N}))
    yield Figure("fig5b", "deg", "um", curves("mm", {place: varied(place, _FIG_5_N) for place in _PLACES_MM}))
    depths = (Curve(f"N = {jaws}", TURN_DEG, _eq3_lobe_um(jaws, TURN_DEG)) for jaws in (2, 3, 4))
    yield Figure("fig6", "deg", "um", tuple(depths))
