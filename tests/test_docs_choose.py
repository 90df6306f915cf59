"""The page on how to choose: its figures are those of the pages that it names, receivers have no more."""

import re
from dataclasses import fields

import pytest

from microrad.link import receivers
from places import ROOT
from site_pages import choose


def after(text, sentence):
    """The rows of the table behind a sentence of a page, without its headings."""
    lines = iter(text.partition(sentence)[2].splitlines())
    rows = []
    for line in lines:
        if line.startswith("|"):
            rows.append([cell.strip() for cell in line.strip("|").split("|")])
        elif rows:
            break
    return rows[2:]


@pytest.mark.promise("choose-1", "choose-4", "choose-5", "choose-8", "choose-9", "choose-12")
@pytest.mark.parametrize(
    ("sentence", "page", "count"),
    [
        ("that is none of the models ([Identify](identify.md))", "identify.md", 7),
        ("errors on held-out records in µm", "hysteretic-stiffness.md", 3),
        ("all with a modulus margin of 0.5 ([The fine-pointing loop](pointing.md))", "pointing.md", 4),
        ("(the CubeSpec mirror, same page), rms in µrad", "pointing.md", 5),
        ("where each model ends ([Link budgets](link.md))", "link.md", 6),
    ],
)
def test_the_figures_of_a_choice_stand_in_a_row_of_the_page_that_it_names(sentence, page, count):
    own, named = choose.pages()["choose.md"], (ROOT / "docs" / page).read_text(encoding="utf-8")
    rows = after(own, sentence)
    assert len(rows) == count
    there = [line.replace("*", "") for line in named.splitlines() if line.startswith("|")]
    for _, *cells in rows:
        wanted = r"\| *" + r" *\| *".join(map(re.escape, cells))
        assert [line for line in there if re.search(wanted, line)], f"{page} has no row with {cells}"


@pytest.mark.promise("choose-4", "choose-8", "choose-9")
def test_the_named_pages_measured_what_the_choices_say():
    def page(name):
        return " ".join((ROOT / "docs" / name).read_text(encoding="utf-8").split())

    assert "on the virtual bench, whose mirror is none of the models" in page("identify.md")
    assert "rms in per cent of peak-to-peak; held out are" in page("identify.md")
    assert "Residual rms of one axis in µrad, each tuned with a modulus margin of 0.5:" in page("pointing.md")
    assert "Rms in µrad, all with a modulus margin of 0.5 of the whole:" in page("pointing.md")
    assert "eighteen modes, which turn both axes at once" in page("pointing.md")


@pytest.mark.promise("choose-13")
def test_no_receiver_has_turbulence_neighbouring_symbols_clock_or_pointing():
    """All that a receiver's answer can depend on: its own fields, the power and the rate."""
    of_detector = {"quantum_efficiency", "detection_efficiency", "dark_current_a", "dark_count_rate_hz", "gain"}
    of_detector |= {"ionisation_ratio", "thermal_noise_a_sqrt_hz", "noise_figure_db", "gain_db", "polarisations"}
    of_signal = {"wavelength_m", "bit_error_ratio", "bandwidth_hz", "optical_bandwidth_hz", "extinction_ratio", "order"}
    of_signal |= {"phase_error_rad"}
    of_rest = {"code_gain_db", "code_gap_db", "code_rate", "background_power_w", "background_photons_per_mode"}
    kinds = receivers.Receiver.__subclasses__()
    every = {
        each.name for kind in kinds + [k for kind in kinds for k in kind.__subclasses__()] for each in fields(kind)
    }
    assert {"noise_figure_db", "quantum_efficiency", "extinction_ratio"} <= every
    assert every <= of_detector | of_signal | of_rest
