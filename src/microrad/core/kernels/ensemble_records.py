"""What an ensemble is handed: many runs side by side, each array with a row of runs as its last index."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from microrad.core.kernels.compiler import Floats, Indices, Integers
from microrad.core.kernels.records import SLEW_STEP, Rows

# Runs in a row of memory: a count that the compiler knows, so that it works on several of them with one instruction.
LANES = 64

# Bins of the radial error's histogram: sixteen to an octave of its square, from 2^-66 rad^2 (0.1 nrad) to 1 rad^2.
BINS_OCTAVE_BITS = 4
BINS_LOWEST_OCTAVE = -66
BINS = -BINS_LOWEST_OCTAVE << BINS_OCTAVE_BITS
BIN_SHIFT = np.int64(52 - BINS_OCTAVE_BITS)
BIN_OFFSET = np.int64((1023 + BINS_LOWEST_OCTAVE) << BINS_OCTAVE_BITS)

# Fields of a bank element's rows, of an actuator's drive, and of the counters of a run.
BANK_Q, BANK_H, BANK_TRAVEL, BANK_FORCING, BANK_H_BEFORE, BANK_FIELDS = range(6)
DRIVE_BEFORE, DRIVE_NOW, DRIVE_FIELDS = range(3)
(
    COUNT_SATURATED,
    COUNT_SLEW,
    COUNT_CLAMPED,
    COUNT_INVERSE_CLAMPED,
    COUNT_OUTSIDE,
    COUNT_LOST,
    COUNT_FALLBACK,
    COUNT_FIELDS,
) = range(8)

# Columns of the settings of an adaptive inverse, fields of the rows of a play that it learns, and of an actuator's.
(
    CYCLE,
    DELAY,
    GAIN,
    SHARE,
    KEEP,
    DEAD_ZONE,
    SPEED,
    LEAST_SIZE,
    LEAST_TRAVEL,
    LEAST_WEIGHT,
    MOST_WEIGHT,
    OFFSET_LIMIT,
    ADAPTIVE_COLUMNS,
) = range(13)
LEARNT, WEIGHT, SLOPE, NEXT_RECIPROCAL, RECIPROCAL, THRESHOLD, VOLTS, PLAY, PLAY_SUM, MEAN, SWUNG = range(11)
PLAY_FIELDS = SWUNG + 1
SLOW, OFFSET, FAST_SUM, PIVOT, IN_USE, MISFIT, FROZEN_MISFIT, SWING, SIZE, STRIDE, SCRATCH = range(11)
TRACK_FIELDS = SCRATCH + 4

# What was learnt comes into use where its mean square misfit, with the dead zone's square, is below the first share of
# the frozen inverse's misfit, and stays while its misfit is below the second. Readings are suspect where both misfits
# are above a share of the square of what the plays swing.
TAKE_UP, KEEP_UP, SUSPECT = 0.1, 0.25, 0.25

# Columns of an actuator's parameters beyond those of a Loop: the drive's identified range.
DRIVE_LOW, DRIVE_HIGH = SLEW_STEP + 1, SLEW_STEP + 2

# Streams of random numbers: a disturbance's purposes lie below these; a sensor's word c has SENSOR_PURPOSE + c // 4.
SENSOR_PURPOSE = 1 << 28
START_PURPOSE = 1 << 29


class ForwardBank(NamedTuple):
    """Hysteresis that a controller runs on the wanted motion, once a sample; fields as those of `Ensemble`.

    ``step_s`` is the control period. ``drives`` (actuators, elements) are the volts that a unit of each element's
    output adds to the commands; no feedforward has no elements.
    """

    step_s: float
    bouc_wen: Floats
    operator: Floats
    play_start: Indices
    play_threshold: Floats
    play_weight: Floats
    drives: Floats


class ForwardState(NamedTuple):
    """Memory of a `ForwardBank`, rows of runs. ``counts``: as in `EnsembleState`, but begun one row later.

    So what counts as clamped in a plant counts there as COUNT_INVERSE_CLAMPED.
    """

    q: Floats
    z: Floats
    bank: Floats
    play: Floats
    counts: Floats


class Ensemble(NamedTuple):
    """A sampled pointing loop for many runs side by side, as arrays.

    The plant is that of `Plant`, without its counts in the type: one compiled kernel serves every mirror. Its state is
    that of `Plant` less what the end of the step did to it, B1 u + E1 z, so that u and z enter each product once:

        x[k+1] = Ad x[k] + By u[k] + E z[k],   q = F x[k+1] + H z[k] + G u[k+1],   z[k+1] = H[q],
        outputs = Cy x[k+1] + Dy u[k+1] + Ky z[k+1],

    with By = B0 + Ad B1, E = E0 + Ad E1, H = F E1, G = G + F B1, Dy = D + C B1, Ky = K + C E1 of the plant. ``optics``
    (axes, outputs) turns the outputs into line-of-sight angles y. Line-of-sight error e = reference + disturbance - y.

    Disturbance: s[k+1] = As s + Bs g with independent standard normal g (one a source and plant step; ``purpose`` names
    each source's stream), d = Cs s; As by diagonal and neighbour coupling, no rest. Sensors: the optical one delivers e
    of ``sensor_delay_steps`` plant steps ago every ``sensor_every`` samples, with ``optical_noise`` (rms, by axis) and
    ``optical_resolution``, and holds its last reading while the radial error is beyond ``field_of_view``; the gauge
    delivers the plant's outputs with ``gauge_noise`` and ``gauge_resolution``.

    Controller: m = (optical by axis, gauge by output, reference by axis); x[k+1] = A x + B m + L (clip(v) - v), and
    C x + D m = (v by actuator, then, with ``feedforward``, the inverse's target and its rate by actuator, then what
    drives each element of ``forward``); what the inverse makes of the target, and ``forward`` of its drives, is added
    to v ahead of the clip. Rows of ``actuator`` as in `Loop`, then DRIVE_LOW and DRIVE_HIGH, the drive range that the
    mirror was identified in. Inverse as in `Loop`.

    An adaptive inverse (`adapt`) takes the place of the frozen one's plays where ``adaptive`` (actuators; CYCLE ...
    OFFSET_LIMIT) is not empty; behind the rates then stands the gauge's reading less the one that is predicted, by
    actuator. Its plays are those of the mirror: ``adaptive_threshold`` in V, the first of an actuator 0, and
    ``adaptive_weight`` in rad/V at the begin; those of actuator a are from ``adaptive_start[a]`` to the next. No
    controller has both an adaptive inverse and a ``forward``.
    """

    step_s: float
    feedback: bool
    direct: bool
    diagonal: Floats
    coupling: Floats
    rest: Rows
    By: Floats
    E: Floats
    F: Floats
    H: Floats
    G: Floats
    Cy: Floats
    Dy: Floats
    Ky: Floats
    bouc_wen: Floats
    operator: Floats
    play_start: Indices
    play_threshold: Floats
    play_weight: Floats
    optics: Floats
    shaping_diagonal: Floats
    shaping_coupling: Floats
    shaping_noise: Floats
    shaping_output: Floats
    purpose: Indices
    seed: Indices
    steps_per_sample: int
    delay_steps: int
    sensor_delay_steps: int
    sensor_every: int
    optical_noise: Floats
    optical_resolution: float
    field_of_view: float
    gauge_noise: float
    gauge_resolution: float
    feedforward: bool
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    L: Floats
    actuator: Floats
    inverse_direct: Floats
    inverse_bouc_wen: Floats
    inverse_bouc_wen_actuator: Indices
    inverse_play_threshold: Floats
    inverse_play_weight: Floats
    inverse_play_actuator: Indices
    inverse_widening: Floats
    inverse_lag_keep: Floats
    inverse_lag_weight: Floats
    inverse_lag_actuator: Indices
    forward: ForwardBank
    adaptive: Floats
    adaptive_threshold: Floats
    adaptive_weight: Floats
    adaptive_start: Integers


class EnsembleState(NamedTuple):
    """The memory of `LANES` runs; the kernel writes into these arrays. A row of LANES numbers for each quantity.

    ``q`` and ``z`` are the drives and outputs of the hysteresis elements, ``bank`` what they remember (BANK_*).

    ``place``: control sample, plant step, and 1 where statistics are taken. Rows too: ``sum_square`` (axes) and
    ``largest`` (radial error squared) of every plant step, ``sum`` (axes) of the control samples, ``counts`` (COUNT_*).
    ``histogram`` (LANES, BINS) counts the radial error at the end of each control sample.

    Of an adaptive inverse ``learnt`` has PLAY_FIELDS rows for each play (WEIGHT ... SWUNG), and ``track`` TRACK_FIELDS
    for each actuator (OFFSET ... STRIDE).

    ``drawn`` is empty where the runs draw their random numbers themselves. Else it is what `draw_loop` has drawn for
    the control samples of the next call: runs of other controllers and on other mirrors share it.
    """

    first_run: Indices
    place: Integers
    x: Floats
    x_next: Floats
    drive: Floats
    q: Floats
    z: Floats
    bank: Floats
    play: Floats
    y: Floats
    shaping: Floats
    disturbance: Floats
    gauss: Floats
    sensor_gauss: Floats
    error: Floats
    error_ring: Floats
    measured: Floats
    xc: Floats
    xc_next: Floats
    output: Floats
    command: Floats
    target: Floats
    inverse: Floats
    inverse_play: Floats
    inverse_lag: Floats
    forward_z: Floats
    forward_bank: Floats
    forward_play: Floats
    learnt: Floats
    track: Floats
    work: Floats
    sum: Floats
    sum_square: Floats
    largest: Floats
    counts: Floats
    histogram: NDArray[np.int32]
    drawn: Floats


SAMPLE, STEP, COUNTING = range(3)  # of ``place``


class Shift(NamedTuple):
    """What is added to the random numbers of LANES runs from the control sample ``first_sample`` on.

    The disturbances' number of source w at a plant step k from there grows by ``step[k, w]`` @ ``size``, the reading's
    number i (optical by axis, then gauge by output) at a sample by ``sample[k, i]`` @ ``size``. ``size`` has a row of
    runs for each direction, flat (directions x LANES), the others a last index by direction. Behind the end of ``step``
    and ``sample``, which may be empty, the numbers are as they are drawn.
    """

    first_sample: int
    step: Floats
    sample: Floats
    size: Floats


UNSHIFTED = Shift(0, np.zeros((0, 0, 0)), np.zeros((0, 0, 0)), np.zeros(0))
