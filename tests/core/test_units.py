"""Units at the door: the table against astropy.units, every refusal with its message, and the way back."""

import math
import re

import pytest
from astropy import units as au
from astropy.constants import c, h
from hypothesis import example, given, settings
from hypothesis import strategies as st

from microrad.core import units
from microrad.core.units import (
    PLANCK_J_S,
    SPEED_OF_LIGHT_M_S,
    UnitError,
    format_input,
    format_limit,
    format_quantity,
    parse_quantity,
)
from waiting import no_hang

# our symbol: astropy's name for it; photon, bit and cycle are base dimensions in both
ASTROPY = {"B": "byte", "min": "minute", "h": "hour", "deg": "degree"}
SI = {
    "m": "m", "g": "kg", "s": "s", "min": "s", "h": "s", "day": "s", "A": "A", "K": "K", "V": "V", "W": "W", "J": "J",
    "N": "N", "Hz": "Hz", "rad": "rad", "deg": "rad", "arcsec": "rad",
    "bit": "bit", "B": "bit", "byte": "bit", "photon": "photon", "sr": "rad2",
}  # fmt: skip
PREFIXES = {"": 1.0} | {p: au.Unit(f"{p}m").to(au.m) for p in "pnumckMGT"}
PREFIXES |= {"µ": PREFIXES["u"], "μ": PREFIXES["u"]}
SYMBOLS = [(p, s) for s, (_, _, allowed) in units._UNITS.items() for p in ("", *allowed)]
COMPOUNDS = [
    ("mrad/V", "rad/V", "mrad/V"), ("s/V", "s/V", "s/V"), ("1/V", "1/V", "1/V"), ("V/s", "V/s", "V/s"),
    ("V/us", "V/s", "V/us"), ("Mbit/s", "bit/s", "Mbit/s"), ("kB/s", "bit/s", "kbyte/s"),
    ("photon/bit", "photon/bit", "photon/bit"), ("V/(mrad s)", "V/(rad s)", "V/(mrad s)"),
    ("V s/mrad", "V s/rad", "V s/mrad"), ("W/m^2", "W/m^2", "W/m2"), ("nW/cm2", "W/m^2", "nW/cm2"),
    ("deg/h", "rad/s", "deg/h"), ("V·s/mrad", "V s/rad", "V s/mrad"), ("V / us", "V/s", "V/us"),
    ("urad/s", "rad/s", "urad/s"), ("urad^2/Hz", "rad^2/Hz", "urad2/Hz"), ("urad2/kHz", "rad^2/Hz", "urad2/kHz"),
    ("nrad/Hz^2", "rad/Hz^2", "nrad/Hz2"), ("mA/W", "A/W", "mA/W"), ("A/mW", "A/W", "A/mW"),
    ("pA/sqrt(Hz)", "A/sqrt(Hz)", "pA/sqrt(Hz)"), ("pA/√kHz", "A/sqrt(Hz)", "pA/sqrt(kHz)"),
    ("nV/(sqrt(MHz) K)", "V/(sqrt(Hz) K)", "nV/(sqrt(MHz) K)"), ("sqrt(kHz)", "sqrt(Hz)", "sqrt(kHz)"),
    ("W/(m^2 sr um)", "W/(m^3 sr)", "W/(m2 sr um)"),
    ("km/s", "m/s", "km/s"),
]  # fmt: skip
KEYS = sorted({unit for _, unit, _ in COMPOUNDS} | set(SI.values()) | {"dB"})


def test_constants_are_those_of_the_si():
    assert c.si.value == SPEED_OF_LIGHT_M_S
    assert h.si.value == PLANCK_J_S


@pytest.mark.promise("mirror-file-3")
@pytest.mark.parametrize(("prefix", "symbol"), SYMBOLS)
def test_every_symbol_agrees_with_astropy(prefix, symbol):
    ours = parse_quantity(f"2.5 {prefix}{symbol}", SI[symbol])
    theirs = 2.5 * PREFIXES[prefix] * au.Unit(ASTROPY.get(symbol, symbol)).to(au.Unit(SI[symbol]))
    assert ours == pytest.approx(theirs, rel=1e-14, abs=0.0)


def test_no_prefixed_unit_hides_another():
    written = [prefix + symbol for prefix, symbol in SYMBOLS]
    assert len(written) == len(set(written))


@pytest.mark.parametrize(("text", "unit", "theirs"), COMPOUNDS)
def test_compound_units_agree_with_astropy(text, unit, theirs):
    expected = 3.25 * au.Unit(theirs).to(au.Unit(unit))
    assert parse_quantity(f"3.25 {text}", unit) == pytest.approx(expected, rel=1e-14, abs=0.0)


@settings(deadline=None)  # the machine may be busy
@given(st.decimals("-1e9", "1e9", places=4), st.sampled_from(COMPOUNDS))
def test_numbers_pass_through(number, compound):
    text, unit, theirs = compound
    expected = float(number) * au.Unit(theirs).to(au.Unit(unit))
    assert parse_quantity(f"{number} {text}", unit) == pytest.approx(expected, rel=1e-13, abs=0.0)


@pytest.mark.promise("mirror-file-3")
@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("780 urad", "rad", 780e-6),  # to the last bit, as if written in SI
        ("9.99 µrad", "rad", 9.99e-6),
        ("5cm", "m", 0.05),
        ("+1.5e3 m", "m", 1500.0),
        (".5 W", "W", 0.5),
        ("-2.96e-7 s/V", "s/V", -2.96e-7),
        ("38.421 1/V", "1/V", 38.421),
        ("0 V", "V", 0.0),
        ("3 dB", "dB", 3.0),
        ("-0.4 dB", "dB", -0.4),
        ("30 dBm", "W", 1.0),
        ("7 dBW", "W", 10**0.7),
        ("160 urad^2/Hz", "rad^2/Hz", 160e-12),
        ("0.05 pA/√Hz", "A/sqrt(Hz)", 0.05e-12),
        ("1e30 m", "m", 1e30),
        ("-1e30 m", "m", -1e30),
        ("1e-30 m", "m", 1e-30),
        ("1000 dB", "dB", 1000.0),
        ("-1000 dB", "dB", -1000.0),
        ("1." + "0" * 57 + "m", "m", 1.0),  # sixty characters
    ],
)
def test_what_is_read(text, unit, value):
    assert parse_quantity(text, unit) == value


@pytest.mark.promise("mirror-file-3")
@pytest.mark.promise("decisions-1")
@pytest.mark.parametrize(
    ("text", "unit", "reason", "advice"),
    [
        (5, "m", "number without a unit", '"5 m"'),
        (0.25, "W", "number without a unit", '"0.25 W"'),
        ("5", "m", "number without a unit", '"5 m"'),
        ("5 ", "rad", "number without a unit", '"5 urad"'),
        ("1,5 W", "W", "comma", '"1.5 W"'),
        ("nan W", "W", "plain number", '"5 W"'),
        ("inf W", "W", "plain number", '"5 W"'),
        ("-inf W", "W", "plain number", '"5 W"'),
        (math.nan, "W", "nan is a number without a unit", '"5 W"'),
        ("0x10 m", "m", '"x10 m"', '"5 m"'),
        ("1_000 m", "m", '"_000 m"', '"5 m"'),
        ("9**9**9 m", "m", '"**9**9"', '"5 m"'),
        ("2*3 m", "m", '"*3"', '"5 m"'),
        ("(1+1) m", "m", "plain number", '"5 m"'),
        ("1e400 m", "m", "too large", '"5 m"'),
        ("1e28 km", "m", "too large for a quantity", '"5 m"'),
        ("-1e-320 km", "m", "too small, and not 0, for a quantity", '"5 m"'),
        ("1e-400 km", "m", "too small, and not 0, for a quantity", '"5 m"'),
        ("1e9999999999 m", "m", "where a unit should stand", '"5 m"'),
        ("5  m", "m", "missing beside a space", '"5 m"'),
        (" 5 m", "m", "plain number", '"5 m"'),
        ("", "m", "plain number", '"5 m"'),
        ("m", "m", "plain number", '"5 m"'),
        ("٥ m", "m", "plain number", '"5 m"'),  # a digit to Python's int, not to us
        ("5 m/", "m", "missing beside", '"5 m"'),
        ("5 /m", "1/m", "missing beside", '"5 1/m"'),
        ("5 V/mrad s", "V/(rad s)", "brackets, as in V/(mrad s)", '"5 V/(mrad s)"'),
        ("5 m/s/s", "m/s^2", '"s/s"', "m/s^2"),
        ("5 m s", "m/s", 'is in "m s", another kind of quantity', '"5 km/s"'),
        ("5 V/rad", "rad/V", 'is in "V/rad", another kind of quantity', '"5 mrad/V"'),
        ("5 1/s", "s", 'is in "1/s", another kind of quantity', '"5 s"'),
        ("5 parsec", "m", 'no unit is called "parsec"', '"5 m"'),
        ("7 watt", "W", 'has "watt", which is written W here', '"7 W"'),
        ("7 watt", "dB", 'no unit is called "watt"', '"5 dB"'),
        ("300 Mbps", "bit/s", 'has "Mbps", which is written Mbit/s here', '"300 Mbit/s"'),
        ("300 Mb/s", "bit/s", 'has "Mb/s", which is written Mbit/s here', '"300 Mbit/s"'),
        ("2 Gbits/sec", "bit/s", 'has "Gbits/sec", which is written Gbit/s here', '"2 Gbit/s"'),
        ("64 Kbit/s", "bit/s", 'has "Kbit/s", which is written kbit/s here', '"64 kbit/s"'),
        ("8 b/s", "bit/s", 'has "b/s", which is written bit/s here', '"8 bit/s"'),
        ("2 kbps", "W", 'no unit is called "kbps"', '"5 W"'),
        ("2 GBps", "bit/s", 'no unit is called "GBps"', '"5 Mbit/s"'),
        ("90 degrees", "rad", 'has "degrees", which is written deg here', '"90 deg"'),
        ("5 kmin", "s", 'no unit is called "kmin"', '"5 s"'),
        ("5 m^0", "m", 'no unit is called "m^0"', '"5 m"'),
        ("5 W\x1b[31m", "W", "\\u001b", '"5 W"'),
        ("1 Hz", "rad/s", 'in "Hz", another kind', "rad/s"),
        ("1 rad/s", "Hz", 'in "rad/s", another kind', '"5 Hz"'),
        ("1 1/s", "Hz", 'in "1/s", another kind', '"5 Hz"'),
        ("1 1/s", "rad/s", "another kind", "rad/s"),
        ("1 Mbit", "bit/s", "another kind", '"5 Mbit/s"'),
        ("1 1/bit", "photon/bit", "another kind", '"5 photon/bit"'),
        ("1 m", "rad", "another kind", '"5 urad"'),
        ("1 urad/Hz", "rad^2/Hz", "another kind", '"5 urad^2/Hz"'),
        ("1 urad^2 s", "rad^2/Hz", "another kind", '"5 urad^2/Hz"'),
        ("1 pA^2/Hz", "A/sqrt(Hz)", "another kind", '"5 pA/sqrt(Hz)"'),
        ("1 pA/Hz", "A/sqrt(Hz)", "another kind", '"5 pA/sqrt(Hz)"'),
        ("1 pA/sqrt(s)", "A/sqrt(Hz)", "another kind", '"5 pA/sqrt(Hz)"'),
        ("1 pA/sqrt(Hz", "A/sqrt(Hz)", 'no unit is called "sqrt(Hz"', '"5 pA/sqrt(Hz)"'),
        ("1 pA/sqrt()", "A/sqrt(Hz)", 'no unit is called "sqrt()"', '"5 pA/sqrt(Hz)"'),
        ("1 pA/sqrt(Hertz)", "A/sqrt(Hz)", 'no unit is called "Hertz"', '"5 pA/sqrt(Hz)"'),
        ("1 pA/√√Hz", "A/sqrt(Hz)", 'no unit is called "√√Hz"', '"5 pA/sqrt(Hz)"'),
        ("1 dB", "W", "in dB, another kind", '"5 W"'),
        ("1 dBm", "dB", "in dBm, another kind", '"5 dB"'),
        ("1 dBm", "rad", "in dBm, another kind", '"5 urad"'),
        ("1 W", "dB", 'in "W", another kind', '"5 dB"'),
        ("1 dBm/s", "W", "no unit is called", '"5 W"'),
        ("1e6 dBm", "W", "beyond 1000 dBm", '"5 W"'),
        ("1000.1 dB", "dB", "beyond 1000 dB", '"5 dB"'),
        ("-1001 dB", "dB", "beyond 1000 dB", '"5 dB"'),
        ("1.01e30 m", "m", "is too large for a quantity", '"5 m"'),
        ("-1.01e30 m", "m", "is too large for a quantity", '"5 m"'),
        ("9.9e-31 m", "m", "is too small, and not 0, for a quantity", '"5 m"'),
        ("1." + "0" * 58 + "m", "m", "has 61 characters, too many for a quantity", '"5 m"'),
        ("5 V/(mrad s", "V/(rad s)", "put what stands below the stroke in brackets", '"5 V/(mrad s)"'),
        ("5 V/mrad s)", "V/(rad s)", "put what stands below the stroke in brackets", '"5 V/(mrad s)"'),
        (999_999_999_999_999, "m", "999999999999999 is a number without a unit", '"999999999999999 m"'),
        (10**15, "m", "a value of type int is a number without a unit", '"5 m"'),
        (-(10**15), "m", "a value of type int is a number without a unit", '"5 m"'),
        (1e15, "m", "1e+15 is a number without a unit", '"5 m"'),
        (-0.5, "m", "-0.5 is a number without a unit", '"-0.5 m"'),
        (True, "W", "not a quantity", '"5 W"'),
        (None, "W", "not a quantity", '"5 W"'),
        (["5 W"], "W", "not a quantity", '"5 W"'),
    ],
)
def test_what_is_refused_and_how(text, unit, reason, advice):
    with no_hang(), pytest.raises(UnitError) as refused:
        parse_quantity(text, unit)
    message = str(refused.value)
    assert reason in message
    assert "for example" in message
    assert advice in message
    assert refused.value.example in message
    assert len(message) < 400
    assert message.isprintable()


def test_enormous_values_are_refused_in_a_short_message():
    for value, reason in (("9" * 100_000 + " m", "100002 characters"), (1 << 20_000, "without a unit")):
        with pytest.raises(UnitError, match=reason) as refused:
            parse_quantity(value, "m")
        assert len(str(refused.value)) < 250


def test_the_example_takes_the_typical_unit_and_is_itself_accepted():
    with pytest.raises(UnitError, match='for example "5 cm"') as refused:
        parse_quantity(5, "m", "cm")
    assert parse_quantity(refused.value.example, "m") == 0.05


@pytest.mark.parametrize("unit", KEYS)
def test_every_example_can_be_written(unit):
    with pytest.raises(UnitError) as refused:
        parse_quantity(3, unit)
    assert parse_quantity(refused.value.example, unit) != 0.0


@settings(deadline=None)  # the machine may be busy
@given(st.text("0123456789.,eE+-*_ /()^·µmradVsWBHzdbit∞", max_size=20), st.sampled_from(KEYS))
@example("9**9**9 m", "m")
@example("1" + "0" * 58 + "m", "m")
def test_any_text_is_a_finite_number_or_a_unit_error(text, unit):
    try:
        value = parse_quantity(text, unit)
    except UnitError:
        return
    assert math.isfinite(value)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (9.99e-6, "rad", "9.99 µrad"),
        (3e8, "bit/s", "300 Mbit/s"),
        (4.2e7, "m", "42000 km"),
        (0.05, "m", "50 mm"),
        (0.99999999e-3, "rad", "1 mrad"),  # rounds up into the next prefix
        (-3.2e-5, "rad", "-32 µrad"),
        (2.415e-9, "W/m^2", "2.415 nW/m^2"),
        (8.9e-5, "rad/V", "89 µrad/V"),
        (5e-14, "A/sqrt(Hz)", "0.05 pA/sqrt(Hz)"),
        (38.421, "1/V", "38.42 1/V"),
        (0.25, "", "0.25"),
        (1e-6, "m^2", "1e-06 m^2"),  # a prefix would be squared
        (0.4, "dB", "0.4 dB"),
        (290.6, "photon/bit", "290.6 photon/bit"),
        (0.0, "V", "0 V"),
        (1e-5, "s", "10 µs"),
        (math.nan, "m", "nan m"),
        (math.inf, "m", "inf m"),
    ],
)
def test_a_readable_prefix_is_chosen(value, unit, text):
    assert format_quantity(value, unit) == text


def test_digits_are_kept_as_asked():
    assert format_quantity(1 / 3, "W", 2) == "330 mW"
    assert format_quantity(1 / 3, "W", 7) == "333.3333 mW"


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (6.1336e12, "m", "6133600000 km"),
        (42_164_170.0, "m", "42164.17 km"),
        (1.55e-6, "m", "1.55 µm"),
        (76.0, "photon/bit", "76 photon/bit"),
        (331_541_911.34888077, "bit/s", "331.5 Mbit/s"),
        (1.0 / 3.0, "W", "333.3 mW"),
        (0.0, "rad", "0 rad"),
    ],
)
def test_an_input_has_every_digit_that_it_was_given_with_and_a_computed_one_four(value, unit, text):
    assert format_input(value, unit) == text


@settings(deadline=None)  # the machine may be busy
@given(
    st.floats(1e-15, 1e15) | st.floats(-1e15, -1e-15), st.sampled_from([k for k in KEYS if k not in ("dB", "K", "kg")])
)
def test_what_is_written_can_be_read_back(value, unit):
    text = format_quantity(value, unit, 6)
    assert parse_quantity(text, unit) == pytest.approx(value, rel=5.1e-6, abs=0.0)
    assert re.fullmatch(r"\S+ \S.*", text)


def test_a_value_of_ten_digits_keeps_them_and_one_of_eleven_is_taken_as_computed():
    assert format_input(1.234567891e-6, "rad") == "1.234567891 µrad"
    assert format_input(1.2345678912e-6, "rad") == "1.235 µrad"


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (
            lambda: parse_quantity(("5 cm", 3), "m"),
            UnitError,
            ('a value of type tuple is not a quantity in quotes; expected a length with its unit, for example "5 m"'),
        ),
        (
            lambda: parse_quantity("-12,75 dBm", "W"),
            UnitError,
            (
                '"-12,75 dBm" has a comma: decimals take a point, thousands nothing; expected a power with '
                'its unit, for example "-12.75 dBm"'
            ),
        ),
        (
            lambda: parse_quantity("622.08", "bit/s"),
            UnitError,
            ('"622.08" is a number without a unit; expected a data rate with its unit, for example "622.08 Mbit/s"'),
        ),
        (
            lambda: parse_quantity("622.08 Mbps", "bit/s"),
            UnitError,
            (
                '"622.08 Mbps" has "Mbps", which is written Mbit/s here; expected a data rate with its '
                'unit, for example "622.08 Mbit/s"'
            ),
        ),
        (
            lambda: parse_quantity("-2.5 Hertz", "Hz"),
            UnitError,
            (
                '"-2.5 Hertz" has "Hertz", which is written Hz here; expected a frequency with its unit, '
                'for example "-2.5 Hz"'
            ),
        ),
        (
            lambda: parse_quantity("0.5 microns", "m", "nm"),
            UnitError,
            (
                '"0.5 microns" has "microns", which is written um here; expected a length with its unit, '
                'for example "0.5 um"'
            ),
        ),
        (
            lambda: parse_quantity("3.25 parsec", "m", "km"),
            UnitError,
            (
                '"3.25 parsec" has "parsec" where a unit should stand: no unit is called "parsec"; '
                'expected a length with its unit, for example "5 km"'
            ),
        ),
        (
            lambda: parse_quantity("4e31 V s/rad", "V s/rad"),
            UnitError,
            (
                '"4e31 V s/rad" is too large for a quantity; expected a voltage per angular rate with its '
                'unit, for example "5 V s/mrad"'
            ),
        ),
        (
            lambda: parse_quantity("-7e-33 V/rad", "V/rad"),
            UnitError,
            (
                '"-7e-33 V/rad" is too small, and not 0, for a quantity; expected a voltage per angle with '
                'its unit, for example "5 V/mrad"'
            ),
        ),
        (
            lambda: parse_quantity("-1200.5 dBW", "W"),
            UnitError,
            '"-1200.5 dBW" is beyond 1000 dBW; expected a power with its unit, for example "5 W"',
        ),
        (
            lambda: parse_quantity("2.5 mrad/s", "Hz"),
            UnitError,
            (
                '"2.5 mrad/s" is in "mrad/s", another kind of quantity; expected a frequency with its '
                'unit, for example "5 Hz"'
            ),
        ),
        (
            lambda: parse_quantity("7" * 70 + " m", "m"),
            UnitError,
            (
                '"777777777777777777777777777777777777777777777777777777777777…" has 72 characters, too '
                'many for a quantity; expected a length with its unit, for example "5 m"'
            ),
        ),
        (
            lambda: parse_quantity("1.5 m/s kg", "kg/s"),
            UnitError,
            (
                '"1.5 m/s kg" has "m/s kg" where a unit should stand: put what stands below the stroke in '
                'brackets, as in V/(mrad s); expected a quantity in kg/s with its unit, for example "5 '
                'kg/s"'
            ),
        ),
        (
            lambda: parse_quantity("2 A/", "A/W"),
            UnitError,
            (
                '"2 A/" has "A/" where a unit should stand: a unit is missing beside a space or a stroke; '
                'expected a responsivity with its unit, for example "5 A/W"'
            ),
        ),
        (
            lambda: parse_quantity("x 5 m\u200b", "rad/V"),
            UnitError,
            (
                '"x 5 m\\u200b" does not begin with a plain number; expected an angle per voltage with its '
                'unit, for example "5 mrad/V"'
            ),
        ),
        (
            lambda: parse_quantity(-4e17, "W/sr"),
            UnitError,
            ('-4e+17 is a number without a unit; expected a radiant intensity with its unit, for example "5 MW/sr"'),
        ),
    ],
)
def test_a_refusal_says_the_value_its_fault_what_is_wanted_and_an_example(call, error, words):
    with pytest.raises(error) as refused:
        call()
    assert str(refused.value) == words


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (
            lambda: [format_quantity(622.08e6, "bit/s", digits) for digits in (2, 3, 5, 7)],
            ["620 Mbit/s", "622 Mbit/s", "622.08 Mbit/s", "622.08 Mbit/s"],
        ),
        (
            lambda: [
                format_quantity(999.96e-9, "rad"),
                format_quantity(999.94e-9, "rad"),
                format_quantity(0.99996, "V"),
            ],
            ["1 µrad", "999.9 nrad", "1 V"],
        ),
        (
            lambda: [
                format_quantity(1234.5678, "m^2"),
                format_quantity(0.0123456, "m"),
                format_quantity(-7.25e-15, "W"),
            ],
            ["1235 m^2", "12.35 mm", "-0.00725 pW"],
        ),
        (
            lambda: [format_quantity(-12.3456, "dB"), format_quantity(2.5e9, "V/(rad s)"), format_quantity(3.6e5, "K")],
            ["-12.35 dB", "2500 MV/(rad s)", "360000 K"],
        ),
        (
            lambda: [
                format_input(each, "m") for each in (1064.2154e-9, 1.0 / 3.0, 12345.67891, -0.00012345678912, 0.0)
            ],
            ["1.0642154 µm", "333.3 mm", "12.34567891 km", "-123.5 µm", "0 m"],
        ),
    ],
)
def test_a_quantity_is_written_with_its_prefix_and_as_many_digits_as_it_takes(found, expected):
    assert found() == expected


@pytest.mark.parametrize(
    ("limit", "unit", "digits", "most", "least"),
    [
        (387.75e-9, "m", 4, "387.7 nm", "387.8 nm"),
        (0.01, "Hz", 4, "10 mHz", "10 mHz"),
        (0.0102343, "Hz", 4, "10.23 mHz", "10.24 mHz"),
        (-100.0 / 3.0, "V", 4, "-33.34 V", "-33.33 V"),
        (999.96, "Hz", 4, "999.9 Hz", "1 kHz"),
        (1000.4, "s", 3, "1000 s", "1010 s"),
        (0.1 + 0.2, "V", 4, "300 mV", "300 mV"),
        (0.0, "V", 4, "0 V", "0 V"),
        (math.inf, "V", 4, "inf V", "inf V"),
    ],
)
def test_a_limit_is_told_on_the_side_that_is_allowed(limit, unit, digits, most, least):
    assert format_limit(limit, unit, digits) == most
    assert format_limit(limit, unit, digits, least=True) == least


@settings(deadline=None)
@given(st.floats(1e-12, 1e12) | st.floats(-1e12, -1e-12), st.integers(3, 6))
def test_what_a_limit_is_told_as_keeps_it(limit, digits):
    slack = 1e-12 * abs(limit)
    assert parse_quantity(format_limit(limit, "V", digits), "V") <= limit + 2.0 * slack
    assert parse_quantity(format_limit(limit, "V", digits, least=True), "V") >= limit - 2.0 * slack


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (1234.0, 3, "1230"),
        (0.9996, 3, "1"),
        (75_398.2, 4, "75400"),
        (12.0, 1, "10"),
        (2.5e-6, 3, "2.5e-06"),
        (0, 3, "0"),
    ],
)
def test_a_plain_number_has_no_power_of_ten_where_it_is_large(value, digits, text):
    assert units.plain(value, digits) == text


@pytest.mark.parametrize(
    ("unit", "noun", "example"),
    [line.split(" | ") for line in """m | a length | m
kg | a mass | kg
s | a time | s
V | a voltage | V
W | a power | W
Hz | a frequency | Hz
rad | an angle | urad
dB | a ratio in decibels | dB
bit | a volume of data | GB
bit/s | a data rate | Mbit/s
photon/bit | a receiver sensitivity | photon/bit
W/m^2 | an irradiance | W/m^2
W/sr | a radiant intensity | MW/sr
W/(m^3 sr) | a spectral radiance | W/(m^2 sr um)
1/s | a rate per second | 1/s
m/s | a velocity | km/s
V/s | a voltage rate | V/s
rad/V | an angle per voltage | mrad/V
V/rad | a voltage per angle | V/mrad
V/(rad s) | a voltage per angle and time | V/(mrad s)
V s/rad | a voltage per angular rate | V s/mrad
rad/s | an angular rate | urad/s
rad^2/Hz | a spectral density of an angle | urad^2/Hz
rad/Hz^2 | an angle per squared frequency | nrad/Hz^2
A | a current | nA
A/W | a responsivity | A/W
A/sqrt(Hz) | a noise density of a current | pA/sqrt(Hz)
K | a quantity in K | K
rad^3/s | a quantity in rad^3/s | rad^3/s""".splitlines()],
)  # fmt: skip
def test_a_number_alone_is_told_the_kind_that_is_wanted_and_its_usual_unit(unit, noun, example):
    with pytest.raises(UnitError) as refused:
        parse_quantity(2.75, unit)
    said = f'2.75 is a number without a unit; expected {noun} with its unit, for example "2.75 {example}"'
    assert str(refused.value) == said
    assert (refused.value.reason, refused.value.expected) == ("is a number without a unit", f"{noun} with its unit")
    assert units.kind_of(unit) == (noun, example)


@pytest.mark.parametrize(
    ("spelled", "unit", "meant"),
    [
        ("bps", "bit/s", "bit/s"), ("gbps", "bit/s", "Gbit/s"), ("Tbits/s", "bit/s", "Tbit/s"), ("watts", "W", "W"),
        ("mB/s", "bit/s", ""), ("bit/SEC", "bit/s", "bit/s"), ("kbit/sec", "bit/s", "kbit/s"), ("meter", "m", "m"),
        ("metres", "m", "m"), ("Meters", "m", "m"), ("metre", "m", "m"), ("micron", "m", "um"), ("Microns", "m", "um"),
        ("micrometer", "m", "um"), ("micrometres", "m", "um"), ("micrometers", "m", "um"), ("micrometre", "m", "um"),
        ("degree", "rad", "deg"), ("°", "rad", "deg"), ("radian", "rad", "rad"), ("Radians", "rad", "rad"),
        ("microradian", "rad", "urad"), ("microradians", "rad", "urad"), ("volt", "V", "V"), ("Volts", "V", "V"),
        ("sec", "s", "s"), ("secs", "s", "s"), ("second", "s", "s"), ("seconds", "s", "s"), ("hertz", "Hz", "Hz"),
        ("cps", "Hz", "Hz"), ("cps", "rad/s", ""), ("degrees", "m", ""), ("watts", "V", ""), ("dbm", "W", ""),
    ],
)  # fmt: skip
def test_a_unit_that_is_often_spelled_otherwise_is_named_with_the_number_before_it(spelled, unit, meant):
    with pytest.raises(UnitError) as refused:
        parse_quantity(f"-7.25 {spelled}", unit, "typical")
    said = f'"-7.25 {spelled}" has "{spelled}"'
    noun = units.kind_of(unit)[0]
    odd = re.sub("^bit/|/s$", "", spelled)
    said += f", which is written {meant} here" if meant else f' where a unit should stand: no unit is called "{odd}"'
    given = f"-7.25 {meant}" if meant else "5 typical"
    assert str(refused.value) == f'{said}; expected {noun} with its unit, for example "{given}"'
    if meant:
        assert math.isfinite(parse_quantity(refused.value.example, unit))


@pytest.mark.parametrize(
    ("value", "unit", "digits", "text"),
    [
        (9.9996, "kg", 4, "10 kg"), (1500.0, "kg", 3, "1500 kg"), (1e-13, "m", 3, "0.1 pm"), (1e7, "m", 3, "10000 km"),
        (2.5e13, "Hz", 4, "25 THz"), (2.5e16, "Hz", 4, "25000 THz"), (0.05, "Hz", 2, "50 mHz"), (7e6, "W", 2, "7 MW"),
        (2e-6, "Hz", 3, "0.002 mHz"), (7e10, "W", 2, "70 GW"), (0.3, "K", 2, "300 mK"), (4e-5, "K", 2, "0.04 mK"),
        (3e3, "s", 3, "3000 s"), (120.0, "min", 3, "120 min"), (8e9, "bit", 3, "8 Gbit"), (1e6, "V", 3, "1 MV"),
        (2.2e-3, "deg", 3, "2.2 mdeg"), (0.5, "arcsec", 3, "500 marcsec"), (5e-3, "bit/s", 3, "0.005 bit/s"),
        (1e-11, "A/W", 3, "10 pA/W"), (1e4, "A", 3, "10 kA"), (3e-7, "sr", 3, "3e-07 sr"), (1e8, "B", 3, "100 MB"),
        (-math.inf, "m", 3, "-inf m"), (2.5e9, "J", 3, "2.5 GJ"), (4.4e7, "N", 2, "44 MN"), (0.05, "photon", 2,
        "0.05 photon"), (9.5e-4, "V s/rad", 2, "950 µV s/rad"), (0.0095, "day", 2, "0.0095 day"), (5e-5, "h", 2,
        "5e-05 h"), (12.0, "dBm", 3, "12 dBm"), (1e-3, "dB", 3, "0.001 dB"), (9.4e5, "byte", 2, "940 kbyte"),
    ],
)  # fmt: skip
def test_a_prefix_is_one_that_the_unit_takes_and_else_none(value, unit, digits, text):
    assert format_quantity(value, unit, digits) == text


@pytest.mark.parametrize(
    ("text", "kept", "shown"),
    [
        ("a\nb\tc", "", "a\\u000ab\\u0009c"), ("a\nb\tc", "\n", "a\nb\\u0009c"), ("é ✓", "", "é ✓"), ("", "", ""),
        ("\u202eabc\u00a0", "", "\\u202eabc\\u00a0"), ("\u00a0x\u202f\t\n\r", units.BLANKS, "\u00a0x\u202f\t\n\\u000d"),
        ("\x7f\x1b[0m", "", "\\u007f\\u001b[0m"), ("\U0001f600\ue000", "", "\U0001f600\\ue000"),
    ],
)  # fmt: skip
def test_what_steers_a_terminal_is_spelled_out_unless_it_is_kept(text, kept, shown):
    assert units.printable(text, kept) == shown


@pytest.mark.parametrize(
    ("given", "unit", "said", "example"),
    [
        ("x" * 61, "m", f'"{"x" * 60}…" has 61 characters, too many for a quantity', "5 m"),
        ("1 dBW", "dBm", '"1 dBW" is in dBW, another kind of quantity', "5 dBm"),
        ("-1000.5 dBW", "W", '"-1000.5 dBW" is beyond 1000 dBW', "5 W"),
        (b"5 m", "m", "a value of type bytes is not a quantity in quotes", "5 m"),
        (False, "bit/s", "a value of type bool is not a quantity in quotes", "5 Mbit/s"),
        (1j, "rad/V", "a value of type complex is not a quantity in quotes", "5 mrad/V"),
        ("3 \n", "s", '"3 \\u000a" has "\\u000a" where a unit should stand: no unit is called "\\u000a"', "5 s"),
        ("3\tm", "m", '"3\\u0009m" has "\\u0009m" where a unit should stand: no unit is called "\\u0009m"', "5 m"),
        ("-4.5e2", "rad", '"-4.5e2" is a number without a unit', "-4.5e2 urad"),
        ("6 kW", "W/sr", '"6 kW" is in "kW", another kind of quantity', "5 MW/sr"),
        ("6 1/", "s", '"6 1/" has "1/" where a unit should stand: a unit is missing beside a space or a stroke', "5 s"),
        ("6 m^2^2", "m", '"6 m^2^2" has "m^2^2" where a unit should stand: no unit is called "m^2^2"', "5 m"),
    ],
)
def test_a_refused_quantity_is_shown_as_it_stands_with_the_example_of_its_kind(given, unit, said, example):
    with pytest.raises(UnitError) as refused:
        parse_quantity(given, unit)
    assert str(refused.value) == f'{said}; expected {units.kind_of(unit)[0]} with its unit, for example "{example}"'


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("3 V s /mrad", "V s/rad", 3000.0), ("2 min^2", "s^2", 7200.0), ("6 kg m2/s2", "J", 6.0), ("9 J/day", "W",
        9.0 / 86400.0), ("4 GB/h", "bit/s", 32e9 / 3600.0), ("0 dBm", "W", 1e-3), ("-30 dBW", "W", 1e-3), ("5 dBm",
        "dBm", 5.0), ("-7.5 dBW", "dBW", -7.5), ("8 V A", "W", 8.0), ("-0 m", "m", 0.0), ("2 /s", "1/s", None),
        ("2 m/(s s)", "m/s^2", 2.0), ("2 sqrt(m) sqrt(m)", "m", 2.0), ("3 1/(ms mV)", "1/(V s)", 3e6), ("7. m9",
        "m9", 7.0), ("1 arcsec", "rad", math.pi / 648000.0), ("2 rad^2", "sr", 2.0), ("3 nm/pm", "m/m", 3000.0),
    ],
)  # fmt: skip
def test_units_in_any_order_and_power_are_the_same_quantity(text, unit, value):
    if value is None:
        with pytest.raises(UnitError, match="a unit is missing beside a space or a stroke"):
            parse_quantity(text, unit)
    else:
        assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-14, abs=0.0)


@pytest.mark.parametrize(("letters", "shown"), [(59, "x" * 59), (60, "x" * 60), (61, "x" * 60 + "…")])
def test_a_text_is_shown_up_to_as_many_letters_as_a_quantity_may_have(letters, shown):
    with pytest.raises(UnitError) as refused:
        parse_quantity("x" * letters, "m")
    assert str(refused.value).startswith(f'"{shown}" ')


@pytest.mark.parametrize(
    ("value", "unit", "wanted", "read"),
    [
        ("1,064 nm", "m", "1.064 nm", 1.064e-9),
        ("1,000,000 m", "m", "1000000 m", 1e6),
        ("1,000.5 km", "m", "1000.5 km", 1.0005e6),
        ("-12,75 dBm", "W", "-12.75 dBm", 10 ** (-12.75 / 10) * 1e-3),
        ("1,5 furlong", "m", "1.5 m", 1.5),
        ("1,5", "m", "1.5 m", 1.5),
        (1e-40, "m", "5 m", 5.0),
        (5000, "dB", "5 dB", 5.0),
        ("1e400 watt", "W", "5 W", 5.0),
    ],
)
def test_an_example_keeps_what_can_be_kept_of_a_value_and_can_be_read(value, unit, wanted, read):
    with pytest.raises(UnitError) as refused:
        parse_quantity(value, unit)
    assert refused.value.example == wanted and parse_quantity(wanted, unit) == pytest.approx(read, rel=1e-12)


@pytest.mark.parametrize(("value", "told"), [(-0.0, "0 m"), (0.0, "0 m"), (-1e-12, "-1 pm")])
def test_nothing_has_no_sign(value, told):
    assert format_quantity(value, "m") == told


@pytest.mark.parametrize(
    ("value", "limit", "unit", "digits", "told"),
    [
        (5.0, 3.0, "V", 4, "5 V"),
        (2.0 / 3.0, 7.0, "", 3, "0.667"),
        (1.23456, 1.23451, "V", 4, "1.2346 V"),
        (1.23461, 1.23457, "V", 4, "1.23461 V"),  # both are 1.235, and both are 1.2346
        (1.23457, 1.23461, "V", 4, "1.23457 V"),
        (0.0300004, 0.03, "s", 4, "30.0004 ms"),
        (-59.99996, -60.0, "V", 3, "-59.99996 V"),
        (12.3456789012, 12.3456789013, "kg", 4, "12.3456789 kg"),  # ten digits and no more
        (2.0, 2.0, "Hz", 4, "2 Hz"),
    ],
)
def test_what_breaks_a_limit_has_as_many_digits_as_tell_it_from_the_limit(value, limit, unit, digits, told):
    assert units.format_beyond(value, limit, unit, digits) == told
