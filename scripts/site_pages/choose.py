"""The figures of the page on how to choose, taken from the pages that record them."""

from collections.abc import Iterable, Iterator

from site_pages.cases import ROOT, recorded
from site_pages.tables import table


def pages() -> dict[str, str]:
    """The page docs/choose.md with its tables, each where a comment names it."""
    models = (
        ("prandtl_ishlinskii_rate_creep", "`prandtl_ishlinskii_rate_creep` (chosen)"),
        ("prandtl_ishlinskii_creep", "`prandtl_ishlinskii_creep`"),
        ("prandtl_ishlinskii_joint", "`prandtl_ishlinskii_joint`"),
        ("bouc_wen_joint", "`bouc_wen_joint`"),
        ("bouc_wen, the paper's model", "`bouc_wen`, the paper's model"),
        ("linear", "`linear`"),
        ("prandtl_ishlinskii, static", "`prandtl_ishlinskii`"),
    )
    plants = (
        "plain, as shipped but for the mirror's linear part",
        "resonance at 300 Hz, damping 0.02",
        "resonance at 900 Hz, damping 0.02",
        "wheel lines of 2 and 1 µrad rms at 80 and 160 Hz",
    )
    several = ("PI", "PI + notch", "disturbance observer", "LQG", "H-infinity")
    receivers = (
        "ppm, photon-counting",
        "bpsk, homodyne",
        "ook, photon-counting",
        "ook, pin or apd",
        "dpsk, preamplified",
        "ook, preamplified",
    )
    stiffness = {
        "hysteretic stiffness, mean of six folds": "**mean of six**",
        "best published model, neural, on other records": "best published model, neural, on other records",
        "no linear model of one amplitude could follow": "what no linear model of one amplitude could follow, rms",
    }
    rows = {
        "models": table(("model", "fitted", "held out"), _rows("identify.md", models, 2, "held out")),
        "stiffness": table(
            ("model", "100 mV", "200 mV", "300 mV"),
            [
                (name, *(cell.strip("*") for cell in cells))
                for name, *cells in _rows("hysteretic-stiffness.md", stiffness.items(), 3)
            ],
        ),
        "plants": table(
            ("plant", "optimum", "PI", "PI + notch", "damping", "observer", "LQG", "PI + peaks"),
            _rows("pointing.md", ((each, each) for each in plants), 7),
        ),
        "axes": table(
            ("controller", "linear, radial", "simulated with hysteresis, x / y", "radial at 99.7 %", "disk margin"),
            _rows("pointing.md", ((each, each) for each in several), 4, "simulated with hysteresis"),
        ),
        "receivers": table(
            ("modulation, detector", "model", "photons per bit", "limits"),
            _rows("link.md", ((each, each) for each in receivers), 3),
        ),
    }
    text = (ROOT / "docs" / "choose.md").read_text(encoding="utf-8")
    for name, found in rows.items():
        text = text.replace(f"<!-- {name} -->", found)
    return {"choose.md": text}


def _rows(page: str, names: Iterable[tuple[str, str]], columns: int, heading: str = "") -> Iterator[tuple[str, ...]]:
    for shown, first_cell in names:
        yield (shown, *recorded(page, first_cell, heading)[:columns])
