"""What a user must know before believing a mirror model: its gains, roots, range, and where it is not physical."""

import math
from dataclasses import dataclass

import numpy as np

from microrad.core import lti
from microrad.core.units import plain
from microrad.mirror.hysteresis import BoucWen, Creep, PrandtlIshlinskii, slow_gain
from microrad.mirror.model import creep_model, hysteresis_model, linear_part
from microrad.mission.tables import mirror as mirror_table


@dataclass(frozen=True, slots=True)
class Root:
    """A pole or zero: natural frequency, damping ratio (1 or -1 when real), whether it lies in the excited band."""

    kind: str
    frequency_hz: float
    damping: float
    in_band: bool


@dataclass(frozen=True, slots=True)
class Summary:
    """What a user must know before believing a mirror model. Gains are those of the linear part before normalising."""

    name: str
    composition: str
    model: BoucWen | PrandtlIshlinskii
    creep: Creep
    roots: tuple[Root, ...]
    dc_gain: float
    flat_band_hz: tuple[float, float]
    in_band_gain: tuple[float, float]
    normalise_at_hz: float
    normalised_by: float
    rate_limit_v_s: float
    warnings: tuple[str, ...]

    def __str__(self) -> str:
        """The summary as text, one fact a line."""
        bouc_wen = isinstance(self.model, BoucWen)
        kind = "Bouc-Wen" if bouc_wen else "Prandtl-Ishlinskii"
        lines = [f"{self.name}: {self.composition}, {kind} hysteresis"]
        if self.roots:
            top = f"{self.flat_band_hz[1]:{'.0f' if self.flat_band_hz[1] >= 10.0 else '.2g'}}"
            lines += [
                f"  linear part divided by {self.normalised_by:.5f}, its magnitude at {self.normalise_at_hz:g} Hz",
                f"  gain at DC {self.dc_gain:.5f}, in the flat band from {self.flat_band_hz[0]:g} to "
                f"{top} Hz {self.in_band_gain[0]:.5f} to {self.in_band_gain[1]:.5f}",
            ]
            lines += [f"  {r.kind} at {r.frequency_hz:.4g} Hz, damping {r.damping:.3f}" for r in self.roots]
        if self.creep.weights_rad_v:
            share = 100.0 * math.fsum(self.creep.weights_rad_v) / slow_gain(self.model)
            first, last = self.creep.time_constants_s[0], self.creep.time_constants_s[-1]
            lags = f"lags from {first:g} s to {last:g} s" if first < last else f"a lag of {first:g} s"
            lines.append(f"  creep adds {share:.3g} % of the gain in the long run, with {lags}")
        limit = f"{self.rate_limit_v_s:.4g} V/s"
        lines += [
            f"  rate in the hysteresis held at {limit}; clamped samples are counted"
            if bouc_wen or (isinstance(self.model, PrandtlIshlinskii) and self.model.widening_s)
            else f"  valid to {limit}"
        ]
        return "\n".join(lines + [f"  warning: {w}" for w in self.warnings])


def _roots(table: mirror_table.LinearPart) -> tuple[Root, ...]:
    def root(kind: str, r: complex) -> Root:
        f = abs(r) / (2 * math.pi)
        damping = -r.real / abs(r) if r else 1.0
        return Root(kind, f, damping, table.excited_from_hz <= f <= table.excited_to_hz)

    zeros, poles = table.roots
    named = [("pole", r) for r in poles] + [("zero", r) for r in zeros]
    return tuple(root(kind, r) for kind, r in named if r.imag >= 0)


def _flat_band(table: mirror_table.LinearPart) -> tuple[float, float]:
    """Where the gain should be flat: excited, and at most a tenth of the lowest resonance."""
    resonant = [r.frequency_hz for r in _roots(table) if r.kind == "pole" and r.damping < 1.0]
    top = min([table.excited_to_hz, *(f / 10.0 for f in resonant)])
    return table.excited_from_hz, max(top, table.excited_from_hz)


def unknown_dynamics(table: mirror_table.Mirror) -> str:
    """Why nothing that is found of a loop around a mirror may be relied on; "" where it may."""
    if table.linear is not None:
        return ""
    return (
        "the model of the mirror has no linear part, so its resonances and its lag are not known, and a controller "
        "that is tuned on it may be unstable on the mirror; record a chirp or a multisine as well, and identify again"
    )


def summarise(table: mirror_table.Mirror) -> Summary:
    """Facts and warnings about the mission's mirror: gains, poles and zeros outside the excited band, admissibility."""
    model = hysteresis_model(table, table.rate_limit_v_s, table.bias_v)
    warnings = [*_admissibility(model), *filter(None, [unknown_dynamics(table)])]
    roots: tuple[Root, ...] = ()
    dc, flat, band, by, at = math.nan, (math.nan, math.nan), (math.nan, math.nan), 1.0, math.nan
    if table.linear is not None:
        system, by = linear_part(table.linear)
        roots, at = _roots(table.linear), table.linear.normalise_at_hz
        flat = _flat_band(table.linear)
        gain = np.abs(lti.frequency_response(system, np.array([0.0, *np.geomspace(*flat, 100)]))[:, 0, 0]) * abs(by)
        dc, band = float(gain[0]), (float(gain[1:].min()), float(gain[1:].max()))
        warnings += [
            f"{r.kind} at {plain(r.frequency_hz)} Hz lies outside the excited band "
            f"({table.linear.excited_from_hz:g} to {table.linear.excited_to_hz:g} Hz)"
            + (": drift fitted as dynamics" if r.frequency_hz < table.linear.excited_from_hz else ": extrapolated")
            for r in roots
            if not r.in_band
        ]
        warnings += [f"unstable pole at {r.frequency_hz:.3g} Hz" for r in roots if r.kind == "pole" and r.damping < 0.0]
        if not 0.9 * band[0] <= dc <= 1.1 * band[1]:
            warnings.append(f"gain at DC {dc:.5f} is not the gain in the band, {band[0]:.5f} to {band[1]:.5f}")
    return Summary(
        table.name,
        table.composition,
        model,
        creep_model(table),
        roots,
        dc,
        flat,
        band,
        at,
        by,
        table.rate_limit_v_s,
        tuple(warnings),
    )


def _admissibility(model: BoucWen | PrandtlIshlinskii) -> tuple[str, ...]:
    """The warning for a model whose local slope turns negative after a reversal, or none."""
    if isinstance(model, PrandtlIshlinskii):
        return ()
    slope, rate = model.reversal_slope_rad_v(), model.admissible_rate_v_s
    if slope < 0.0:
        return (
            f"not physical at reversals: the local slope falls to {_mrad_v(slope)} mrad/V against d1 = "
            f"{_mrad_v(model.d1_rad_v)} mrad/V, so the modelled mirror first moves the wrong way, "
            f"by {model.wrong_way_rad * 1e6:.1f} µrad on a slow drive",
        )
    if rate < model.rate_limit_v_s:
        shown = math.floor(rate) if rate >= 10.0 else f"{rate:.2g}"
        return (f"the slope after a reversal stays positive only up to {shown} V/s before the reversal",)
    return ()


def _mrad_v(value_rad_v: float) -> str:
    return f"{value_rad_v * 1e3:{'.3f' if abs(value_rad_v) >= 1e-5 else '.3g'}}"
