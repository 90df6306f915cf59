"""What extinction, a phase error and interference between symbols cost: lines that leave the margin as it is."""

import math

import numpy as np
import pytest

import budgets
from link_files import RECEIVERS, link_file, received_with
from microrad import link
from microrad.core.capacity import untold_of_a_sign
from microrad.core.units import format_quantity
from microrad.link.budget.assembly import at_capacity, rate_at_power
from microrad.link.budget.receiver_lines import EXTINCTION_PENALTY, INTER_SYMBOL_LOSS, LEFT_AT_ZERO, PHASE_PENALTY

RATE, ERROR = 300e6, 1e-5
ON_OFF = [name for name, table in RECEIVERS.items() if table["modulation"] == "ook"]
COHERENT = [name for name, table in RECEIVERS.items() if table["modulation"] in ("bpsk", "qpsk")]


def budget_of(folder, *changes):
    file = link_file(folder, *changes)
    return budgets.communication(file.mission, file.sources, ERROR, RATE)


def line_of(budget, name):
    return next(line for line in (*budget.lines, *budget.totals) if line.name == name)


def ideal(name):
    """The same receiver without what a penalty counts: spaces that are dark to 1e-12 of a mark, or a right phase."""
    return received_with(name, **({"extinction_ratio": "120 dB"} if name in ON_OFF else {"phase_error": None}))


@pytest.mark.promise("link-94")
@pytest.mark.parametrize("name", [*ON_OFF, "heterodyne bpsk", "heterodyne qpsk"])
def test_a_penalty_is_a_part_of_the_required_power_and_leaves_the_margin(tmp_path, name):
    budget, best = budget_of(tmp_path, received_with(name)), budget_of(tmp_path, ideal(name))
    line = line_of(budget, EXTINCTION_PENALTY if name in ON_OFF else PHASE_PENALTY)
    without = 10.0 * math.log10(best.required_power_w * 1e3)
    needed = 10.0 * math.log10(budget.required_power_w * 1e3)
    assert line.value == pytest.approx(needed - without, abs=1e-6)
    assert line.value > 0.01
    assert line not in budget.lines
    assert f"a part of the required power below, which would be {without:.2f} dBm if " in line.basis
    assert line_of(budget, "Required power").value == pytest.approx(needed, abs=1e-9)
    assert budget.margin_db == pytest.approx(10.0 * math.log10(budget.received_power_w * 1e3) - needed, abs=1e-9)
    data = link.of(link_file(tmp_path, received_with(name)).mission)
    assert budget.margin_db == pytest.approx(float(link.margin_map(data, RATE, ERROR)[0, 0]), abs=1e-9)


@pytest.mark.promise("link-94")
@pytest.mark.parametrize("name", ["pin ook", "counting ook"])
def test_the_extinction_penalty_of_ten_decibels_is_that_of_textbooks(tmp_path, name):
    # thermal noise: (r + 1) / (r - 1) (Agrawal); counting without background asks for much more
    quiet = {"thermal_noise": "100 pA/sqrt(Hz)"} if name == "pin ook" else {"background_power": "0 pW"}
    budget = budget_of(tmp_path, received_with(name, extinction_ratio="10 dB", code_gain="0 dB", **quiet))
    found = line_of(budget, EXTINCTION_PENALTY).value
    if name == "pin ook":
        assert found == pytest.approx(10.0 * math.log10(11.0 / 9.0), abs=0.01)
    else:
        assert found > 2.0


@pytest.mark.promise("link-94")
@pytest.mark.parametrize("name", COHERENT)
def test_a_phase_error_that_is_not_given_is_said_to_be_none(tmp_path, name):
    budget = budget_of(
        tmp_path, received_with(name, phase_error=None) if "phase_error" in RECEIVERS[name] else received_with(name)
    )
    line = line_of(budget, PHASE_PENALTY)
    assert (line.value, line.source, line.warning) == (0.0, "not given", LEFT_AT_ZERO)
    assert PHASE_PENALTY in budget.at_zero
    assert any(PHASE_PENALTY in warning and LEFT_AT_ZERO in warning for warning in budget.warnings)


@pytest.mark.promise("link-94")
@pytest.mark.parametrize("name", RECEIVERS)
def test_interference_between_symbols_is_a_loss_of_its_own(tmp_path, name):
    plain, lossy = (
        budget_of(tmp_path, received_with(name, **given)) for given in ({}, {"inter_symbol_loss": "0.7 dB"})
    )
    none, line = line_of(plain, INTER_SYMBOL_LOSS), line_of(lossy, INTER_SYMBOL_LOSS)
    assert (none.value, none.source, none.warning) == (0.0, "not given", LEFT_AT_ZERO)
    assert (line.value, line.warning) == (-0.7, "")
    assert lossy.margin_db == pytest.approx(plain.margin_db - 0.7, abs=1e-9)
    assert lossy.required_power_w == pytest.approx(plain.required_power_w, rel=1e-12)
    data = link.of(link_file(tmp_path, received_with(name, inter_symbol_loss="0.7 dB")).mission)
    assert lossy.margin_db == pytest.approx(float(link.margin_map(data, RATE, ERROR)[0, 0]), abs=1e-9)


def test_a_measured_sensitivity_has_none_of_these_lines(tmp_path):
    budget = budget_of(tmp_path)
    names = {line.name for line in (*budget.lines, *budget.totals)}
    assert not names & {INTER_SYMBOL_LOSS, EXTINCTION_PENALTY, PHASE_PENALTY}


# ---- capacity
@pytest.mark.promise("link-95")
@pytest.mark.parametrize("name", RECEIVERS)
def test_a_rate_above_capacity_is_said_with_the_highest_below_it(tmp_path, name):
    strong = budget_of(tmp_path, received_with(name))
    assert "above capacity" not in line_of(strong, "Required power").warning
    far = {"communication.implementation_loss": f"{strong.margin_db + 25.0:.3f} dB"}
    weak = budget_of(tmp_path, received_with(name), far)
    said = line_of(weak, "Required power").warning
    assert said.startswith("the data rate is above capacity: no code of this rate does with less than ")
    data = link.of(link_file(tmp_path, received_with(name), far).mission)
    assert data.receiver is not None
    highest = rate_at_power(at_capacity(data, RATE), 10.0 * math.log10(weak.received_power_w * 1e3))
    assert highest is not None
    assert said.endswith(f"of the received power it makes at most {format_quantity(highest, 'bit/s')}")
    assert any(said in warning for warning in weak.warnings)


@pytest.mark.promise("link-95")
@pytest.mark.parametrize("name", ["heterodyne qpsk", "counting ppm"])
def test_the_highest_rate_below_capacity_is_one_at_which_the_best_code_needs_all_light(tmp_path, name):
    data = link.of(link_file(tmp_path, received_with(name)).mission)
    best = at_capacity(data, RATE)
    least = float(best.required_power_w(RATE))
    assert least < float(data.receiver.required_power_w(RATE))
    assert rate_at_power(best, 10.0 * math.log10(least * 1e3)) == pytest.approx(RATE, rel=1e-6)
    assert rate_at_power(best, -400.0) is None
    assert rate_at_power(best, 60.0) == best.highest_data_rate_bit_s
    if name == "heterodyne qpsk":  # without its phase error, two signs in Gaussian noise
        photons = least / data.receiver._photon_j / RATE * 0.7
        unsaid = 1.0 - 0.8 * (1.0 - float(-np.dot([1e-6, 1.0 - 1e-6], np.log2([1e-6, 1.0 - 1e-6]))))
        assert untold_of_a_sign(photons * 2.0 * 0.8) == pytest.approx(unsaid, rel=1e-6)


@pytest.mark.promise("link-95")
def test_a_gain_below_the_bound_of_the_file_but_beyond_capacity_is_said(tmp_path):
    # in background the file's bound is up to 1.3 dB wide of what pulse positions can gain
    light = {"background_power": "2 nW", "code_rate": 0.5}
    table = link_file(tmp_path, received_with("counting ppm", **light)).mission.communication
    most = 10.0 * math.log10(table.receiver.most_code_gain(table.data_rate_bit_s, table.wavelength_m))
    said = line_of(
        budget_of(tmp_path, received_with("counting ppm", **light, code_gain=f"{most - 0.05:.2f} dB")), "Required power"
    ).warning
    assert "that capacity asks for: no code of this rate does with it" in said
    below = received_with("counting ppm", **light, code_gain=f"{most - 1.5:.2f} dB")
    assert "no code of this rate does with it" not in line_of(budget_of(tmp_path, below), "Required power").warning


@pytest.mark.parametrize("given", ["0 rad", "0 deg"])
@pytest.mark.parametrize("name", COHERENT)
def test_a_phase_error_that_is_given_as_zero_is_said_to_be_left_at_zero(tmp_path, name, given):
    budget = budget_of(tmp_path, received_with(name, phase_error=given))
    line = line_of(budget, PHASE_PENALTY)
    assert (line.value, line.basis, line.warning) == (0.0, "as given", "left at 0 dB")
    assert line.source != "not given"
    assert PHASE_PENALTY in budget.at_zero
    assert any(PHASE_PENALTY in warning and "left at 0 dB" in warning for warning in budget.warnings)
    assert budget.margin_db == budget_of(tmp_path, ideal(name)).margin_db
