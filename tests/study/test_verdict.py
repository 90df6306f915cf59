"""The verdict line by line: what is held against the paper's claims on both sides of each limit, and a loop's cause."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from made_tables import one_line
from microrad import link
from microrad.link.requirement import Requirement, derived_from
from microrad.loop.paper_cases import PID, PID_WITH_INVERSE
from microrad.mirror import Variant
from microrad.study import paper, verdict
from microrad.study.alternatives import Reading

URAD = 1e-6


# ---------------------------------------------------------------------------------------------------- requirements
@pytest.mark.parametrize(
    ("unit", "required", "actual", "margin", "met"),
    [
        ("dB", 3.0, 3.0, 0.0, True),
        ("dB", 0.0, 0.0, -0.9e-9, True),  # a decibel at least is what rounding is a share of
        ("dB", 0.0, 0.0, -1.1e-9, False),
        ("dB", 3.0, 2.0, -2.9e-9, True),
        ("dB", -5.0, -7.0, -6.9e-9, True),
        ("dB", -5.0, -7.0, -7.1e-9, False),
        ("rad", 1e-5, 2e-5, -1.9e-14, True),
        ("rad", 1e-5, 2e-5, -2.1e-14, False),
        ("rad", 3e-5, 2e-5, -2.9e-14, True),
        ("rad", 0.0, 0.0, 0.0, True),
        ("rad", 1e-5, 1e-5, -1e-9, False),
    ],
)
def test_a_requirement_is_met_but_for_what_rounding_takes_of_the_larger_number(unit, required, actual, margin, met):
    line = Requirement("communication", "", unit, required, actual, margin, "the loss")
    assert line.met is met
    assert line.mark == ("PASS" if met else "FAIL")
    chosen = Requirement("communication", "", unit, required, actual, margin, "the loss", derived=("a key",))
    assert chosen.mark == ("derived" if met else "FAIL")
    unsure = Requirement("communication", "", unit, required, actual, margin, "the loss", unknown="the mirror")
    assert (unsure.met, unsure.mark, unsure.because, line.because) == (False, "FAIL", "the mirror", "the loss")


def test_derived_inputs_are_those_of_the_keys_asked_for_that_nobody_has_changed_since():
    def source(kind, value, comment, was=""):
        return SimpleNamespace(kind=kind, value=value, comment=comment, was=was)

    sources = {
        "pointing.lines.body.error": source("derived", '"24 urad"', "derived: so that 780 µrad: follow"),
        "pointing.confidence": source("paper", "0.997", "paper: Table 2"),
        "beacon.divergence": source("derived", '"780 urad"', "derived: from the cone", '"1 mrad"'),
        "beacon.distance": source("derived", "1", "derived: from the orbit"),
        "answer.distance": source("derived", "2", "derived: from the orbit"),
    }
    assert derived_from(sources, "pointing.", "beacon.") == (
        "pointing.lines.body.error = 24 urad (so that 780 µrad: follow)",
        "beacon.distance = 1 (from the orbit)",
    )
    assert derived_from(sources, "communication.") == ()


def test_a_reading_closes_from_no_margin_on_and_meets_both_requirements_or_none():
    wanted = SimpleNamespace(pointing_error_rad=10 * URAD, margin_db=3.0)
    for residual, margin, closes, meets in (
        (10 * URAD, 3.0, True, True),
        (10.01 * URAD, 3.0, True, False),
        (10 * URAD, 2.99, True, False),
        (10 * URAD, 0.0, True, False),
        (10 * URAD, -0.01, False, False),
        (math.nan, math.nan, False, False),
    ):
        reading = Reading("a key", "so", "otherwise", residual, margin)
        assert (reading.closes, reading.meets(wanted)) == (closes, meets)


def lines(*values):
    return [SimpleNamespace(name=name, value=value) for name, value in values]


def test_the_stroke_is_judged_on_the_axis_with_the_least_margin_and_names_its_largest_line():
    axes = [
        SimpleNamespace(label="x", margin_rad=3e-6, needed_rad=7e-6, available_rad=10e-6, lines=lines(("body", 7e-6))),
        SimpleNamespace(
            label="y",
            margin_rad=-1e-6,
            needed_rad=11e-6,
            available_rad=10e-6,
            lines=lines(("body", 5e-6), ("sine", 6e-6)),
        ),
    ]
    derived = SimpleNamespace(kind="derived", value="1", comment="derived: the cone", was="")
    sources = {"pointing.body": derived, "fine_pointing.body": derived}
    line = verdict._stroke(sources, SimpleNamespace(scene=SimpleNamespace(own_stroke=axes)))
    assert (line.subject, line.unit, line.name) == ("stroke", "rad", "stroke for the worst case (y)")
    assert (line.required, line.actual, line.margin, line.limited_by) == (11e-6, 10e-6, -1e-6, "sine")
    assert line.derived == ("pointing.body = 1 (the cone)",)


# ------------------------------------------------------------------------------------------------ what a residual is
def sine(mirror, controller, freq_hz, peak=0.0, rms=0.0, at_limits="", error=()):
    """A run of the loop, as far as the verdict looks at it."""
    trace = SimpleNamespace(
        peak_rad=peak, rms_rad=rms, error_rad=np.array(error, dtype=float), steady=slice(2, None),
        left_rad=lambda statistic: {"peak": peak, "rms": rms}[statistic],
    )  # fmt: skip
    return SimpleNamespace(mirror=mirror, controller=controller, freq_hz=freq_hz, at_limits=at_limits, trace=trace)


@pytest.mark.parametrize(("slope", "way"), [(-1e-9, ", whose model first turns the wrong way"), (0.0, ""), (1e-9, "")])
def test_a_residual_is_lag_where_hysteresis_makes_less_than_half_of_it(monkeypatch, slope, way):
    class BoucWen:
        def reversal_slope_rad_v(self):
            return slope

    monkeypatch.setattr(verdict.hysteresis, "BoucWen", BoucWen)
    mirrors = SimpleNamespace(own={Variant.GIVEN: SimpleNamespace(model=BoucWen())})
    worst = sine(Variant.GIVEN, PID, 25.0, peak=10.0, rms=4.0)
    others = (
        sine(Variant.STRAIGHT, PID, 15.0, peak=9.0, rms=9.0),
        sine(Variant.STRAIGHT, PID_WITH_INVERSE, 25.0, peak=9.0, rms=9.0),
        sine(Variant.COMPARISON, PID, 25.0, peak=9.0, rms=9.0),
    )

    def cause(linear, statistic, of=mirrors):
        same = sine(Variant.STRAIGHT, PID, 25.0, **{"peak": 0.0, "rms": 0.0, statistic: linear})
        return verdict.residual_cause(of, statistic, worst, (*others, worst, same))

    assert cause(5.1, "peak") == cause(2.1, "rms") == "lag of the loop at 25 Hz"
    assert cause(5.0, "peak") == cause(2.0, "rms") == f"hysteresis at 25 Hz{way}"
    plays = SimpleNamespace(own={Variant.GIVEN: SimpleNamespace(model=object())})
    assert cause(1.0, "peak", plays) == "hysteresis at 25 Hz"
    held = sine(Variant.GIVEN, PID, 25.0, peak=10.0, at_limits="the amplifier's slew limit")
    assert verdict.residual_cause(mirrors, "peak", held, ()) == "the amplifier's slew limit at 25 Hz"


# -------------------------------------------------------------------------------------------------- the paper's day
def a_day(rises=15.0, days=1.0, median_s=2700.0, relay=(60.0, 60.0), passes=(600.0,)):
    direct = None if passes is None else SimpleNamespace(contacts=[SimpleNamespace(duration_s=each) for each in passes])
    return SimpleNamespace(
        relay=SimpleNamespace(median_s=relay[0], slow_s=relay[1]),
        direct=direct,
        view=SimpleNamespace(rises=rises, median_s=median_s, days=days),
    )


@pytest.mark.parametrize(
    ("rises", "days", "agrees"),
    [
        (14.0, 1.0, "yes"), (16.0, 1.0, "yes"), (13.9, 1.0, "no"), (16.1, 1.0, "no"), (28.0, 2.0, "yes"),
        (26.0, 2.0, "no"), (32.08, 2.0, "no"), (15.0, 0.99, "not judged"), (15.0, 1.01, "yes"),
    ],
)  # fmt: skip
def test_about_fifteen_orbits_are_from_14_to_16_rises_a_day_over_a_day_at_least(rises, days, agrees):
    digits = 4 if rises == 32.08 else 3  # beside its limit
    claim = verdict._day_claims(a_day(rises=rises, days=days))[0]
    assert (claim.agrees, claim.ours) == (agrees, f"the relay rises {rises / days:.{digits}g} times a day")


@pytest.mark.parametrize(
    ("median_s", "agrees", "ours"),
    [
        (2700.0, "yes", "45 min (median)"),
        (2699.0, "no", "44.98 min (median)"),
        (2694.0, "no", "44.9 min (median)"),
        (math.nan, "not judged", "no contact is seen whole"),
    ],
)
def test_a_session_of_45_minutes_is_the_median_of_whole_contacts(median_s, agrees, ours):
    claim = verdict._day_claims(a_day(median_s=median_s))[1]
    assert (claim.agrees, claim.ours) == (agrees, ours)


@pytest.mark.parametrize(
    ("median_s", "slow_s", "agrees", "ours"),
    [
        (60.0, 60.0, "yes", "half within 1 min, 99 % within 1 min"),
        (59.0, 60.0, "yes", "half within 59 s, 99 % within 1 min"),
        (60.0, 61.0, "partly", "half within 1 min, 99 % within 1.02 min"),
        (1.25, math.inf, "partly", "half within 1.2 s, 99 % within never"),
        (61.0, 150.0, "no", "half within 1.02 min, 99 % within 2.5 min"),
        (61.0, 7260.0, "no", "half within 1.02 min, 99 % within 120 min"),
    ],
)
def test_almost_real_time_is_a_minute_by_the_median_and_by_99_percent(median_s, slow_s, agrees, ours):
    claim = verdict._day_claims(a_day(relay=(median_s, slow_s)))[2]
    assert (claim.agrees, claim.ours) == (agrees, ours)


@pytest.mark.parametrize(("longest_s", "agrees"), [(630.0, "yes"), (631.0, "no")])
def test_a_ground_pass_is_judged_by_the_longest_and_not_at_all_without_one(longest_s, agrees):
    claim = verdict._day_claims(a_day(passes=(100.0, longest_s, 200.0)))[3]
    assert (claim.agrees, claim.ours) == (agrees, "10.5 min at most")
    assert len(verdict._day_claims(a_day(passes=None))) == len(verdict._day_claims(a_day(passes=()))) == 3


# ------------------------------------------------------------------------------------------------ the paper's links
@pytest.mark.parametrize(
    ("beacon", "communication", "agrees"),
    [(0.1, 0.2, "inferred"), (0.0, 0.2, "no"), (0.2, 0.0, "no"), (-0.1, 5.0, "no"), (5.0, -0.1, "no")],
)
def test_both_margins_are_positive_only_where_each_of_them_is(beacon, communication, agrees):
    claim = verdict._sign_claim(beacon, communication)
    assert (claim.agrees, claim.ours) == (agrees, f"beacon {beacon:+.1f} dB, communication {communication:+.1f} dB")


@pytest.mark.parametrize(("convention", "covers"), [("half-1/e2", True), ("full-1/e2", False)])
def test_the_beacons_claim_reads_its_angle_both_ways(convention, covers):
    p = SimpleNamespace(
        covers=covers,
        other_reading=SimpleNamespace(convention=convention, half_angle_rad=900 * URAD),
        rss_rad=300 * URAD,
        required_divergence_rad=600 * URAD,
        reading=SimpleNamespace(coverage=0.42),
    )
    claim = verdict._beacon_claim(p)
    assert (claim.agrees, claim.ours) == (
        "inferred" if covers else "no",
        "600 µrad needed for 300 µrad (half width)",
    )
    assert ("as the half angle, the beacon would cover 3.0 times our errors" in claim.why) is covers
    assert "with a probability of 0.42" in claim.why
    p.reading = None
    assert "probability" not in verdict._beacon_claim(p).why


@pytest.mark.parametrize(
    ("margin_db", "agrees"), [(2.9501, "inferred"), (3.0499, "inferred"), (2.9499, "no"), (3.0501, "no")]
)
def test_three_decibels_are_those_to_a_twentieth(monkeypatch, margin_db, agrees):
    links = paper.links()

    def margin_map(data, rates, errors):
        assert (rates, errors) == ([300e6], [10e-6])
        return np.array([[margin_db]])

    monkeypatch.setattr(verdict.link, "margin_map", margin_map)
    claim = verdict._margin_claim(link.of(links.mission), links.sources)
    assert (claim.agrees, claim.ours) == (agrees, f"{margin_db:.2f} dB at 300 Mbit/s and 10 µrad")


# ------------------------------------------------------------------------------------------------ the paper's mirror
@pytest.mark.parametrize(("rad_v", "agrees"), [(0.1e-3, "yes"), (0.0999e-3, "no")])
def test_the_travel_is_twice_what_half_of_the_drives_range_moves(monkeypatch, rad_v, agrees):
    amplifier = SimpleNamespace(output_max_v=100.0, output_min_v=-25.0, gain=5.0)  # 25 V of drive
    monkeypatch.setattr(verdict.hysteresis, "output_amplitude", lambda model, drive_v: model * drive_v)
    claim = verdict._travel_claim(SimpleNamespace(amplifier=amplifier, summary=SimpleNamespace(model=rad_v)))
    assert claim.agrees == agrees
    assert claim.ours == f"{'2.5' if agrees == 'yes' else '2.498'} mrad within the amplifier's range"
    assert "over a drive range of 25 V" in claim.why


def test_the_linear_part_is_partly_the_papers_where_a_root_is_outside_of_the_band():
    inside = SimpleNamespace(in_band=True, kind="pole", frequency_hz=50.0)
    outside = SimpleNamespace(in_band=False, kind="zero", frequency_hz=0.0123)
    of = {"dc_gain": 0.25, "in_band_gain": (0.9, 1.1)}
    whole = verdict._linear_claim(SimpleNamespace(roots=[inside], **of))
    part = verdict._linear_claim(SimpleNamespace(roots=[inside, outside], **of))
    assert (whole.agrees, part.agrees) == ("yes", "partly")
    assert whole.ours == part.ours == "gain 0.2500 at DC, 0.9000 to 1.1000 in the band"
    assert part.why == whole.why + "; a zero at 0.0123 Hz lie outside the excited band, drift fitted as dynamics"


@pytest.mark.parametrize(
    ("loops", "agrees"),
    [
        ([(60.0, 0.98), (100.0, 1.0)], "yes"),
        ([(60.0, 0.99), (100.0, 1.0)], "no"),  # one percent is no widening
        ([(60.0, 1.0), (100.0, 0.5)], "no"),
        ([(60.0, 0.1), (80.0, 0.3), (100.0, 0.2)], "no"),  # each one against the one before
        ([(1.0, 0.1), (60.0, 0.2), (100.0, 0.3)], "yes"),
        ([(1.0, 0.1), (60.0, 0.2)], "not judged"),
        ([(1.0, 0.1), (100.0, 0.2)], "not judged"),
        ([(60.0, 0.2)], "not judged"),
    ],
)
def test_the_loop_widens_from_each_frequency_to_the_next_where_both_of_the_papers_were_run(loops, agrees):
    claim = verdict._loops_claim(tuple(SimpleNamespace(freq_hz=f, width=w) for f, w in loops))
    assert claim.agrees == agrees
    assert claim.ours == ", ".join(f"{100 * w:.2f} % at {f:g} Hz" for f, w in loops)


def evidence(*runs, pid=(1.0, 15.0)):
    return SimpleNamespace(runs=runs, cases=SimpleNamespace(scenario=SimpleNamespace(pid_frequencies_hz=pid)))


def with_and_without(freq_hz, added, rms=(2.0, 1.0), peak=(2.0, 1.0), limits=("", "")):
    """The run on the printed mirror, whose error is larger by some, and the same one without hysteresis."""
    late, early = [9.0, 9.0], [0.0, 0.0]  # before the loop is steady
    return (
        sine(Variant.GIVEN, PID, freq_hz, peak[0] * URAD, rms[0], limits[0], [*late, *np.array([1.0, -1.0]) * added]),
        sine(Variant.STRAIGHT, PID, freq_hz, peak[1] * URAD, rms[1], limits[1], [*early, 0.0, 0.0]),
    )


@pytest.mark.parametrize(
    ("runs", "agrees"),
    [
        ([(1.0, 1.0), (15.0, 2.0)], "yes"),
        ([(1.0, 2.0), (15.0, 2.0)], "no"),  # not more at the higher frequency
        ([(1.0, 2.0), (15.0, 1.0)], "no"),
        ([(1.0, 1.0), (15.0, 2.0, (1.0, 1.0))], "no"),  # not worse
        ([(1.0, 1.0, (1.0, 1.0)), (15.0, 2.0)], "no"),
        ([(15.0, 2.0)], "not judged"),
        ([(1.0, 1.0), (25.0, 2.0)], "not judged"),  # which PID alone is not run at
        ([(1.0, 1.0, (2.0, 1.0), (2.0, 1.0), ("slew", "")), (15.0, 2.0)], "not judged"),
        ([(1.0, 1.0), (15.0, 2.0, (2.0, 1.0), (2.0, 1.0), ("", "slew"))], "not judged"),
    ],
)
def test_hysteresis_makes_errors_worse_where_each_rms_grows_and_more_at_the_higher_frequency(runs, agrees):
    claim = verdict._worse_claim(evidence(*(run for each in runs for run in with_and_without(*each))))
    assert claim.agrees == agrees


def test_the_error_that_hysteresis_adds_is_that_of_the_steady_run_in_microradians():
    runs = *with_and_without(1.0, 3 * URAD), *with_and_without(15.0, 4 * URAD, peak=(8.0, 1.0))
    lost = sine(Variant.GIVEN, PID, 25.0), sine(Variant.STRAIGHT, PID_WITH_INVERSE, 1.0)  # without a partner
    claim = verdict._worse_claim(evidence(*lost, *runs))
    assert claim.ours == (
        "1 Hz: peak 1.0 → 2.0 µrad, difference 3.0 µrad rms; 15 Hz: peak 1.0 → 8.0 µrad, difference 4.0 µrad rms"
    )


@pytest.mark.parametrize(("peak", "hidden"), [(1.049, True), (1.05, False), (0.5, True)])
def test_a_total_peak_that_hardly_grows_is_said_to_hide_it(peak, hidden):
    plain = with_and_without(1.0, 1.0)
    claim = verdict._worse_claim(evidence(*plain, *with_and_without(15.0, 2.0, peak=(peak, 1.0))))
    assert claim.why.endswith("; in the total peak the lag of the loop hides it") is hidden
    worse = verdict._worse_claim(evidence(*plain, *with_and_without(15.0, 0.5, peak=(peak, 1.0))))
    assert worse.agrees == "no" and "hides" not in worse.why


@pytest.mark.parametrize(
    ("drop_urad", "agrees"), [(7.6, "yes"), (12.4, "yes"), (7.4, "no"), (12.6, "no"), (-10.0, "no")]
)
def test_the_inverse_takes_off_what_the_paper_says_to_a_quarter(drop_urad, agrees):
    pid = sine(Variant.GIVEN, PID, 15.0, peak=30 * URAD, rms=20 * URAD)
    inverse = sine(Variant.GIVEN, PID_WITH_INVERSE, 15.0, peak=(30 - drop_urad) * URAD, rms=5 * URAD)
    others = sine(Variant.STRAIGHT, PID, 25.0), sine(Variant.GIVEN, PID_WITH_INVERSE, 25.0)
    (claim,) = verdict._drop_claims(evidence(pid, inverse, *others))
    assert claim.agrees == agrees
    after = f"{30 - drop_urad:.1f}"
    assert claim.ours == f"{drop_urad:.1f} µrad: peak 30.0 → {after} µrad, rms 20.0 → 5.0 µrad"
    assert claim.claim == "the inverse takes about 10 µrad off at 15 Hz"
    for run in (pid, inverse):
        run.at_limits = "the amplifier's slew limit"
        assert verdict._drop_claims(evidence(pid, inverse))[0].agrees == "not judged"
        run.at_limits = ""
    assert verdict._drop_claims(evidence(pid)) == verdict._drop_claims(evidence(inverse)) == []


def test_the_points_where_claims_hold_together_are_told_by_composition_and_gains():
    names = tuple(paper.CLAIMS)

    def point(composition, kp, ki):
        return SimpleNamespace(composition=composition, proportional_v_rad=kp, integral_v_rad_s=ki)

    points = (point("additive", 2e3, 9e6), point("additive", 0.0, 9e6), point("additive", 1e3, 8e6))
    every = SimpleNamespace(points=[0] * 7, together=lambda: (names, points))
    claim = verdict._together_claim(every)
    assert (claim.agrees, claim.ours) == ("yes", "5 of 5 claims hold together at 3 of 7 scanned points")
    assert claim.why == "additive: Kp 0 to 2 V/mrad, Ki 8000 to 9000 V/(mrad s)"
    some = SimpleNamespace(points=[0] * 7, together=lambda: (names[1:], (point("cascade", 1e3, 8e6),)))
    claim = verdict._together_claim(some)
    assert claim.agrees == "no"
    assert claim.why == f"cascade: Kp 1 V/mrad, Ki 8000 V/(mrad s). Nowhere together with these: {names[0]}"
    none = SimpleNamespace(points=[0] * 7, together=lambda: (names[2:], ()))
    assert verdict._together_claim(none).why == f"Nowhere together with these: {names[0]}; {names[1]}"


def in_words(*claims):
    """Claims with all that they say, one behind the other."""
    return " || ".join(" | ".join((c.where, c.claim, c.ours, c.agrees, c.why)) for c in claims)


def a_root(kind, frequency_hz):
    return SimpleNamespace(in_band=False, kind=kind, frequency_hz=frequency_hz)


def a_scan(*points):
    made = [SimpleNamespace(composition=name, proportional_v_rad=kp, integral_v_rad_s=ki) for name, kp, ki in points]
    return SimpleNamespace(points=[0] * 60, together=lambda: (tuple(paper.CLAIMS)[1:4], tuple(made)))


ALL_OF_A_CLAIM = {
    "a day with passes": (
        lambda: in_words(*verdict._day_claims(a_day(33.0, 2.25, 2735.0, (61.5, 4260.0), (100.0, 637.0)))),
        """
        abstract | a line of sight in each of about 15 orbits a day | the relay rises 14.7 times a day | yes |
        orbit, slot and grazing height are assumptions: the paper prints none || section 2.2 | about 45 minutes for
        each session | 45.6 min (median) | yes | what the geometry allows; the session is shorter by acquisition,
        and by what the relay does not grant || abstract | data reach the ground in almost real time | half within
        1.02 min, 99 % within 71 min | no | judged at one minute, by the median and by 99 %: data made out of sight of
        the relay wait for a contact || abstract | a ground pass takes less than about 10 minutes | 10.6 min at most
        | no | above the mask of the mission's stations; at the horizon itself a pass takes some minutes more
        """,
    ),
    "a day without them": (
        lambda: in_words(*verdict._day_claims(a_day(11.0, 0.75, math.nan, (0.25, 45.5), None))),
        """
        abstract | a line of sight in each of about 15 orbits a day | the relay rises 14.7 times a day | not judged
        | orbit, slot and grazing height are assumptions: the paper prints none || section 2.2 | about 45 minutes
        for each session | no contact is seen whole | not judged | what the geometry allows; the session is shorter
        by acquisition, and by what the relay does not grant || abstract | data reach the ground in almost real time
        | half within 0.25 s, 99 % within 46 s | yes | judged at one minute, by the median and by 99 %: data made
        out of sight of the relay wait for a contact
        """,
    ),
    "the sign of both margins": (
        lambda: in_words(verdict._sign_claim(12.345, -0.06)),
        """
        Table 2 | both margins are positive | beacon +12.3 dB, communication -0.1 dB | no | the sensitivities of
        both receivers are assumptions: the paper prints neither
        """,
    ),
    "the cone of the beacon": (
        lambda: in_words(
            verdict._beacon_claim(
                SimpleNamespace(
                    covers=True,
                    other_reading=SimpleNamespace(convention="half-1/e2", half_angle_rad=925 * URAD),
                    rss_rad=310 * URAD,
                    required_divergence_rad=615 * URAD,
                    reading=SimpleNamespace(coverage=0.8765),
                )
            )
        ),
        """
        section 2.1 | a 780 µrad beacon covers the root sum square of three errors | 615 µrad needed for 310 µrad
        (half width) | inferred | two of the three errors are not printed; ours are chosen so that 780 µrad follows,
        read as the full angle; read as the half angle, the beacon would cover 3.0 times our errors; a root sum
        square is that of one axis; counting both axes, with biases at their bounds, the beacon's cone covers its
        partner with a probability of 0.88
        """,
    ),
    "the linear part with two roots out of its band": (
        lambda: in_words(
            verdict._linear_claim(
                SimpleNamespace(
                    roots=[a_root("pole", 0.0343), a_root("zero", 5600.0)], dc_gain=1.25, in_band_gain=(0.875, 1.125)
                )
            )
        ),
        """
        Eq. 2 | linear dynamics of the mirror | gain 1.2500 at DC, 0.8750 to 1.1250 in the band | partly | Eq. 2 has
        a gain of its own beside d1 of Eq. 3: cascading both would square it, so Eq. 2 is normalised; a pole at
        0.0343 Hz and a zero at 5600.0000 Hz lie outside the excited band, drift fitted as dynamics
        """,
    ),
    "the linear part": (
        lambda: in_words(verdict._linear_claim(SimpleNamespace(roots=[], dc_gain=1.25, in_band_gain=(0.875, 1.125)))),
        """
        Eq. 2 | linear dynamics of the mirror | gain 1.2500 at DC, 0.8750 to 1.1250 in the band | yes | Eq. 2 has a
        gain of its own beside d1 of Eq. 3: cascading both would square it, so Eq. 2 is normalised
        """,
    ),
    "three loops": (
        lambda: in_words(
            verdict._loops_claim(
                (
                    SimpleNamespace(freq_hz=60.0, width=0.1),
                    SimpleNamespace(freq_hz=80.0, width=0.125),
                    SimpleNamespace(freq_hz=100.0, width=0.15625),
                )
            )
        ),
        """
        Fig. 5 | the loop widens from 60 to 100 Hz | 10.00 % at 60 Hz, 12.50 % at 80 Hz, 15.62 % at 100 Hz | yes |
        width of h over the output's peak-to-peak; some of it at 100 Hz is linear phase lag that Eq. 2 holds too
        """,
    ),
    "errors at two frequencies": (
        lambda: in_words(
            verdict._worse_claim(
                evidence(
                    *with_and_without(1.0, 3 * URAD, peak=(7.0, 6.0)),
                    *with_and_without(15.0, 4 * URAD, peak=(8.03, 8.0)),
                )
            )
        ),
        """
        Fig. 6 | hysteresis makes the errors worse, more so at higher frequency | 1 Hz: peak 6.0 → 7.0 µrad,
        difference 3.0 µrad rms; 15 Hz: peak 8.0 → 8.0 µrad, difference 4.0 µrad rms | yes | judged by rms, and by
        the rms of the difference between the two error signals; in the total peak the lag of the loop hides it
        """,
    ),
    "two drops": (
        lambda: in_words(
            *verdict._drop_claims(
                evidence(
                    sine(Variant.GIVEN, PID, 25.0, peak=61 * URAD, rms=43 * URAD),
                    sine(Variant.GIVEN, PID_WITH_INVERSE, 25.0, peak=38 * URAD, rms=26 * URAD),
                    sine(Variant.GIVEN, PID, 15.0, peak=33 * URAD, rms=21 * URAD),
                    sine(Variant.GIVEN, PID_WITH_INVERSE, 15.0, peak=17 * URAD, rms=12 * URAD),
                )
            )
        ),
        """
        Fig. 8 | the inverse takes about 10 µrad off at 15 Hz | 16.0 µrad: peak 33.0 → 17.0 µrad, rms 21.0 → 12.0
        µrad | no | within 25 %, at gains of ours: the paper prints none || Fig. 8 | the inverse takes about 25 µrad
        off at 25 Hz | 23.0 µrad: peak 61.0 → 38.0 µrad, rms 43.0 → 26.0 µrad | yes | within 25 %, at gains of ours:
        the paper prints none
        """,
    ),
    "claims that hold together in both compositions": (
        lambda: in_words(
            verdict._together_claim(
                a_scan(("additive", 1e3, 8e6), ("cascade", 4e3, 9e6), ("cascade", 0.0, 25e6), ("additive", 1e3, 11e6))
            )
        ),
        """
        section 3.1, Fig. 6 and 8 | all closed-loop claims at once | 3 of 5 claims hold together at 4 of 60 scanned
        points | no | cascade: Kp 0 to 4 V/mrad, Ki 9000 to 25000 V/(mrad s); additive: Kp 1 V/mrad, Ki 8000 to
        11000 V/(mrad s). Nowhere together with these: hysteresis raises the rms error by over 1 % at 1 and 15 Hz;
        PID + inverse stays within 10 µrad at its peaks
        """,
    ),
}


@pytest.mark.parametrize("what", ALL_OF_A_CLAIM)
def test_a_claim_beside_ours_is_told_in_full(what):
    call, words = ALL_OF_A_CLAIM[what]
    assert one_line(str(call())) == one_line(words)


def derived_and_other():
    """Sources of which those of two tables are derived, one of them changed since."""

    def of(kind, was=""):
        return SimpleNamespace(kind=kind, value='"1 W"', comment=f"{kind}: the {kind}", was=was)

    return {
        "communication.a": of("derived"),
        "communication.b": of("derived", "2"),
        "beacon.a": of("derived"),
        "error_budget.sources.s.size": of("derived"),
        "error_budget.requirements.code_word.limit": of("derived"),
        "error_budget.requirements.code.limit": of("derived"),
    }


REQUIRED = SimpleNamespace(margin_db=3.25, pointing_error_rad=12.5e-6, outage=0.0125)


@pytest.mark.parametrize(("possible", "known"), [(True, True), (False, True), (True, False), (False, False)])
def test_the_residual_and_the_margin_under_it_have_every_field_of_their_lines(monkeypatch, possible, known):
    monkeypatch.setattr(verdict.mirror_summary, "unknown_dynamics", lambda table: "" if known else "unknown")
    achieved = SimpleNamespace(margin_db=4.5, possible=possible)
    mirrors, lacking = SimpleNamespace(table="the mirror"), "dynamics of the mirror, which its model does not have"
    lines = verdict.of_residual(REQUIRED, mirrors, derived_and_other(), achieved, 10e-6, "lag")
    doubt = "" if known else lacking
    too_near = "its budget has more light arrive than was sent: the terminals are too near for it"
    assert lines == (
        Requirement("residual", "residual pointing error", "rad", 12.5e-6, 10e-6, 12.5e-6 - 10e-6, "lag", doubt, ()),
        Requirement(
            "communication",
            "communication margin",
            "dB",
            3.25,
            4.5,
            1.25,
            "the residual: lag",
            doubt if possible else too_near,
            ("communication.a = 1 W (the derived)",),
        ),
    )


@pytest.mark.parametrize("unknown", ["", "unknown"])
def test_the_fine_loop_has_every_field_of_its_lines(monkeypatch, unknown):
    monkeypatch.setattr(verdict, "_stroke", lambda sources, fine: "the stroke")
    given = SimpleNamespace(quantile_rad=15e-6)
    fine = SimpleNamespace(
        best=SimpleNamespace(design=SimpleNamespace(name="LQG"), simulated={Variant.GIVEN: given, Variant.STRAIGHT: 0}),
        budget=SimpleNamespace(dominant="noise"),
        scene=SimpleNamespace(unknown_dynamics=unknown),
        quantile=0.9975,
    )
    case = SimpleNamespace(margin_db=2.75, possible=True)
    doubt = "dynamics of the mirror, which its model does not have" if unknown else ""
    stroke, error, margin = verdict.of_fine_pointing(REQUIRED, derived_and_other(), fine, case)
    assert stroke == "the stroke"
    name = "fine pointing at 99.75 % (LQG)"
    assert error == Requirement("fine pointing", name, "rad", 12.5e-6, 15e-6, 12.5e-6 - 15e-6, "noise", doubt, ())
    derived = ("communication.a = 1 W (the derived)",)
    name = "link margin for 98.75 % of the time (LQG)"
    assert margin == Requirement("communication", name, "dB", 3.25, 2.75, -0.5, "noise", doubt, derived)
    assert not margin.met and not error.met


def test_a_budget_of_errors_has_a_line_for_each_requirement_with_its_own_inputs():
    def judged(name, kind, limit_rad, found_rad, *shares):
        required = SimpleNamespace(limit_rad=limit_rad, index=SimpleNamespace(kind=kind))
        total = SimpleNamespace(required=required, quantile_rad=found_rad)
        return SimpleNamespace(name=name, total=total, shares=[SimpleNamespace(name=each) for each in shares])

    budget = SimpleNamespace(
        judged=[
            judged("code_word", "RPE", 5e-6, 4e-6, "star_tracker_a", "x"),
            judged("code", "APE", 3e-6, 8e-6, "loop"),
        ]
    )
    first, second = verdict.of_error_budget(budget, derived_and_other(), None)
    sources = "error_budget.sources.s.size = 1 W (the derived)"
    assert first == Requirement(
        *("error budget", "code word (RPE)", "rad", 5e-6, 4e-6, 5e-6 - 4e-6, "star tracker a", ""),
        (sources, "error_budget.requirements.code_word.limit = 1 W (the derived)"),
    )
    assert (second.name, second.margin, second.limited_by) == ("code (APE)", 3e-6 - 8e-6, "loop")
    assert second.derived == (sources, "error_budget.requirements.code.limit = 1 W (the derived)")
    fine = SimpleNamespace(scene=SimpleNamespace(unknown_dynamics="unknown"))
    doubts = [line.unknown for line in verdict.of_error_budget(budget, {}, fine)]
    assert doubts == ["dynamics of the mirror, which its model does not have"] * 2
    assert first.mark == "derived" and second.mark == "FAIL"
    assert (first.because, verdict.of_error_budget(budget, {}, fine)[0].because) == ("star tracker a", doubts[0])


@pytest.mark.parametrize(
    ("time_s", "words"),
    [
        (0.25, "0.25 s"),
        (59.4, "59 s"),
        (59.99, "60 s"),
        (60.0, "1 min"),
        (60.06, "1.001 min"),
        (62.4, "1.04 min"),
        (99.0, "1.6 min"),
        (math.inf, "never"),
    ],
)
def test_a_time_is_told_in_its_unit(time_s, words):
    assert verdict._minutes(time_s) == words


def test_the_claims_come_in_the_order_of_the_paper_and_those_without_a_base_are_left_out(monkeypatch):
    for name in ("_link_claims", "_drop_claims", "_day_claims"):
        monkeypatch.setattr(verdict, name, lambda *given, name=name: (f"{name} 1", f"{name} 2"))
    for name in ("_travel_claim", "_linear_claim", "_loops_claim", "_worse_claim", "_together_claim"):
        monkeypatch.setattr(verdict, name, lambda *given, name=name: name)

    def claims(linear=0, scan=0, day=0):
        cases = SimpleNamespace(mirrors=SimpleNamespace(table=SimpleNamespace(linear=linear)))
        return verdict.against_paper(verdict.Evidence("a", cases, (), "s", (), scan, day))

    links, drops = ("_link_claims 1", "_link_claims 2"), ("_drop_claims 1", "_drop_claims 2")
    assert claims() == (
        *links,
        *("_travel_claim", "_linear_claim", "_loops_claim", "_worse_claim"),
        *drops,
        *("_together_claim", "_day_claims 1", "_day_claims 2"),
    )
    assert claims(None, None, None) == (*links, "_travel_claim", "_loops_claim", "_worse_claim", *drops)


def test_runs_are_held_against_those_of_their_own_controller_and_frequency_without_hysteresis():
    variants, controllers = (Variant.STRAIGHT, Variant.GIVEN, Variant.COMPARISON), (PID, PID_WITH_INVERSE)
    runs = {(v, c, f): sine(v, c, f) for c in controllers for v in variants for f in (1.0, 15.0, 25.0)}
    del runs[Variant.STRAIGHT, PID, 25.0], runs[Variant.GIVEN, PID_WITH_INVERSE, 1.0]
    for controller, frequencies in ((PID, (1.0, 15.0)), (PID_WITH_INVERSE, (15.0, 25.0))):
        found = verdict._pairs(evidence(*runs.values()), controller)
        assert len(found) == 2
        for (one, other), freq_hz in zip(found, frequencies, strict=True):
            assert one is runs[Variant.GIVEN, controller, freq_hz]
            assert other is runs[Variant.STRAIGHT, controller, freq_hz]


@pytest.mark.parametrize(
    ("rises", "told"), [(13.996, "13.996"), (14.004, "14.004"), (15.996, "15.996"), (16.004, "16.004"), (14.96, "15")]
)
def test_rises_that_miss_fourteen_or_sixteen_a_day_have_the_digits_that_tell_it(rises, told):
    claim = verdict._day_claims(a_day(rises=rises * 1000.0, days=1000.0))[0]
    assert claim.ours == f"the relay rises {told} times a day"
    assert claim.agrees == ("yes" if 14.0 <= rises <= 16.0 else "no")
