"""What a receiver adds to a budget: the power that it needs, what that has of its light and its lock, and capacity."""

import math
from collections.abc import Callable
from dataclasses import replace

from microrad.core.budget import Line
from microrad.core.units import format_input, format_quantity
from microrad.link import gains
from microrad.link.budget.assembly import DataLink, at_capacity, rate_at_power, required_dbm
from microrad.link.receivers import (
    BpskHeterodyne,
    BpskHomodyne,
    OokApd,
    OokCounting,
    OokPin,
    OokPreamplified,
    QpskHeterodyne,
    QpskHomodyne,
    Receiver,
)
from microrad.mission.tables.link import Communication

GIVEN = "whatever the pointing error and the data rate"
NOT_GIVEN = "not given"
LEFT_AT_ZERO = "left at 0 dB"
"""The warning of a loss that is stated as nothing."""
ROUNDING_DB = 1e-9
"""Of a link whose rate is solved for 0 dB."""
INTER_SYMBOL_LOSS, EXTINCTION_PENALTY = "Inter-symbol loss", "Extinction penalty"
PHASE_PENALTY = "Phase error penalty"

SourceOf = Callable[[str], str]


def inter_symbol_lines(beam: Communication, source_of: SourceOf) -> tuple[Line, ...]:
    """What interference between symbols costs a receiver that is given by what it is made of.

    Args:
        beam: The table on the communication link.
        source_of: Gives the source of a key of that table.
    """
    if beam.receiver is None:
        return ()
    loss = beam.receiver.inter_symbol_loss_db
    if loss is None:
        return (Line(INTER_SYMBOL_LOSS, 0.0, "dB", "taken as none", NOT_GIVEN, GIVEN, LEFT_AT_ZERO),)
    source, doubt = source_of("receiver.inter_symbol_loss"), "" if loss else LEFT_AT_ZERO
    return (Line(INTER_SYMBOL_LOSS, 0.0 - loss, "dB", "as given", source, GIVEN, doubt),)


def required_lines(
    data: DataLink, rate_bit_s: float, rate_source: str, source_of: SourceOf, received_dbm: float
) -> tuple[Line, ...]:
    """The power that the receiver needs, behind what its light and its phase lock add to it.

    Args:
        data: The communication link.
        rate_bit_s: Data rate, in bit/s.
        rate_source: Where the data rate comes from.
        source_of: Gives the source of a key of the table on the communication link.
        received_dbm: Power at the receiver, in dBm, which is held against capacity.

    Raises:
        ValueError: For a data rate that the receiver does not take.
    """
    beam, level = data.table, float(required_dbm(data, rate_bit_s))
    rate = f"R = {format_input(rate_bit_s, 'bit/s')}"
    if beam.receiver is None:
        sensitivity = format_input(beam.receiver_sensitivity_photon_bit or math.nan, "photon/bit")
        basis, key = f"n (h c / lambda) R, n = {sensitivity}, {rate}", "receiver_sensitivity"
        regime = "sensitivity the same at every data rate"
        return (Line("Required power", level, "dBm", basis, f"{source_of(key)}; {rate_source}", regime),)
    r = beam.receiver
    photons = gains.watt(level) / gains.photon_energy_j(beam.wavelength_m) / rate_bit_s
    code, gain_db, named = r.named_code, r.net_gain_db, ""
    source, regime = source_of("receiver.modulation"), "noise of the receiver as given, white"
    if code is not None:
        assert data.receiver is not None
        gain_db, named = float(f"{float(data.receiver.net_gain_db(rate_bit_s)):.4g}"), f" of {code.name}"
        source, regime = f"{source}; {code.source}", f"{regime}; {code.regime}"
    basis = (
        f"{r.modulation.upper()}, {r.detector}: {photons:.4g} photon/bit at a bit error ratio of "
        f"{r.bit_error_ratio:g}, code gain{named} {gain_db:g} dB, {rate}"
    )
    doubt = _beyond_capacity(data, rate_bit_s, level, received_dbm)
    required = Line("Required power", level, "dBm", basis, f"{source}; {rate_source}", regime, doubt)
    return (*_penalties(data, rate_bit_s, level, source_of), required)


def _penalties(data: DataLink, rate_bit_s: float, level_dbm: float, source_of: SourceOf) -> tuple[Line, ...]:
    """What extinction or a phase error add to the required power, each against the same receiver without it."""
    table, receiver = data.table.receiver, data.receiver
    assert table is not None
    match receiver:
        case OokCounting() | OokPin() | OokApd() | OokPreamplified():
            name, key, given = EXTINCTION_PENALTY, "receiver.extinction_ratio", table.extinction_ratio_db
            clean: Receiver = replace(receiver, extinction_ratio=math.inf)
            without, regime = "spaces were dark", "extinction ratio as given, the best threshold"
        case BpskHomodyne() | BpskHeterodyne() | QpskHomodyne() | QpskHeterodyne():
            name, key, given = PHASE_PENALTY, "receiver.phase_error", table.phase_error_rad
            clean = replace(receiver, phase_error_rad=0.0)
            without, regime = "the phase were right", "Gaussian phase error that rests during a symbol"
        case _:
            return ()
    if not given:
        source, why = (NOT_GIVEN, "taken as none") if given is None else (source_of(key), "as given")
        return (Line(name, 0.0, "dB", why, source, regime, LEFT_AT_ZERO),)
    dark_dbm = gains.dbm(float(clean.required_power_w(rate_bit_s)))
    basis = f"a part of the required power below, which would be {dark_dbm:.2f} dBm if {without}"
    return (Line(name, level_dbm - dark_dbm, "dB", basis, source_of(key), regime),)


def _beyond_capacity(data: DataLink, rate_bit_s: float, level_dbm: float, received_dbm: float) -> str:
    """The warning that less power is taken for enough, or arrives, than capacity asks for at this data rate."""
    best = at_capacity(data, rate_bit_s)
    least_dbm = gains.dbm(float(best.required_power_w(rate_bit_s)))
    if level_dbm < least_dbm - ROUNDING_DB:
        return f"less than the {least_dbm:.2f} dBm that capacity asks for: no code of this rate does with it"
    if received_dbm >= least_dbm - ROUNDING_DB:
        return ""
    return (
        f"the data rate is above capacity: no code of this rate does with less than {least_dbm:.2f} dBm; of the "
        f"received power it makes {_possible_rate(best, received_dbm)}"
    )


def _possible_rate(best: Receiver, received_dbm: float) -> str:
    rate = rate_at_power(best, received_dbm)
    return "nothing" if rate is None else f"at most {format_quantity(rate, 'bit/s')}"
