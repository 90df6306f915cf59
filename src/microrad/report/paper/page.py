"""The paper's figures 1 to 8 and tables 1 and 2 beside this run: which figure of ours stands for each, what differs."""

import re
from collections import Counter
from collections.abc import Sequence

from microrad.core.units import format_quantity
from microrad.mission.file import changed_from_shipped
from microrad.report.page.templates import drawing
from microrad.report.paper import diagrams
from microrad.report.plotting.figure import Figure
from microrad.report.quantities import quantity
from microrad.report.tables import Cell, Table
from microrad.report.view import Block, Drawing, Soft, View, slug, told
from microrad.study.study import Study
from microrad.study.verdict import Claim

# Table 1 of the paper: year, LEO satellite, its mass, rate in Mbit/s, GEO satellite
PROJECTS = (
    ("2001", "SPOT-4", "2550 kg", "50", "ARTEMIS"),
    ("2005", "OICETS", "570 kg", "50", "ARTEMIS"),
    ("2017", "SENTINEL 1A", "≈ 2300 kg", "1800", "EDRS-A"),
)
_FIGURES = {
    "Fig. 2": ("fig2-margin-map",),
    "Fig. 4": ("fig4-chirp",),
    "Fig. 5": ("fig5-bench-loops", "fig5-hysteresis-loops"),
    "Fig. 6": ("fig6-pid",),
    "Fig. 8": ("fig8-inverse",),
}
_TITLES = {
    "Fig. 1": "Fig. 1  Open-loop pointing: the relay and its sequence",
    "Fig. 2": "Fig. 2  Link margin",
    "Fig. 3": "Fig. 3  Experiment for the mirror model (virtual bench)",
    "Fig. 4": "Fig. 4  Identified linear dynamics",
    "Fig. 5": "Fig. 5  Rate-dependent hysteresis",
    "Fig. 6": "Fig. 6  PID with and without hysteresis",
    "Fig. 7": "Fig. 7  Feedforward and feedback combined",
    "Fig. 8": "Fig. 8  PID against PID + inverse",
}
_NOT_PLAYED = "Not drawn: the mission's mirror is not of the paper's kind, Eq. 2 and Eq. 3."


def paper_view(study: Study, figures: Sequence[Figure], *first: View) -> View:
    """The paper's claims, figures and tables beside this run; figures of ours that stand for none of them come last.

    Args:
        study: a run of a whole mission.
        figures: those of the paper's cases and of its bench.
        first: views that stand behind the claims.
    """
    by_name = {figure.name: figure for figure in figures}
    taken = {name for names in _FIGURES.values() for name in names}
    said = differs(study, played="fig4-chirp" in by_name)
    ours = {
        number: told(
            *(by_name[name] for name in names if name in by_name),
            Soft(f"{number}, what differs from the paper: {said[number]}"),
        )
        for number, names in _FIGURES.items()
    }
    drawn = {
        "Fig. 1": _sketch("Fig. 1", "relay", diagrams.relay(study), said),
        "Fig. 3": _sketch("Fig. 3", "bench", diagrams.setup(), said),
        "Fig. 7": _sketch("Fig. 7", "control", diagrams.control(study), said),
    }
    blocks = sorted((ours | drawn).items())
    others = [figure for figure in figures if figure.name not in taken]
    return View(
        "The paper's figures and tables",
        told(
            'SPIE 11852, 118523B, as computed or drawn here. Nothing is copied from it. "Virtual bench" stands where '
            "the paper shows a measurement.",
            claims_view(study),
            *first,
            View(
                "Table 1  Past LEO–GEO laser links, and this mission", [projects_table(study)], "table-1", folded=True
            ),
            View(
                "Table 2  Link budgets, the paper's inputs and this mission's",
                links_tables(study),
                "table-2",
                folded=True,
            ),
            *(
                View(_TITLES[number], told(*found, _claims_of(study, number)), f"paper-{slug(number)}", folded=True)
                for number, found in blocks
            ),
            *(View(figure.title, [figure], folded=True) for figure in others),
        ),
        "paper",
    )


def _sketch(number: str, name: str, values: object, said: dict[str, str]) -> tuple[Block, ...]:
    return (Drawing(slug(number), _TITLES[number], said[number], drawing("paper/diagrams.html", name, values)),)


def claims_view(study: Study) -> View:
    """Each printed claim of the paper, what this run has instead, and whether they agree."""
    counts = ", ".join(f"{count} {agrees}" for agrees, count in Counter(c.agrees for c in study.claims).most_common())
    table = _claims_table(study.claims, folded=f"{len(study.claims)} claims; whether they agree: {counts}")
    changed = "; ".join(
        f"{key} is {value}, there {was}" for key, value, was in changed_from_shipped(study.file.sources)
    )
    return View(
        "The paper's claims against this run",
        told(
            "Claims on its links are judged on the paper's own numbers, whatever this mission has (microrad init "
            "--preset paper writes them). The others are judged on the mirror, the loop and the orbits of this "
            "mission.",
            table,
            changed and f"This mission is not the paper's: {changed}.",
            Soft('"inferred": one of our inputs was chosen from the claim itself, so that agreeing proves nothing.'),
        ),
        "claims",
    )


def _claims_of(study: Study, figure: str) -> Table | None:
    """The claims that the paper makes of one of its figures, such as "Fig. 8"; None where it makes none."""
    number = figure.removeprefix("Fig. ")
    found = [c for c in study.claims if number in re.findall(r"\d+", c.where.partition("Fig.")[2])]
    return _claims_table(found) if found else None


def _claims_table(claims: Sequence[Claim], folded: str = "") -> Table:
    rows = [(c.where, c.claim, c.ours, Cell("", c.agrees), c.why) for c in claims]
    return Table("", ("where", "claim", "this run", "agrees", "why"), rows, (0, 1, 2, 3, 4), cards=True, folded=folded)


def differs(study: Study, *, played: bool) -> dict[str, str]:
    """What is not as in the paper, by figure or table.

    Args:
        study: a run of a whole mission.
        played: whether the virtual bench has played the records of Fig. 4 and 5.
    """
    m = study.file.mission
    c = m.conventions
    return {
        "Fig. 1": "The paper draws the three error sources without numbers but for the 300 µrad of body pointing; the "
        "other two are inputs of this mission. The bars are half widths.",
        "Fig. 2": f"The paper prints neither the receiver's sensitivity nor its reading of pointing loss and Strehl; "
        f"here {c.pointing_loss} pointing loss, Strehl as {c.strehl}, the others as a band.",
        "Fig. 3": "The paper's bench is hardware: a NI USB-6343 card, LabVIEW, a Core Tomorrow mirror with its own "
        "controller. Here each block is a model.",
        "Fig. 4": "The paper plots a measured record, which it does not publish, against its model of five poles and "
        "two zeros; here the record is played by Eq. 2 as printed, and the zeros are left free."
        if played
        else _NOT_PLAYED,
        "Fig. 5": "The paper plots measured loops against its model; here the records of the first figure are played "
        "by Eq. 3 as printed, so that its model holds by construction, and the second shows the mission's model alone."
        if played
        else "The paper plots measured loops against its model; here the mission's model alone.",
        "Fig. 6": "The paper prints no gains, no control rate and no way of joining Eq. 2 and Eq. 3; those of this run "
        "are under Assumptions.",
        "Fig. 7": "As in the paper; the feedforward is given the reference and its rate, so that h is that of an "
        "undisturbed mirror.",
        "Fig. 8": "As Fig. 6. Eq. 4 is not made causal in the paper; here the rate is taken from the reference.",
    }


def projects_table(study: Study) -> Table:
    """Table 1 of the paper, and this mission below it."""
    m = study.file.mission
    own = ("", f"this mission: {m.name}", "", f"{m.communication.data_rate_bit_s * 1e-6:g}", "")
    headings = ("year", "LEO satellite", "mass", "rate (Mbit/s)", "GEO satellite")
    return Table("", headings, [*PROJECTS, own], (0, 1, 4), totals=1)


def links_tables(study: Study) -> tuple[Table, Soft]:
    """Table 2 of the paper: item, and for beacon and communication the paper's value and this mission's."""
    m = study.file.mission
    b, c, t = study.file.mission.beacon, m.communication, m.terminals
    assert b is not None  # a whole mission has one

    def both(beacon: float, communication: float, unit: str) -> tuple[str, str]:
        return format_quantity(beacon, unit), format_quantity(communication, unit)

    strehl = "dB" if m.conventions.strehl == "decibel" else "as a ratio"
    power, wavelength = both(b.transmit_power_w, c.transmit_power_w, "W"), both(b.wavelength_m, c.wavelength_m, "m")
    error, distance = both(b.pointing_error_rad, c.pointing_error_rad, "rad"), both(m.range_m(b), m.range_m(c), "m")
    leo, geo = (format_quantity(a, "m") for a in (t.leo_aperture_m, t.geo_aperture_m))
    margins = quantity(study.beacon.margin_db, "dB"), quantity(study.static.margin_db, "dB")
    rows = [
        ("Transmit power", "4 W", power[0], "5 W", power[1]),
        ("Wavelength", "1.55 µm", wavelength[0], "1.55 µm", wavelength[1]),
        ("LEO transmit aperture", "5 cm", leo, "5 cm", leo),
        ("Strehl ratio", "0.4 dB", f"{b.strehl:g} {strehl}", "0.4 dB", f"{c.strehl:g} {strehl}"),
        ("Pointing accuracy", "300 µrad", error[0], "10 µrad", error[1]),
        ("Distance", "44 000 km", distance[0], "42 000 km", distance[1]),
        ("GEO receive aperture", "15 cm", geo, "15 cm", geo),
        ("Margin", "+", margins[0], "+", margins[1]),
    ]
    groups = (("", 1), ("Beacon", 2), ("Communication", 2))
    note = (
        "The paper prints the sign of both margins and no number: the sensitivities of both receivers are assumptions "
        "here. Line by line the budgets stand above."
    )
    return Table("", ("item", *("paper", "here") * 2), rows, groups=groups, totals=1), Soft(note)
