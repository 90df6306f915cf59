"""Named codes: each against capacity, against its source's own numbers, and in a mission with what is refused."""

import heapq
import math
from statistics import NormalDist

import numpy as np
import pytest
from scipy import integrate, optimize, stats

from link_files import link_file, received_with
from microrad import link
from microrad.core.capacity import Code, entropy
from microrad.core.pulse_capacity import soft_bits
from microrad.core.units import PLANCK_J_S, SPEED_OF_LIGHT_M_S
from microrad.mission.codes import NamedCode, _code, codes, nearest
from microrad.mission.toml import MissionError

KNOWN = {name: code for name, code in codes().items() if code.known}
WITH_PHASES = [name for name, code in KNOWN.items() if code.gap_db is None]
PHOTON_J = PLANCK_J_S * SPEED_OF_LIGHT_M_S / 1.55e-6


def coded(receiver, name, **others):
    """A receiver with a code by its name, at the bit error ratio that its source prints."""
    ratio = codes()[name].ratios[1]
    own = {"code": name, "code_gain": None, "code_rate": None, "bit_error_ratio": ratio}
    return received_with(receiver, **{**own, **others})


def fault_of(folder, *changes):
    with pytest.raises(MissionError) as refused:
        link_file(folder, *changes)
    (fault,) = refused.value.faults
    return fault.key, f"{fault.reason}: {fault.expected}"


def told_two_signs(eb_n0, rate):
    """Bits in the sign of a real symbol in Gaussian noise, soft decisions, of a code's rate and Eb/N0."""
    root = math.sqrt(2.0 * rate * eb_n0)

    def lost(y):
        return stats.norm.pdf(y - root) * np.logaddexp(0.0, -2.0 * y * root) / math.log(2.0)

    return 1.0 - integrate.quad(lost, root - 12.0, root + 12.0, epsabs=1e-13)[0]


# ---- nothing passes the ceiling
@pytest.mark.promise("readme-7", "link-93")
@pytest.mark.parametrize("name", WITH_PHASES)
def test_no_code_needs_less_than_capacity(name):
    code = KNOWN[name]
    ratio = code.ratios[1]
    gain = 10.0 ** (code.net_gain_db(ratio) / 10.0)
    assert gain < Code(code.rate, ratio).phases()
    said = code.rate * (1.0 - entropy(ratio))
    least = optimize.brentq(lambda eb_n0: told_two_signs(eb_n0, code.rate) - said, 0.1, 20.0)
    needed = NormalDist().inv_cdf(ratio) ** 2 / 2.0 / gain
    assert 0.4 < 10.0 * math.log10(needed / least) < 4.5  # 0.7 to 1.2 dB for DVB-S2, 4 dB for a convolution


@pytest.mark.promise("link-93")
@pytest.mark.parametrize("background", ["0 pW", "200 pW"])
def test_pulse_positions_with_their_code_stand_above_capacity(tmp_path, background):
    data = link.of(link_file(tmp_path, coded("counting ppm", "scppm-1-2", background_power=background)).mission)
    rate, built = 300e6, data.receiver
    slot_rate = rate / 0.5 * 16 / 4
    pulse = float(built.required_power_w(rate)) * 0.4 * 16 / PHOTON_J / slot_rate
    floor = (0.4 * built.background_power_w / PHOTON_J + 2000.0) / slot_rate
    said = 0.5 * (1.0 - entropy(1e-5)) * 4
    assert soft_bits(16, pulse * 10**-0.1, floor) == pytest.approx(said, rel=1e-9)  # 1 dB from capacity
    assert soft_bits(16, pulse, floor) > said
    assert float(built.bit_error_ratio_at(built.required_power_w(rate), rate)) == pytest.approx(1e-5, rel=1e-6)


# ---- what the sources print
@pytest.mark.promise("link-93")
def test_the_paths_of_the_convolutional_code_weigh_what_is_published():
    generators, spectrum, start = (0o171, 0o133), {}, 0b1000000
    parity = [sum((g & bits).bit_count() % 2 for g in generators) for bits in range(128)]
    queue = [(parity[start], 1, start >> 1)]  # distance, ones of the information, the six bits that are kept
    while queue:
        distance, ones, state = heapq.heappop(queue)
        if state == 0:
            spectrum[distance] = spectrum.get(distance, 0) + ones
            continue
        for bit in (0, 1):
            register = bit << 6 | state
            if distance + parity[register] <= 16:
                heapq.heappush(queue, (distance + parity[register], ones + bit, register >> 1))
    assert tuple(sorted(spectrum.items())) == KNOWN["ccsds-k7-1-2"].weights


@pytest.mark.promise("link-93")
@pytest.mark.parametrize(("ratio", "eb_n0_db"), [(1e-5, 4.2), (1e-6, 4.8)])
def test_the_convolutional_code_needs_what_its_curves_show(ratio, eb_n0_db):
    uncoded = 10.0 * math.log10(stats.norm.isf(ratio) ** 2 / 2.0)
    assert uncoded - KNOWN["ccsds-k7-1-2"].net_gain_db(ratio) == pytest.approx(eb_n0_db, abs=0.06)


@pytest.mark.promise("link-93")
@pytest.mark.parametrize(
    ("name", "efficiency", "es_n0_db"),
    [("1-4", 0.490243, -2.35), ("1-2", 0.988858, 1.0), ("3-4", 1.487473, 4.03), ("9-10", 1.788612, 6.42)],
)
def test_the_thresholds_of_dvb_are_those_of_its_table(name, efficiency, es_n0_db):
    code = KNOWN[f"dvb-s2-{name}"]
    assert 2.0 * code.rate == pytest.approx(efficiency, abs=1e-9)
    assert code.threshold_db == pytest.approx(es_n0_db - 10.0 * math.log10(efficiency), abs=1e-9)
    ones, _, all_ = name.partition("-")
    # two bits a symbol, 90 symbols of header and 80 bits of another, at most 192 check bits of the outer code
    assert 0.0 < int(ones) / int(all_) - code.rate < 0.007
    assert "Table 13" in code.source
    assert f"{efficiency:g}"[:7] in code.source


@pytest.mark.promise("link-93")
def test_every_code_says_its_source_and_its_rate():
    for name, code in codes().items():
        ones, all_ = name.split("-")[-2:]
        assert code.rate == pytest.approx(int(ones) / int(all_), abs=0.007), name
        assert code.source
        assert code.title
        assert code.known == (code.threshold_db is not None or bool(code.weights) or code.gap_db is not None)
    assert {name for name in codes() if name not in KNOWN} == {
        *("scppm-1-3", "scppm-2-3"),
        *("sda-11-13", "sda-22-29", "sda-2-3", "sda-1-2"),
    }


# ---- in a mission
@pytest.mark.promise("link-93")
@pytest.mark.parametrize("receiver", ["homodyne bpsk", "heterodyne bpsk", "homodyne qpsk"])
@pytest.mark.parametrize("name", WITH_PHASES)
def test_a_named_code_needs_its_threshold(tmp_path, receiver, name):
    file = link_file(
        tmp_path, coded(receiver, name), {"communication.data_rate": "200 Mbit/s"}, no_phase_error(receiver)
    )
    built, code = link.of(file.mission).receiver, KNOWN[name]
    assert built.code_rate == code.rate
    # Eb/N0 is the signal over noise of a bit: 2 q n in one quadrature of homodyne detection, else q n
    per_bit = float(built.photons_per_bit(200e6)) * 0.7 * (2.0 if receiver == "homodyne bpsk" else 1.0)
    needed = NormalDist().inv_cdf(code.ratios[1]) ** 2 / 2.0 / 10.0 ** (code.net_gain_db(code.ratios[1]) / 10.0)
    assert per_bit == pytest.approx(needed, rel=1e-9)
    if code.threshold_db is not None:
        assert 10.0 * math.log10(per_bit) == pytest.approx(code.threshold_db, abs=1e-9)


def no_phase_error(receiver):
    return {"communication.receiver.phase_error": None} if receiver == "heterodyne bpsk" else {}


@pytest.mark.promise("link-93")
def test_the_budget_names_the_code_and_its_source(tmp_path):
    file = link_file(tmp_path, coded("homodyne qpsk", "dvb-s2-1-2"))
    budget = link.communication_budget(link.of(file.mission), file.sources)
    line = budget.totals[-2]
    assert line.basis.startswith("QPSK, homodyne: ")
    assert ", code gain of dvb-s2-1-2 10.26 dB, R = 300 Mbit/s" in line.basis
    assert "; ETSI EN 302 307-1, Table 13, QPSK 1/2: 0.988858 bit per symbol, packet error ratio 1e-7; " in line.source
    assert "DVB-S2, LDPC and BCH, 64800 bits, rate 1/2: Gaussian noise" in line.regime


@pytest.mark.promise("link-93")
@pytest.mark.parametrize("key", ["code_gain", "code_rate"])
def test_a_code_is_said_one_way(tmp_path, key):
    both = coded("homodyne qpsk", "dvb-s2-1-2", **{key: {"code_gain": "3 dB", "code_rate": 0.5}[key]})
    assert fault_of(tmp_path, both) == (
        f"communication.receiver.{key}",
        "stands beside code, which has its own: one of the two removed",
    )
    found, text = fault_of(tmp_path, received_with("homodyne qpsk", **{key: None}))
    assert found == f"communication.receiver.{key}"
    assert text.startswith("is missing, and so is code: ")


@pytest.mark.promise("link-93")
def test_what_no_source_prints_cannot_be_chosen(tmp_path):
    found, text = fault_of(tmp_path, received_with("pin ook", code="sda-11-13", code_gain=None, code_rate=None))
    assert found == "communication.receiver.code"
    assert text.startswith("has no threshold that a source prints (SDA optical communications terminal standard")
    assert "code_gain as measured, with code_rate = 0.8462, in its place" in text


@pytest.mark.promise("link-93")
def test_a_code_is_taken_where_its_source_states_it(tmp_path):
    found, text = fault_of(tmp_path, coded("homodyne qpsk", "dvb-s2-1-2", bit_error_ratio=1e-6))
    assert found == "communication.receiver.bit_error_ratio"
    assert 'is 1e-06, and code = "dvb-s2-1-2" has its threshold printed for another: bit_error_ratio = 1e-07 (' in text
    found, text = fault_of(tmp_path, coded("homodyne qpsk", "ccsds-k7-1-2", bit_error_ratio=1e-3))
    assert "bit_error_ratio at most 1e-05 (CCSDS 131.0-B" in text
    assert link_file(tmp_path, coded("homodyne qpsk", "ccsds-k7-1-2", bit_error_ratio=1e-8))
    found, text = fault_of(tmp_path, coded("preamplified dpsk", "dvb-s2-1-2"))
    assert found == "communication.receiver.code"
    assert "is a code for bpsk and qpsk (ETSI EN 302 307-1, Table 13" in text
    assert "not for dpsk: another code, or code_gain and code_rate in its place" in text


@pytest.mark.promise("link-93")
def test_a_name_that_no_code_has_is_refused_with_the_nearest(tmp_path):
    wrong = coded("homodyne qpsk", "dvb-s2-1-2", code="dvbs2-1/2")
    found, text = fault_of(tmp_path, wrong)
    assert found == "communication.receiver.code"
    assert text.startswith('is "dvbs2-1/2", which is no code that is known here: code = "dvb-s2-')


WRITTEN = {"title": "t", "modulations": ["ook", "ppm"], "rate": "3/7", "source": "s"}


@pytest.mark.parametrize(
    ("table", "ratios", "threshold", "weights", "gap", "known"),
    [
        # Es/N0 of a symbol with 2 * 3 / 7 bits of information
        (
            {"bit_error_ratio_up_to": 1e-6, "threshold_symbol": "4.5 dB"},
            *((0.0, 1e-6), 4.5 - 10.0 * math.log10(6.0 / 7.0), (), None, True),
        ),
        (
            {"weights": {"5": 3, "7": 2}, "bit_error_ratio": 1e-4, "bit_error_ratio_up_to": 1e-3},
            *((1e-4, 1e-3), None, ((5, 3), (7, 2)), None, True),
        ),
        ({"gap": "1.5 dB", "bit_error_ratio": 1e-4}, (1e-4, 1e-4), None, (), 1.5, True),
        ({"threshold": "2.25 dB", "bit_error_ratio": 3e-4}, (3e-4, 3e-4), 2.25, (), None, True),
        ({"threshold": "unknown", "bit_error_ratio_up_to": 0.01}, (0.0, 0.01), None, (), None, False),
    ],
)
def test_a_code_is_read_of_each_way_that_a_source_prints(table, ratios, threshold, weights, gap, known):
    found = _code("x", WRITTEN | table)
    assert (found.name, found.title, found.modulations, found.source) == ("x", "t", ("ook", "ppm"), "s")
    assert found.rate == 3 / 7
    assert (found.ratios, found.weights, found.gap_db, found.known) == (ratios, weights, gap, known)
    assert found.threshold_db == (None if threshold is None else pytest.approx(threshold, rel=1e-12))
    assert math.isnan(_code("x", WRITTEN).ratios[1])


@pytest.mark.parametrize(
    ("name", "ratio", "gain_db"),
    [
        ("ccsds-k7-1-2", 1e-3, 4.07656),
        ("ccsds-k7-1-2", 2.5e-5, 5.25768),
        ("ccsds-k7-1-2", 4e-7, 5.83197),
        ("dvb-s2-1-4", 2.5e-7, 10.2688),
        ("dvb-s2-9-10", 1e-7, 7.41382),
    ],
)
def test_the_gain_of_a_code_is_that_of_its_ratio(name, ratio, gain_db):
    assert codes()[name].net_gain_db(ratio) == pytest.approx(gain_db, rel=1e-5)


def test_a_code_says_what_its_threshold_holds_for():
    said = [codes()[name].regime for name in ("ccsds-k7-1-2", "dvb-s2-3-4", "scppm-1-2")]
    assert said == [
        "convolutional code K = 7, rate 1/2, soft Viterbi decoding: union bound over its paths, Gaussian noise, no "
        "quantisation",
        "DVB-S2, LDPC and BCH, 64800 bits, rate 3/4: Gaussian noise, no loss in synchronisation",
        "serially concatenated pulse-position modulation, rate 1/2: 1 dB from capacity, in one link, is taken for any "
        "order and background",
    ]


@pytest.mark.parametrize(
    ("ratio", "least", "holds"),
    [(2e-4, 1e-4, True), (1e-4, 1e-4, True), (9.9e-5, 1e-4, False), (1.01e-3, 1e-4, False), (9e-5, 0.0, True)],
)
def test_a_threshold_holds_between_two_ratios(ratio, least, holds):
    code = NamedCode("x", "t", (), 0.5, (least, 1e-3), 1.0, (), None, "")
    assert code.holds_at(ratio) is holds
    assert code.holds_at(1e-3 * (1.0 + 5e-10)) and code.holds_at(least * (1.0 - 5e-10))


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("dvb-s2-7-8", 'code = "dvb-s2-8-9" or code = "dvb-s2-5-6" or code = "dvb-s2-4-5"'),
        ("SCPPM", 'code = "scppm-1-2"'),
        ("ccsds-k9-1-2", 'code = "ccsds-k7-1-2" or code = "dvb-s2-1-2"'),
    ],
)
def test_of_a_name_like_some_codes_those_that_are_known_are_told(name, near):
    assert nearest(name) == near


# ------------------------------------------------------------------------------------------------- each code by itself
EACH_CODE = """
ccsds-k7-1-2 0.5 0 1e-05 5.4274138
dvb-s2-1-4 0.2451215 1e-07 1e-07 0.74588599 10.562774
dvb-s2-1-3 0.328224 1e-07 1e-07 0.5879967 10.720664
dvb-s2-2-5 0.394706 1e-07 1e-07 0.72696276 10.581698
dvb-s2-1-2 0.494429 1e-07 1e-07 1.0486607 10.26
dvb-s2-3-5 0.594152 1e-07 1e-07 1.4807244 9.827936
dvb-s2-2-3 0.6611265 1e-07 1e-07 1.8868544 9.421806
dvb-s2-3-4 0.7437365 1e-07 1e-07 2.3055091 9.0031513
dvb-s2-4-5 0.793598 1e-07 1e-07 2.6736944 8.634966
dvb-s2-5-6 0.8273315 1e-07 1e-07 2.9929044 8.3157559
dvb-s2-8-9 0.8832255 1e-07 1e-07 3.7289841 7.5796763
dvb-s2-9-10 0.894306 1e-07 1e-07 3.8948386 7.4138218
scppm-1-2 0.5 1e-05 1e-05 1
scppm-1-3 0.33333333 0 nan
scppm-2-3 0.66666667 0 nan
sda-11-13 0.84615385 0 nan
sda-22-29 0.75862069 0 nan
sda-2-3 0.66666667 0 nan
sda-1-2 0.5 0 nan
"""


@pytest.mark.parametrize("line", EACH_CODE.strip().split("\n"), ids=lambda line: line.split()[0])
def test_each_code_has_its_own_numbers(line):
    name, *numbers = line.split()
    code = codes()[name]
    gains = [] if code.gap_db is not None or not code.known else [code.net_gain_db(code.ratios[1])]
    found = [code.rate, *code.ratios, *(x for x in (code.threshold_db, code.gap_db) if x is not None), *gains]
    assert found == pytest.approx([float(x) for x in numbers], rel=1e-5, nan_ok=True)
    assert code.known == (len(found) > 3)
    if code.known:
        assert code.holds_at(code.ratios[1]) and not code.holds_at(1.001 * code.ratios[1])
        assert code.holds_at(code.ratios[0]) and not (code.ratios[0] and code.holds_at(0.999 * code.ratios[0]))


@pytest.mark.parametrize(("name", "ends"), [
    ("ccsds-k7-1-2", ": union bound over its paths, Gaussian noise, no quantisation"),
    ("dvb-s2-2-3", ": Gaussian noise, no loss in synchronisation"),
    ("scppm-1-2", " dB from capacity, in one link, is taken for any order and background"),
])  # fmt: skip
def test_a_code_says_at_its_end_what_its_threshold_holds_for(name, ends):
    code = codes()[name]
    assert code.regime.startswith(f"{code.title}: ") and code.regime.endswith(ends)


@pytest.mark.parametrize(("name", "near"), [
    ("DVB-S2-1-2", 'code = "dvb-s2-1-2"'), ("ccsds-k7", 'code = "ccsds-k7-1-2"'), ("scppm", 'code = "scppm-'),
    ("turbo", 'code = "ccsds-k7-1-2" or code = "dvb-s2-1-4" or code = "dvb-s2-1-3" or '),
])  # fmt: skip
def test_codes_of_names_nearest_to_another_are_offered(name, near):
    assert nearest(name).startswith(near)
