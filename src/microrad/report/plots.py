"""Results as plots on matplotlib's axes: each function takes a record and draws the sheet that the report has of it.

Each takes `axes` too, one for each of its panels, and gives them back; without them it makes a new figure. Matplotlib
(the extra `plot`) is loaded when something is drawn.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import cycle, product
from typing import Any

import numpy as np

from microrad.core.arrays import Complexes, Floats
from microrad.lab.identify import FrequencyResponseFit, Identification
from microrad.lab.identify.linear.response import FrequencyResponse
from microrad.link.error_budget.assembly import PointingErrorBudget
from microrad.link.study import LinkStudy
from microrad.loop.disturbance.records import Disturbance, band_rms, psd
from microrad.loop.paper_cases import Run
from microrad.loop.pointing_loop.ensemble import Ensemble
from microrad.loop.pointing_loop.traces import PointingTrace
from microrad.loop.sine_run import Trace
from microrad.mirror.hysteresis import HysteresisLoop
from microrad.orbit.day import DayStudy
from microrad.orbit.visibility.contacts import Contact
from microrad.report.day.figures import contacts_figure, spans, timeline
from microrad.report.error_budget import figures as errors
from microrad.report.fine_pointing.figures import cumulative_rms, seen, spectrum_sheet
from microrad.report.identification import figures as identification
from microrad.report.identification.figures import Measured, Modelled, bode, half_width
from microrad.report.paper.figures import loop_look, margin_sheet, study_margin_sheet
from microrad.report.plotting.axes import axes_of
from microrad.report.plotting.palette import BLUE, GREEN, ORANGE, SKY, VERMILION
from microrad.report.plotting.sheet import Axis, Legend, Line, Rule, Sheet, Span, grid
from microrad.report.quantities import micro
from microrad.study.study import Study
from microrad.study.study import margin_map as computed_map

_95 = 1.96  # standard deviations about a normal variable that hold 95 % of it
_FINE = 400  # frequencies of a model's curve beside those of its table
_DENSE = 2000  # frequencies of a disturbance's spectrum
_AROUND = 30.0  # times the corners of a disturbance, to either side
_AXIS_LOOKS = ((BLUE, "-"), (VERMILION, "--"), (GREEN, "-."), (ORANGE, ":"))

_Sheets = Mapping[type, Callable[[Any], Sheet]]


def plot_bode(result: FrequencyResponseFit | FrequencyResponse | Identification, axes: Any = None) -> Any:
    """Gain and phase of a response over frequency, measured and modelled, with 95 % confidence where it is known.

    Args:
        result: the fit of a table, a response measured from recordings, or an identification with a linear part. A fit
            has the confidence of its model, the others that of the measured response. Gains of an identification are
            in µrad/V, the others in units of the output per unit of the input.
        axes: matplotlib's, for gain and phase one after the other, of each pair of output and input in the order of
            the response's elements; None for a new figure.

    Returns:
        The axes, an array of them.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For more or fewer axes than panels, and for an identification without a linear part.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import numpy as np
        import microrad

        freq_hz, gain, phase_deg = np.loadtxt("bode.csv", delimiter=",", skiprows=1, unpack=True)
        fit = microrad.fit_frequency_response(freq_hz, gain * np.exp(1j * np.radians(phase_deg)))
        axes = microrad.plot_bode(fit)
        axes[0].figure.savefig("bode.png")
        ```
    """
    sheets: _Sheets = {
        FrequencyResponseFit: _fit_bode,
        FrequencyResponse: _measured_bode,
        Identification: _identified_bode,
    }
    return axes_of(_sheet("plot_bode", result, sheets), axes)


def plot_loops(result: HysteresisLoop | Sequence[HysteresisLoop] | Identification, axes: Any = None) -> Any:
    """Loops of output over drive, and beside each what a straight line leaves of it, which shows the hysteresis.

    Args:
        result: a loop or several, drawn together; or an identification, whose recordings are drawn one below the
            other (the first 12), measured and by the chosen model.
        axes: matplotlib's, for the loops and for what the line leaves (of each recording); None for a new figure.

    Returns:
        The axes, an array of them.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For no loop, and for more or fewer axes than panels.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import microrad

        plays = microrad.PrandtlIshlinskii(thresholds_v=(0.0, 1.0, 3.0), weights_rad_v=(40e-6, 6e-6, 4e-6))
        axes = microrad.plot_loops([plays.loop(amplitude, freq_hz=1.0) for amplitude in (2.0, 5.0, 10.0)])
        axes[0].figure.savefig("loops.png")
        ```
    """
    sheets: _Sheets = {HysteresisLoop: lambda loop: _loops([loop]), Identification: _identified_loops}
    return axes_of(_sheet("plot_loops", result, sheets, HysteresisLoop, _loops), axes)


def plot_residual(result: Identification | FrequencyResponseFit | Trace | PointingTrace | Run, axes: Any = None) -> Any:
    """What a model or a loop leaves.

    Args:
        result: an identification (measured less modelled over time, a panel for each recording, the first 12), the fit
            of a table (size of table and residual over frequency, a panel for each element), or a run of a loop (its
            error over time).
        axes: matplotlib's, one for each panel; None for a new figure.

    Returns:
        The axes, an array where they are several.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For more or fewer axes than panels.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import numpy as np
        import microrad

        freq_hz, gain, phase_deg = np.loadtxt("bode.csv", delimiter=",", skiprows=1, unpack=True)
        fit = microrad.fit_frequency_response(freq_hz, gain * np.exp(1j * np.radians(phase_deg)))
        microrad.plot_residual(fit)
        ```
    """
    sheets: _Sheets = {
        Identification: lambda found: identification.residuals(identification.shown(found, ())).sheet,
        FrequencyResponseFit: _fit_residual,
        Trace: lambda run: _errors(run.time_s, run.error_rad, run.steady),
        PointingTrace: lambda run: _errors(run.time_s, run.error_rad),
        Run: lambda run: _errors(run.trace.time_s, run.trace.error_rad, run.trace.steady),
    }
    return axes_of(_sheet("plot_residual", result, sheets), axes)


def plot_spectrum(result: Ensemble | Disturbance | PointingErrorBudget, axes: Any = None) -> Any:
    """One-sided spectrum of the line of sight about an axis, and the rms that gathers below each frequency.

    Args:
        result: runs of a pointing loop (each axis of what is left), or a disturbance (its lines stand in the rms, and
            are marked in the spectrum); or a budget of pointing errors (the spectra of its sources about all axes, and
            in place of the rms the weight of each window).
        axes: matplotlib's, for spectrum and rms; None for a new figure.

    Returns:
        The axes, an array of two.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For more or fewer axes than two, for runs that were made without a spectrum, and for a disturbance
            of which poles coincide or that does not move.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import numpy as np
        import microrad

        freq_hz = np.geomspace(0.1, 1000, 200)
        vibration = microrad.fit_spectrum(freq_hz, 160e-12 / (1 + freq_hz**2), convention="radial")
        microrad.plot_spectrum(vibration)
        ```
    """
    sheets: _Sheets = {
        Ensemble: _left_spectrum,
        Disturbance: _disturbance_spectrum,
        PointingErrorBudget: _budget_spectra,
    }
    return axes_of(_sheet("plot_spectrum", result, sheets), axes)


def plot_pointing_errors(result: PointingErrorBudget | Study, axes: Any = None) -> Any:
    """How often each error of a budget is larger than a size, with its limit, and its totals by rules and distribution.

    Args:
        result: a budget of pointing errors, or a study that has one.
        axes: matplotlib's, one for each requirement; None for a new figure.

    Returns:
        The axes, an array where there are several requirements.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For a study without such a budget, and for more or fewer axes than requirements.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import microrad

        study = microrad.run_study(microrad.load_mission("leo-geo.toml"))
        if study.error_budget is not None:
            microrad.plot_pointing_errors(study)
        ```
    """
    sheets: _Sheets = {
        PointingErrorBudget: lambda of: errors.distributions(of.judged).sheet,
        Study: lambda of: errors.distributions(_budget_of(of).judged).sheet,
    }
    return axes_of(_sheet("plot_pointing_errors", result, sheets), axes)


def plot_contributions(result: PointingErrorBudget | Study, axes: Any = None) -> Any:
    """What each source of a budget of pointing errors contributes to each requirement, as bars by its class.

    Args:
        result: a budget of pointing errors, or a study that has one.
        axes: matplotlib's, one for each requirement; None for a new figure.

    Returns:
        The axes, an array where there are several requirements.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For a study without such a budget, and for more or fewer axes than requirements.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import microrad

        study = microrad.run_study(microrad.load_mission("leo-geo.toml"))
        if study.error_budget is not None:
            microrad.plot_contributions(study)
        ```
    """
    sheets: _Sheets = {
        PointingErrorBudget: lambda of: errors.contributions(of.judged).sheet,
        Study: lambda of: errors.contributions(_budget_of(of).judged).sheet,
    }
    return axes_of(_sheet("plot_contributions", result, sheets), axes)


def plot_margin_map(result: Study | LinkStudy, axes: Any = None) -> Any:
    """Margin of the communication link over data rate and pointing error, with the point that is budgeted.

    Args:
        result: a study, whose simulated residual is marked too, or the links alone.
        axes: matplotlib's, beside which the colour bar takes its place; None for a new figure.

    Returns:
        The axes.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For several axes.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import microrad

        microrad.plot_margin_map(microrad.run_study(microrad.load_mission("leo-geo.toml")))
        ```
    """
    sheets: _Sheets = {
        Study: study_margin_sheet,
        LinkStudy: lambda of: margin_sheet(computed_map(of.data, of.file.sources), of.file.mission),
    }
    return axes_of(_sheet("plot_margin_map", result, sheets), axes)


def plot_contacts(result: DayStudy | Sequence[Contact], axes: Any = None) -> Any:
    """Contacts over time as bars, with their number and how long they are together.

    Args:
        result: a day (contacts with the relay and with each station, and the eclipses, a row each), or contacts.
        axes: matplotlib's; None for a new figure.

    Returns:
        The axes.

    Raises:
        TypeError: For another result, and for axes that are none.
        ValueError: For no contact, and for several axes.
        ImportError: Where matplotlib is not installed.

    Example:
        ```python
        import microrad

        leo, relay = microrad.read_elements("satellites.tle")
        microrad.plot_contacts(microrad.find_contacts(leo, relay, start=leo.epoch.text, duration_s=86_400.0))
        ```
    """
    sheets: _Sheets = {DayStudy: lambda day: contacts_figure(day).sheet}
    return axes_of(_sheet("plot_contacts", result, sheets, Contact, _contacts), axes)


def _sheet(
    name: str,
    result: Any,
    sheets: _Sheets,
    each: type | None = None,
    several: Callable[[Any], Sheet] | None = None,
) -> Sheet:
    """The sheet of a result by its type, or of several of a kind.

    Args:
        name: of the function that is asked for it.
        result: what is plotted.
        sheets: what makes the sheet of a record, by its type.
        each: the kind of which there may be several.
        several: what makes the sheet of a sequence of them.
    """
    for kind, made in sheets.items():
        if isinstance(result, kind):
            return made(result)
    taken = [kind.__name__ for kind in sheets]
    if each is not None and several is not None:
        taken.append(f"a sequence of {each.__name__}")
        if isinstance(result, Sequence) and not isinstance(result, str):
            if not result:
                raise ValueError(f"{name}: the sequence is empty; give one {each.__name__} or more")
            if all(isinstance(one, each) for one in result):
                return several(result)
            result = next(one for one in result if not isinstance(one, each))
    raise TypeError(
        f"{name}: cannot plot what is of type {type(result).__name__}; give one of these: {', '.join(taken)}"
    )


# ------------------------------------------------------------------------------------------------------------- response
_GAIN = "output/input"  # the unit of a response whose channels have none


def _bodes(
    names: tuple[Sequence[str], Sequence[str]],
    unit: str,
    curves: Callable[[int, int], tuple[Measured, Modelled | None]],
) -> Sheet:
    """Gain above phase of each element: the outputs one below the other, a column for each input.

    Args:
        names: of the outputs and of the inputs.
        unit: of the gains.
        curves: what is drawn of an output and an input.
    """
    outputs, inputs = names
    down, across = len(outputs), len(inputs)
    sheet = Sheet(max(6.4, 3.4 * across), 4.6 * down, (1.4, 1.0) * down, (1.0,) * across, share_x=True)
    for (row, output), (column, source) in product(enumerate(outputs), enumerate(inputs)):
        size, phase = sheet.panel(2 * row, column), sheet.panel(2 * row + 1, column)
        bode((size, phase), *curves(row, column))
        size.y.title, phase.x.title = f"gain ({unit})", "frequency (Hz)"
        size.title = f"{output} from {source}" if down * across > 1 else ""
    sheet.panels[0].legend = Legend("best")
    return sheet


def _numbered(shape: tuple[int, ...]) -> tuple[list[str], list[str]]:
    """Names of outputs and inputs that have none."""
    return [f"output {k + 1}" for k in range(shape[1])], [f"input {k + 1}" for k in range(shape[2])]


def _fit_bode(fit: FrequencyResponseFit) -> Sheet:
    freq = fit.freq_hz[fit.freq_hz > 0.0]
    table = _table(fit)[fit.freq_hz > 0.0]
    fine = np.union1d(freq, np.geomspace(freq[0], freq[-1], _FINE))
    model, (along, across) = fit.response(fine), (_95 * each for each in fit.response_errors(fine))

    def curves(row: int, column: int) -> tuple[Measured, Modelled]:
        at = (slice(None), row, column)
        return Measured(freq, table[at]), Modelled(fine, model[at], f"model, order {fit.order}", along[at], across[at])

    return _bodes(_numbered(model.shape), _GAIN, curves)


def _table(fit: FrequencyResponseFit) -> Complexes:
    """The table that was fitted."""
    return np.asarray(fit.residual + fit.response(fit.freq_hz))


def _measured_bode(found: FrequencyResponse) -> Sheet:
    half = half_width(found.standard_error)

    def curves(row: int, column: int) -> tuple[Measured, None]:
        return Measured(found.freq_hz, found.response[:, row, column], half[:, row, column]), None

    return _bodes((found.output_names, found.input_names), _GAIN, curves)


def _identified_bode(found: Identification) -> Sheet:
    linear = found.linear
    if linear is None:
        raise ValueError(
            "plot_bode: the identification has no linear part; give identify_mirror a broadband recording (a chirp "
            "or a multisine) and a model with such a part, such as models=('linear',)"
        )
    of = linear.response
    measured, half = 1e6 * of.response[:, 0, 0], 1e6 * half_width(of.standard_error[:, 0, 0])
    model = Modelled(of.freq_hz, measured - 1e6 * linear.residual[:, 0, 0], f"linear model, order {linear.order}")
    return _bodes(([""], [""]), "µrad/V", lambda row, column: (Measured(of.freq_hz, measured, half), model))


def _fit_residual(fit: FrequencyResponseFit) -> Sheet:
    table, (outputs, inputs) = _table(fit), _numbered(fit.residual.shape)
    sheet, panels = grid(max(6.4, 3.4 * len(inputs)), 3.0 * len(outputs), len(outputs), len(inputs), share_x=True)
    for panel, (row, column) in zip(panels, product(range(len(outputs)), range(len(inputs))), strict=True):
        at = (fit.freq_hz > 0.0, row, column)
        look: dict[str, Any] = {"dash": "", "marker": ".", "size": 4.5}
        panel.add(Line(fit.freq_hz[at[0]], np.abs(table[at]), BLUE, label="table", **look))
        panel.add(Line(fit.freq_hz[at[0]], np.abs(fit.residual[at]), ORANGE, label="table less model", **look))
        panel.x, panel.y = Axis("frequency (Hz)", log=True), Axis(f"size ({_GAIN})", log=True)
        panel.title = f"{outputs[row]} from {inputs[column]}" if len(panels) > 1 else ""
    panels[0].legend = Legend("best")
    return sheet


# ----------------------------------------------------------------------------------------------------- loops and errors
def _loops(loops: Sequence[HysteresisLoop]) -> Sheet:
    sheet, (left, right) = grid(7.4, 3.6, 1, 2)
    for place, loop in enumerate(loops):
        look = loop_look(place)
        line = np.polyval(np.polyfit(loop.drive_v, loop.output_rad, 1), loop.drive_v)
        left.add(Line(loop.drive_v, loop.output_rad * 1e3, *look, label=f"{loop.freq_hz:g} Hz"))
        right.add(Line(loop.drive_v, (loop.output_rad - line) * 1e6, *look, name=f"{loop.freq_hz:g} Hz"))
    left.x.title = right.x.title = "drive about the bias (V)"
    left.y.title, right.y.title = "output (mrad)", "output less line (µrad)"
    left.legend = Legend("best")
    return sheet


def _identified_loops(found: Identification) -> Sheet:
    return identification.loops(identification.shown(found, ()), found).sheet


def _errors(time_s: Floats, error_rad: Floats, steady: slice = slice(None)) -> Sheet:
    """Errors (samples, axes) over time, the part that statistics are taken of shaded where it is not all."""
    sheet, (panel,) = grid(6.4, 3.4)
    if steady != slice(None):
        first_s, last_s = time_s[steady][[0, -1]].tolist()
        panel.add(Span(first_s, last_s, True, SKY, 0.25, "steady part"))
    for axis, (error, look) in enumerate(zip(error_rad.T, cycle(_AXIS_LOOKS))):
        rms = micro(float(np.sqrt(np.mean(error[steady] ** 2))))
        panel.add(Line(time_s, 1e6 * error, *look, width=0.8, label=f"axis {axis + 1}: rms {rms} µrad"))
    panel.x, panel.y, panel.legend = Axis("time (s)"), Axis("pointing error (µrad)"), Legend("above", 3)
    return sheet


# -------------------------------------------------------------------------------------------------------------- spectra
def _left_spectrum(runs: Ensemble) -> Sheet:
    if not np.all(np.isfinite(runs.psd_rad2_hz)):
        raise ValueError(
            "plot_spectrum: these runs were made without a spectrum; simulate them from run 0 on, as a Case with "
            "spectrum=True"
        )
    inner = slice(1, -1)  # neither the mean nor half the control rate
    freq = runs.freq_hz[inner]
    sheet, left, right = spectrum_sheet(freq)
    for axis, (density, look) in enumerate(zip(runs.psd_rad2_hz[inner].T, cycle(_AXIS_LOOKS))):
        left.add(Line(*seen(freq, 1e12 * density), *look, label=f"axis {axis + 1}"))
        right.add(Line(*seen(freq, 1e6 * cumulative_rms(freq, density)), *look, name=f"axis {axis + 1}"))
    return sheet


def _disturbance_spectrum(of: Disturbance) -> Sheet:
    """From well below its slowest corner or line to well above its fastest one."""
    lines_hz = np.array([line.freq_hz for line in of.lines])
    corners = np.concatenate([np.abs(np.linalg.eigvals(of.A)) / (2.0 * np.pi), lines_hz])
    if not corners.size:
        raise ValueError(f'plot_spectrum: "{of.name}" has neither a filter nor lines, so nothing moves')
    freq = np.geomspace(corners.min() / _AROUND, _AROUND * corners.max(), _DENSE)
    sheet, left, right = spectrum_sheet(freq)
    if of.A.size:
        left.add(Line(freq, 1e12 * psd(of, freq), BLUE, label=of.name))
    left.add(*(Rule(each, True, VERMILION, ":", label="spectral lines") for each in lines_hz.tolist()))
    below = np.sqrt(np.cumsum(band_rms(of, np.concatenate([[0.0], freq])) ** 2))
    right.add(Line(freq, 1e6 * below, BLUE, name=of.name))
    return sheet


def _budget_spectra(budget: PointingErrorBudget) -> Sheet:
    if not budget.spectra:
        raise ValueError("plot_spectrum: no source of this budget has a spectrum: none is a process or a loop")
    return errors.spectra(budget).sheet


def _budget_of(study: Study) -> PointingErrorBudget:
    if study.error_budget is None:
        raise ValueError("the study has no budget of pointing errors: its mission has no table [error_budget]")
    return study.error_budget


# ------------------------------------------------------------------------------------------------------------- contacts
def _contacts(contacts: Sequence[Contact]) -> Sheet:
    end_s = max(contact.end_s for contact in contacts)
    span = min(contact.start_s for contact in contacts), end_s
    return timeline([("contacts", spans(contacts, end_s))], span, "the epoch").sheet
