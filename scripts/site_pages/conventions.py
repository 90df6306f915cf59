"""What each convention of a link costs: the shipped missions read otherwise, one field at a time."""

import math
from typing import Any, get_args

from microrad import link
from microrad.core.units import format_quantity
from microrad.link.budget.maps import convention_maps
from microrad.mission.file import load_mission
from microrad.mission.model import Mission
from microrad.mission.tables.link import UNUSED, BeamShape
from site_pages.cases import ROOT, module
from site_pages.tables import code, table

_HEAD = """# Conventions, and what each costs in dB

A link budget leaves much to convention: what a Strehl of 0.4 is, whether a divergence is a full or a half angle, how a
beam falls off its axis. In microrad each is a key of `[conventions]` in the mission file, none is assumed. Below two
missions are read otherwise, one key at a time; the margins were computed when this page was made.
[Link budgets](link.md) says why each default is what it is.
"""
_WHY = {
    ("pointing_loss", "gaussian"): "gain of even light, loss of an uncut Gaussian beam of 1/e2 radius D/2",
    ("pointing_loss", "gain"): "exp(-G error^2): twice the decibels",
    ("pointing_loss", "pattern"): "the far field that belongs to the gain taken, here of even light",
    ("strehl", "decibel"): "the stated Strehl is a loss in dB",
    ("strehl", "ratio"): "the stated Strehl is a ratio",
    ("divergence", "full-1/e2"): "the stated divergence is the full angle at 1/e2",
    ("divergence", "half-1/e2"): "it is the half angle: a wider cone with less light",
    ("residual", "per-axis"): "the simulated error of one axis is the radial one",
    ("residual", "radial"): "two like axes: sqrt(2) of it",
    ("mirror_angle", "line-of-sight"): "the mirror's output is the line of sight",
    ("mirror_angle", "optical"): "the output is ahead of the telescope",
    ("mirror_angle", "mechanical"): "the output is the mirror's tilt, which reflection doubles",
}


def pages() -> dict[str, str]:
    """The page of conventions."""
    parts = [_HEAD]
    for name, title in (("paper", "The paper's link"), ("leo-geo", "The shipped mission")):
        file = load_mission(ROOT / "missions" / f"{name}.toml")
        parts += [f"## {title}", _introduced(name, file.mission), _readings(file)]
    parts += ["## Which receiver a stated margin implies", _implied()]
    parts += ["## What others' budgets say of the same link", _PEERS, _peers()]
    return {"conventions.md": "\n\n".join(parts) + "\n"}


def _introduced(name: str, m: Mission) -> str:
    beam = m.communication
    return (
        f"`missions/{name}.toml`: {format_quantity(beam.data_rate_bit_s, 'bit/s')} over "
        f"{beam.distance_m / 1e3:.0f} km with a static error of {beam.pointing_error_rad * 1e6:.0f} µrad. "
        "All margins are those at that error."
    )


def _readings(file: Any) -> str:
    m, rows = file.mission, []
    for field, info in type(m.conventions).model_fields.items():
        if not (choices := _choices(info.annotation)):
            continue
        own = getattr(m.conventions, field)
        base = _margins(file, m)
        for choice in choices:
            margins = _margins(file, _read(m, field, choice))
            changes = [
                f"{name} {new:.2f} dB ({new - old:+.2f})"
                for (name, old), new in zip(base.items(), margins.values(), strict=True)
                if abs(new - old) > 5e-3
            ]
            note = "as the file has it" if choice == own else "; ".join(changes) or _beside_budget(field, m)
            rows.append((code(field), code(choice), note, _WHY.get((field, choice), "")))
    first = ", ".join(f"{name} {value:.2f} dB" for name, value in _margins(file, m).items())
    return f"As the file has it: {first}.\n\n" + table(("convention", "reading", "margins", "what it means"), rows)


def _beside_budget(field: str, m: Mission) -> str:
    """What a convention changes that counts where a loop is simulated, not in the budget at a stated error."""
    if field != "residual":
        return "no margin at a stated error; it scales what the simulated mirror turns the line of sight by"
    error = m.requirement.pointing_error_rad
    one, two = (
        float(link.margin_map(link.of(m), m.communication.data_rate_bit_s, each)[0, 0])
        for each in (error, math.sqrt(2) * error)
    )
    return f"of a simulated residual of {error * 1e6:.0f} µrad an axis: {two:.2f} dB ({two - one:+.2f})"


def _choices(kind: Any) -> tuple[str, ...]:
    found = tuple(each for each in get_args(kind) if isinstance(each, str) and each != UNUSED)
    return found or tuple(word for each in get_args(kind) for word in _choices(each))


def _read(m: Mission, field: str, choice: str) -> Mission:
    update: dict[str, Any] = {"conventions": m.conventions.model_copy(update={field: choice})}
    if (field, choice) == ("pointing_loss", "pattern"):
        shape = BeamShape.model_validate({"profile": "uniform"})
        update["communication"] = m.communication.model_copy(update={"beam": shape})
    return m.model_copy(update=update)


def _margins(file: Any, m: Mission) -> dict[str, float]:
    shared = link.Shared.of(m)
    found = {"communication": link.communication_budget(link.of(m), file.sources).margin_db}
    for name in ("beacon", "answer"):
        found[name] = link.beam_budget(name, shared, getattr(m, name), file.sources).margin_db
    return found


def _implied() -> str:
    data = link.of(load_mission(ROOT / "missions" / "paper.toml").mission)
    text = (
        "The paper prints a margin of 3 dB at 300 Mbit/s and 10 µrad, and no sensitivity. What the receiver then needs "
        "hangs on how its table is read; its Fig. 2 is a band over these four readings."
    )
    maps = convention_maps(data, data.table.data_rate_bit_s, data.requirement.pointing_error_rad)
    rows = [
        (
            code(each.pointing_loss),
            code(each.strehl),
            f"{each.photons_per_bit:.1f}",
            f"{float(maps[each.pointing_loss, each.strehl][0, 0]):.2f} dB",
        )
        for each in link.implied_sensitivity(data)
    ]
    return f"{text}\n\n" + table(
        (
            "pointing loss",
            "Strehl",
            "photons per bit implied",
            f"margin with {data.table.receiver_sensitivity_photon_bit:.1f} photons per bit",
        ),
        rows,
    )


_PEERS = (
    "Each by its own formulas, for the paper's link: the aperture's gain, the pointing loss at one end or both. "
    "`benchmarks/link_conventions.py` prints these and each term by itself."
)


def _peers() -> str:
    rows = [
        (
            row.term,
            f"{row.ours:.2f} dB",
            f"{row.peer:.2f} dB",
            f"{row.difference:+.2f} dB",
            code(row.why) if "^" in row.why else row.why,
        )
        for row in module("benchmarks/link_conventions.py").paper_rows()
    ]
    return table(("convention", "microrad as shipped", "theirs", "difference", "why"), rows)
