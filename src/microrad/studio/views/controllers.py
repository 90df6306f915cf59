"""A controller of the mission as the control page asks for it: tuned, its margins, and what its loop does in time.

Controllers of the fine-pointing loop are tuned as the study tunes them; the two of [control] are the paper's PID, as it
stands in the mission, alone and with the inverse ahead of it. Times are in s, angles in rad, drives in V from the bias.
"""

from __future__ import annotations

import hashlib
import math
import threading
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from microrad import mirror
from microrad.core import lti
from microrad.core.arrays import Floats
from microrad.link import arrival_of, tracking_light_w
from microrad.loop import control, controller_study, paper_cases
from microrad.loop import sine_run as simulate
from microrad.loop.controller_study import parts
from microrad.loop.controller_study.designs import families
from microrad.loop.controller_study.results import for_mirror
from microrad.loop.controller_study.scenario import BODY_POINTING, with_mirror
from microrad.loop.disturbance import Reference
from microrad.loop.pointing_loop import ensemble, linear, traces
from microrad.loop.pointing_loop.loop import LoopController, PointingLoop
from microrad.mirror import Variant
from microrad.mission.file import MissionFile, with_contents
from microrad.mission.tables.fine_pointing import FinePointing
from microrad.report.fine_pointing.page import ONE_AXIS, design_cells, designs
from microrad.report.fine_pointing.words import tuned_to
from microrad.report.quantities import micro
from microrad.report.view import Block
from microrad.studio.views.control import PID, PID_INVERSE, WITH, WITHOUT, Answers, Ask, Controller, Curve

_POINTS = 500
_STEP_PERIODS = 6.0  # of the bandwidth
_SHOWN_PERIODS = 2.0
_WARNING = "# Warning: "
_NO_LINEAR_PART = (
    "The mirror has no linear part: its dynamics are not known, and margins and answers are those of one without any."
)


def names(table: FinePointing | None) -> tuple[str, ...]:
    """The controllers that a mission has: of its fine-pointing loop, where it has one, and of [control]."""
    return (*(() if table is None else controller_study.names(table)), PID, PID_INVERSE)


def blocks(found: Mapping[str, Controller | str]) -> tuple[Block, ...]:
    """The report's table of designs, by their names; a text in place of one says why there is none yet."""
    rows = [
        (name, "", each, *_UNKNOWN)
        if isinstance(each, str)
        else (name, micro(each.residual_rad), *design_cells(each.tuned, each.margins, each.bound_by))
        for name, each in found.items()
    ]
    return designs(rows, ONE_AXIS, between=("residual of an axis,\nrms in theory (µrad)",))


_UNKNOWN = ("",) * 8  # margins, and what a design is bound by
_MOST_KEPT = 32
_kept: dict[tuple[str, ...], Controller] = {}
_tuning = threading.Lock()  # two pages that want the same controller tune it once


def controller(file: MissionFile, name: str) -> Controller:
    """A controller of the mission, tuned; takes seconds the first time. Raises ValueError with the reason.

    Args:
        file: the mission.
        name: one of `names`.
    """
    file = with_contents(file)
    inner, named = file.mirror_file, (each.content for each in file.contents)
    digests = ("" if content is None else hashlib.sha256(content).hexdigest() for content in named)
    key = (file.sha256, "" if inner is None else inner.sha256, *digests, name)
    with _tuning:
        if key not in _kept:
            _kept[key] = _controller(file, name)
        while len(_kept) > _MOST_KEPT:
            del _kept[next(iter(_kept))]
        return _kept[key]


def _controller(file: MissionFile, name: str) -> Controller:
    mirrors = mirror.of(file.mission)
    if name in (PID, PID_INVERSE):
        made = _pid(paper_cases.of(file.mission, mirrors), name)
    elif file.mission.fine_pointing is not None and file.mission.fine_pointing.mirror_file is not None:
        raise ValueError(
            "fine_pointing.mirror_file names a mirror of several axes, and this page designs for one: microrad design "
            "has its controllers, and a run of the mission simulates them"
        )
    else:
        made = _fine(controller_study.scene(file, mirrors, tracking_light_w(file), arrival_of(file)), name)
    text = "" if file.mirror_file is None else file.mirror_file.text
    return replace(made, warnings=mirror_warnings(mirrors.table.linear is not None, text))


# ------------------------------------------------------------------------------------------- the fine-pointing loop
def _fine(scene: controller_study.Scene, name: str) -> Controller:
    table = scene.table
    plants = controller_study.plants(scene, table.seed)
    tuned = controller_study.tune(name, table, plants)
    family = next((each for each in families(table) if each.name == name), control.PI)
    units = {each.name: each.unit for each in family.parameters(plants[0])}
    built = controller_study.build(name, scene, tuned.controller)
    half = 0.5 / scene.loop.timing.period_s
    freq = np.geomspace(half * 1e-4, half * 0.999, _POINTS)
    gain, sensitivity = _responses(scene.loop, built, freq)
    return Controller(
        name,
        tuned.margins,
        tuned_to(tuned.values, units),
        tuned.residual_rms_rad,
        tuned.bound_by,
        table.modulus_margin,
        freq,
        gain,
        sensitivity,
        (scene.loop.drive.minimum_v, scene.loop.drive.maximum_v),
        scene.loop.drive_range_v,
        1.0 / scene.loop.timing.period_s,
        scene.loop.optical.field_of_view_rad,
        (),
        partial(_fine_answers, scene, built, tuned.margins.bandwidth_hz),
    )


def mirror_warnings(has_linear_part: bool, text: str) -> tuple[str, ...]:
    """What the mirror leaves out, in sentences: its linear part, and what the head of its own file's text warns of.

    Args:
        has_linear_part: whether the mirror's dynamics are known.
        text: that of the mirror's file, "" without one.
    """
    own = [line.removeprefix(_WARNING) for line in text.splitlines() if line.startswith(_WARNING)]
    told = [] if has_linear_part else [_NO_LINEAR_PART]
    return (*told, *(f"Warning of the mirror's file: {warning}" for warning in own))


def _responses(loop: PointingLoop, of: LoopController, freq: Floats) -> tuple[Floats | None, Floats | None]:
    """Magnitudes of loop gain and sensitivity of axis x, nothing for a sensor that folds frequencies."""
    if loop.optical.every != 1:
        return None, None
    closed = linear.close(loop, of)
    gain, sensitivity = linear.loop_response(closed, freq), linear.sensitivity(closed, freq)
    return np.abs(gain[:, 0, 0]), np.abs(sensitivity[:, 0, 0])


def _fine_answers(
    scene: controller_study.Scene, of: LoopController, bandwidth_hz: float, wanted: Ask, variants: tuple[str, ...]
) -> Answers:
    table = scene.table
    loops = {WITH: scene.loop, WITHOUT: with_mirror(scene.loop, scene.mirrors, Variant.STRAIGHT)}
    chosen = {v: (loops[v], for_mirror(of, loops[v])) for v in variants}
    return Answers(
        {v: _step(*each, wanted, bandwidth_hz) for v, each in chosen.items()},
        {v: _sine(*each, wanted) for v, each in chosen.items()},
        {
            v: _curve(*each, ensemble.Span(table.duration_s, table.settle_s, wanted.seed), table.settle_s)
            for v, each in chosen.items()
        },
    )


def _step(loop: PointingLoop, of: LoopController, wanted: Ask, bandwidth_hz: float) -> Curve:
    """A step of the reference on axis x at time 0, nothing else disturbing."""
    quiet = parts.without(loop, *parts.sources(loop))
    stepped = _first_reference(quiet, Reference(wanted.step_rad, 0.0, 1.0))
    period = loop.timing.period_s
    samples = max(60, round(_STEP_PERIODS / max(bandwidth_hz, 1.0 / (400.0 * period)) / period))
    return _curve(stepped, of, ensemble.Span(samples * period, 0.0, wanted.seed), 0.0)


def _sine(loop: PointingLoop, of: LoopController, wanted: Ask) -> Curve:
    """A sine of the reference on axis x under vibration and noise, body pointing and point-ahead left out."""
    alone = parts.without(loop, parts.REFERENCE, parts.MISALIGNMENT, BODY_POINTING)
    sine = replace(alone.references[0], sine_amplitude_rad=wanted.sine_rad, sine_freq_hz=wanted.sine_hz)
    shown = _SHOWN_PERIODS / wanted.sine_hz
    settle = max(0.4, 1.0 / wanted.sine_hz)
    return _curve(_first_reference(alone, sine), of, ensemble.Span(settle + shown, settle, wanted.seed), settle)


def _first_reference(loop: PointingLoop, first: Reference) -> PointingLoop:
    return replace(loop, references=(first, *loop.references[1:]))


def _curve(loop: PointingLoop, of: LoopController, span: ensemble.Span, from_s: float) -> Curve:
    run = traces.trace(loop, of, span)
    shown = run.time_s >= from_s - 1e-12
    wanted = run.reference_rad[shown]
    error = run.error_rad[shown]
    before = run.disturbance_rad[shown]
    found = wanted + before - error
    return Curve(run.time_s[shown], wanted[:, 0], found[:, 0], error, run.drive_v[shown], wanted + before)


# ------------------------------------------------------------------------------------------- the loop of [control]
def _pid(cases: paper_cases.PaperCases, name: str) -> Controller:
    setup, turned = cases.setup, cases.mirrors.line_of_sight
    plants = {WITH: turned[Variant.GIVEN].plant, WITHOUT: turned[Variant.STRAIGHT].plant}
    found, period = simulate.margins(plants[WITH], setup), setup.timing.period_s
    freq = np.geomspace(0.5e-5 / period, 0.4995 / period, _POINTS)
    L = lti.frequency_response(simulate.sampled_loop(plants[WITH], setup), freq, period)[:, 0, 0]
    return Controller(
        name,
        found,
        "the gains of [control]",
        math.nan,
        (),
        math.nan,
        freq,
        np.abs(L),
        np.abs(1.0 / (1.0 + L)),
        (setup.drive.minimum_v, setup.drive.maximum_v),
        cases.mirrors.drive_range_v,
        1.0 / period,
        math.inf,
        (),
        partial(_pid_answers, name, plants, setup, found.crossover_hz),
    )


def _pid_answers(
    name: str,
    plants: dict[str, mirror.Mirror],
    setup: simulate.Setup,
    crossover_hz: float,
    wanted: Ask,
    variants: tuple[str, ...],
) -> Answers:
    period = setup.timing.period_s
    samples = max(60, round(_STEP_PERIODS / max(crossover_hz, 1.0) / period))
    step = np.full((samples, 1), wanted.step_rad), slice(0, samples)
    sine, _ = simulate.sine(wanted.sine_rad, wanted.sine_hz, period)
    shown = slice(max(sine.shape[0] - round(_SHOWN_PERIODS / wanted.sine_hz / period), 0), sine.shape[0])

    def runs(reference: Floats, shown: slice) -> dict[str, Curve]:
        found = {}
        for v in variants:
            inverse = control.inverse(plants[v]) if name == PID_INVERSE else control.no_feedforward(plants[v])
            found[v] = _tracked(simulate.track(name, plants[v], setup, inverse, reference, shown))
        return found

    return Answers(runs(*step), runs(sine, shown), {})


def _tracked(run: simulate.Trace) -> Curve:
    shown = run.steady
    wanted, found = run.reference_rad[shown, 0], run.output_rad[shown, 0]
    return Curve(run.time_s[shown], wanted, found, run.error_rad[shown], run.drive_v[shown])
