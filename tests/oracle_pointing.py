"""Slow, obvious twin of the ensemble kernel: random numbers word by word, and one run of a pointing loop at a time.

Written from the description, not from the kernel: the whole history in lists, dense matrices, libm's functions. The
mirror and the steps of hysteresis are those of ``oracles``. The builders at the end are the only lines that know the
kernel's records.
"""

from itertools import pairwise
from math import cos, exp, floor, hypot, log, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

import oracles
from microrad.core import kernels

# ------------------------------------------------------------------------------------------------ random numbers

WORD = 1 << 32


def philox(counter, key):
    """Philox 4x32-10: Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11, 2011."""
    a, b, c, d = counter
    left, right = key
    for _ in range(10):
        high0, low0 = divmod(0xD2511F53 * a, WORD)
        high1, low1 = divmod(0xCD9E8D57 * c, WORD)
        a, b, c, d = high1 ^ b ^ left, low1, high0 ^ d ^ right, low0
        left, right = (left + 0x9E3779B9) % WORD, (right + 0xBB67AE85) % WORD
    return a, b, c, d


def box_muller(words):
    """Four standard normal numbers from four words (Box and Muller, Ann. Math. Stat. 29 (1958) 610)."""
    a, b, c, d = ((word + 0.5) / WORD for word in words)
    first, second = sqrt(-2.0 * log(a)), sqrt(-2.0 * log(c))
    return (
        first * cos(2.0 * pi * b),
        first * sin(2.0 * pi * b),
        second * cos(2.0 * pi * d),
        second * sin(2.0 * pi * d),
    )


def gaussian(seed, run, purpose, number):
    """The standard normal number of that place in the stream of a seed, a run and a purpose."""
    block, word = divmod(number, 4)
    counter = (block % WORD, block // WORD % WORD, run % WORD, purpose)
    return box_muller(philox(counter, (seed % WORD, seed // WORD)))[word]


# ------------------------------------------------------------------------------------------------ the pointing loop


class Pointing(NamedTuple):
    """A pointing loop. ``loop`` has the controller with the inputs (optical, gauge, reference), limits and inverse.

    ``forward`` is hysteresis alone, whose drives are the last outputs of the controller; its own outputs (V) are added
    to the commands. Shaping filter: s[k+1] = As s[k] + Bs g[k] every plant step, disturbance = Cs s.
    """

    mirror: oracles.Mirror
    step_s: float
    loop: oracles.Loop
    optics: np.ndarray
    feedforward: bool
    As: np.ndarray
    Bs: np.ndarray
    Cs: np.ndarray
    purpose: tuple[int, ...]
    seed: int
    sensor_delay_steps: int
    sensor_every: int
    optical_noise: tuple[float, ...]
    optical_resolution: float
    field_of_view: float
    gauge_noise: float
    gauge_resolution: float
    drive_low: np.ndarray
    drive_high: np.ndarray
    forward: oracles.Mirror
    adaptive: "Adaptive | None" = None

    @property
    def axes(self):
        return len(self.optics)

    @property
    def actuators(self):
        return self.mirror.B.shape[1]


def quiet_pointing(mirror, step_s, optics, controllers=0, feedforward=False):
    """A loop without controller, disturbance, noise, delay or limits around a mirror."""
    axes, outputs = np.shape(optics)
    actuators = mirror.B.shape[1]
    inputs, rows = 2 * axes + outputs, actuators * (3 if feedforward else 1)
    idle = oracles.idle_loop(actuators, inputs, controllers)
    return Pointing(
        mirror=mirror,
        step_s=step_s,
        loop=idle._replace(Cc=np.zeros((rows, controllers)), Dc=np.zeros((rows, inputs))),
        optics=np.array(optics, dtype=float),
        feedforward=feedforward,
        As=np.zeros((0, 0)),
        Bs=np.zeros((0, 0)),
        Cs=np.zeros((axes, 0)),
        purpose=(),
        seed=0,
        sensor_delay_steps=0,
        sensor_every=1,
        optical_noise=(0.0,) * axes,
        optical_resolution=0.0,
        field_of_view=np.inf,
        gauge_noise=0.0,
        gauge_resolution=0.0,
        drive_low=np.full(actuators, -np.inf),
        drive_high=np.full(actuators, np.inf),
        forward=oracles.compose(actuators=0, outputs=actuators),
    )


def nearest(value, resolution):
    """The nearest multiple of the resolution, the upper one of two; 0 is an ideal converter."""
    return value if resolution == 0.0 else floor(value / resolution + 0.5) * resolution


def within(value, low, high):
    return min(max(value, low), high)


def bouc_wen_travel(row, h, travel, c):
    """h after a travel of the element's drive, the rate in the exponential being ``c``, whatever took the time."""
    if row.exponent != 1.0:
        solution = oracles.solve_ivp(
            lambda _, h: [oracles.hysteresis_slope(row, travel, c, h[0])],
            (0, 1),
            [h],
            method="DOP853",
            rtol=1e-12,
            atol=1e-15 * max(abs(row.epsilon), 1e-9) / row.alpha,
        )
        assert solution.success, solution.message
        return float(solution.y[0, -1])
    growth = row.epsilon * exp(row.delta * abs(c))
    return oracles.bouc_wen_step(h, travel, growth, row.alpha, row.beta, row.gamma, row.eta)


class TargetInverse(oracles.InverseTwin):
    """The inverse of ``oracles``, for actuator targets that come with their rate instead of its difference."""

    def follow(self, target, rate):
        loop = self.loop
        target = np.array(target, dtype=float)
        for x, (weight, _, actuator) in zip(self.lag, loop.inverse_creep, strict=True):
            target[actuator] -= weight * x
        u = loop.inverse_direct * target
        for i, row in enumerate(self.rows):
            a = loop.inverse_bouc_wen_actuator[i]
            c, beyond = oracles.clamped_rate(rate[a] / row.d1, row.rate_limit)
            self.clamped[i] += beyond
            self.h[i] = bouc_wen_travel(row, self.h[i], float(target[a] - self.target[a]) / row.d1, c)
            static = target[a] - self.h[i] + row.d1 * row.bias
            u[a] += static / (row.d1 * exp(-row.d2 * c)) - row.bias
        for a, (_, limit) in enumerate(loop.inverse_widening):
            self.clamped[len(self.rows) + a] += oracles.clamped_rate(rate[a], limit)[1]
        for i, a in enumerate(loop.inverse_play_actuator):
            growth, limit = loop.inverse_widening[a]
            c, _ = oracles.clamped_rate(rate[a], limit)
            threshold = oracles.widened(loop.inverse_play_threshold[i], growth, c)
            self.p[i] = oracles.play(self.p[i], target[a], threshold)
            u[a] += loop.inverse_play_weight[i] * self.p[i]
        self.lag = [
            x + (u[a] - x) * (1.0 - exp(-self.sample_s / tau))
            for x, (_, tau, a) in zip(self.lag, loop.inverse_creep, strict=True)
        ]
        self.target = target
        return u


class Adaptive(NamedTuple):
    """What an adaptive inverse of one actuator starts from, and how it learns; V, rad, and shares a sample or a look.

    ``forgotten`` is what a mean over looks loses of itself at each, ``slow`` what the slow error follows a sample.
    """

    thresholds: tuple[float, ...]
    weights: tuple[float, ...]
    cycle: int
    delay: int
    gain: float
    slow: float
    forgotten: float
    dead_zone: float
    speed: float
    least_size: float
    least_travel: float
    least_weight: float
    most_weight: float
    offset_limit: float


class LearningInverse:
    """The inverse of play operators whose weights are learnt, for one actuator: from the mirror's plays themselves.

    Its memory are the plays p of the drive, and the drive for a target is found by bisection of the model's output,
    which rises with the drive. What was learnt counts from the begin of a cycle on.
    """

    def __init__(self, of):
        n = len(of.weights)
        self.of, self.k, self.fallbacks = of, 0, 0
        self.p, self.mean, self.swung = np.zeros(n), np.zeros(n), np.zeros(n)
        self.learnt, self.used, self.coming = (np.array(of.weights) for _ in range(3))
        self.slow = self.offset = self.pivot = self.stride = 0.0
        self.in_use = False
        self.misfit = self.frozen_misfit = self.swing = self.size = 0.0
        self.plays, self.errors = [], []

    def model(self, u):
        plays = [oracles.play(p, u, r) for p, r in zip(self.p, self.of.thresholds, strict=True)]
        return self.used @ plays, np.array(plays)

    def drive(self, target):
        low, high = -1e3, 1e3
        for _ in range(70):
            middle = (low + high) / 2
            low, high = (middle, high) if self.model(middle)[0] < target else (low, middle)
        return (low + high) / 2

    def beyond(self, e):
        return e - within(e, -self.of.dead_zone, self.of.dead_zone)

    def averaged(self, before, new):
        return before + self.of.forgotten * (new - before)

    def look(self):
        plays = np.mean(self.plays, axis=0) if self.plays else np.zeros(len(self.p))
        self.plays = []
        self.used = self.coming.copy()
        self.slow, self.offset, self.pivot = self.slow + self.pivot, self.offset + self.pivot, 0.0
        self.mean = self.averaged(self.mean, plays)
        swung = plays - self.mean
        self.swung = np.where(np.abs(swung) > self.of.least_travel, swung, 0.0)

    def judge(self):
        of, q = self.of, self.swung
        fast = sum(self.errors) / of.cycle  # the first window is short
        self.errors = []
        e = self.beyond(fast + (self.used - self.learnt) @ q)
        e_frozen = self.beyond(fast + (self.used - of.weights) @ q)
        self.misfit = self.averaged(self.misfit, e**2)
        self.frozen_misfit = self.averaged(self.frozen_misfit, e_frozen**2)
        self.swing = self.averaged(self.swing, (np.array(of.weights) @ q) ** 2)
        self.size = self.averaged(self.size, q @ q)
        suspect = min(self.misfit, self.frozen_misfit) > 0.25 * self.swing
        ten_times_better = self.misfit + of.dead_zone**2 < 0.1 * self.frozen_misfit
        still_better = self.in_use and self.misfit <= 0.25 * self.frozen_misfit
        before, self.in_use = self.in_use, (ten_times_better or still_better) and not suspect
        self.fallbacks += before and not self.in_use
        self.stride = 0.0 if suspect else of.gain * e / (max(self.size, q @ q) + of.least_size)

    def learn(self, j):
        of = self.of
        change = within(self.stride * self.swung[j], -of.speed, of.speed)
        self.learnt[j] = within(self.learnt[j] + change, of.least_weight if j == 0 else 0.0, of.most_weight)
        goal = self.learnt[j] if self.in_use else of.weights[j]
        move = within(goal - self.coming[j], -of.speed, of.speed)
        self.coming[j] += move
        self.pivot -= move * self.mean[j]

    def follow(self, target, error):
        """Drive for a target without creep, and the error of the prediction that was read in this sample."""
        of, phase = self.of, self.k % self.of.cycle
        if phase == 0:
            self.look()
        if phase == of.delay:
            self.judge()
        if of.delay < phase <= of.delay + len(self.p):
            self.learn(phase - of.delay - 1)
        fast = error + self.offset - self.slow
        self.errors.append(fast)
        self.slow = within(self.slow + of.slow * fast, -of.offset_limit, of.offset_limit)
        self.offset += of.slow * ((self.slow if self.in_use else 0.0) - self.offset)
        u = self.drive(target - self.offset)
        self.p = self.model(u)[1]
        self.plays.append(self.p)
        self.k += 1
        return u


class Counts(NamedTuple):
    """What a run counted: by actuator and sample or plant step, summed over actuators and elements."""

    saturated: int
    slew: int
    clamped: int
    inverse_clamped: int
    outside: int
    lost: int
    fallback: int


class PointingTwin:
    """One run from rest. ``errors`` has the line-of-sight error at every plant step, the begin of the run first.

    ``crossings`` counts the plant steps within which the memory of a Bouc-Wen element changed its sign.
    """

    def __init__(self, case, run, shaping, reference, shift=kernels.UNSHIFTED):
        """``shift`` is the kernel's record with the sizes of this run alone, by direction."""
        self.case, self.run, self.shift = case, run, shift
        self.mirror = oracles.MirrorTwin(case.mirror, case.step_s)
        self.inverse = TargetInverse(case.loop, case.step_s * case.loop.steps_per_sample)
        self.forward = oracles.MirrorTwin(case.forward, case.step_s * case.loop.steps_per_sample)
        self.learning = LearningInverse(case.adaptive) if case.adaptive else None
        self.s = np.array(shaping, dtype=float)
        self.xc = np.zeros(len(case.loop.Ac))
        self.optical = np.zeros(case.axes)
        self.errors = [np.array(reference) + case.Cs @ self.s]
        self.drives = [np.zeros(case.actuators)]
        self.issued = []
        self.samples = []
        self.saturated = self.slew = self.outside = self.lost = self.crossings = 0

    def sensor_noise(self, k, c):
        drawn = gaussian(self.case.seed, self.run, kernels.SENSOR_PURPOSE + c // 4, 4 * k + c % 4)
        at = k - self.shift.first_sample
        return drawn + (self.shift.sample[at, c] @ self.shift.size if 0 <= at < len(self.shift.sample) else 0.0)

    def vibration_noise(self, k):
        """Standard normal numbers of the disturbances, by source, at plant step ``k``."""
        drawn = np.array([gaussian(self.case.seed, self.run, purpose, k) for purpose in self.case.purpose])
        at = k - self.shift.first_sample * self.case.loop.steps_per_sample
        return drawn + (self.shift.step[at] @ self.shift.size if 0 <= at < len(self.shift.step) else 0.0)

    def measure(self, k, reference):
        """Optical reading by axis, gauge reading by output, reference by axis."""
        case, axes = self.case, self.case.axes
        if k % case.sensor_every == 0:
            seen = self.errors[max(0, len(self.errors) - 1 - case.sensor_delay_steps)]
            if hypot(*seen) > case.field_of_view:
                self.lost += 1
            else:
                noise = [rms * self.sensor_noise(k, i) for i, rms in enumerate(case.optical_noise)]
                self.optical = np.array([nearest(e, case.optical_resolution) for e in seen + noise])
        y = self.mirror.output()
        noisy = [v + case.gauge_noise * self.sensor_noise(k, axes + i) for i, v in enumerate(y)]
        gauge = [nearest(v, case.gauge_resolution) for v in noisy]
        return np.concatenate([self.optical, gauge, reference])

    def control(self, m):
        """Command by actuator, from what was measured."""
        loop, n = self.case.loop, self.case.actuators
        wanted = loop.Cc @ self.xc + loop.Dc @ m
        v = wanted[:n]
        if self.learning:
            v = v + self.learning.follow(wanted[n], wanted[3 * n])
        elif self.case.feedforward:
            v = v + self.inverse.follow(wanted[n : 2 * n], wanted[2 * n : 3 * n])
        self.forward.step(wanted[len(wanted) - len(self.forward.q) :])
        v = v + self.forward.output()
        clipped = np.array([within(*limits) for limits in zip(v, loop.command_min, loop.command_max, strict=True)])
        self.saturated += int(np.sum(clipped != v))
        self.xc = loop.Ac @ self.xc + loop.Bc @ m + loop.L @ (clipped - v)
        return np.array([nearest(value, d) for value, d in zip(clipped, loop.drive_resolution, strict=True)])

    def amplifier(self, j):
        """Drive at the end of plant step ``j`` of a sample."""
        case, loop = self.case, self.case.loop
        late = len(self.issued) - 1 + (j - loop.delay_steps) // loop.steps_per_sample
        command = self.issued[late] if late >= 0 else np.zeros(case.actuators)
        u = []
        for a, last in enumerate(self.drives[-1]):
            move = (command[a] - last) * loop.amplifier_factor[a]
            limited = within(move, -loop.slew_step[a], loop.slew_step[a])
            self.slew += int(limited != move)
            u.append(last + limited)
            self.outside += int(not case.drive_low[a] <= u[a] <= case.drive_high[a])
        return np.array(u)

    def plant_step(self, j, reference):
        case, k = self.case, len(self.errors) - 1
        self.drives.append(self.amplifier(j))
        before = list(self.mirror.h)
        self.mirror.step(self.drives[-1])
        self.crossings += sum(h * h_next < 0.0 for h, h_next in zip(before, self.mirror.h, strict=True))
        self.s = case.As @ self.s + case.Bs @ self.vibration_noise(k)
        self.errors.append(reference + case.Cs @ self.s - case.optics @ self.mirror.output())

    def sample(self, reference, reference_next):
        """One control sample. Keeps its error and, in the order of the kernel's trace, everything else."""
        m = self.measure(len(self.samples), reference)
        last = self.drives[-2] if len(self.drives) > 1 else self.drives[-1]
        drives = np.column_stack([last, self.drives[-1]]).ravel()
        trace = np.concatenate([self.case.Cs @ self.s, drives, self.mirror.output(), m])
        self.samples.append((self.errors[-1], trace))
        self.issued.append(self.control(m))
        steps = self.case.loop.steps_per_sample
        for j in range(steps):
            self.plant_step(j, reference + (reference_next - reference) * (j + 1) / steps)

    def counts(self):
        clamped, inverse = sum(self.mirror.clamped), sum(self.inverse.clamped) + sum(self.forward.clamped)
        fallbacks = self.learning.fallbacks if self.learning else 0
        return Counts(self.saturated, self.slew, clamped, inverse, self.outside, self.lost, fallbacks)


def run_twin(case, run, shaping, reference, shift=kernels.UNSHIFTED):
    """One run over the control samples of ``reference`` (samples + 1, axes)."""
    twin = PointingTwin(case, run, shaping, reference[0], shift)
    for now, after in pairwise(reference):
        twin.sample(now, after)
    return twin


# ------------------------------------------------------------------------------------------------ the kernel's records


def in_pairs(matrix):
    """Diagonal and neighbour coupling of a matrix that has nothing else, with an even number of states."""
    even = len(matrix) + len(matrix) % 2
    whole = np.zeros((even, even))
    whole[: len(matrix), : len(matrix)] = matrix
    partner = np.arange(even) ^ 1
    diagonal, coupling = np.diag(whole).copy(), whole[np.arange(even), partner]
    whole[np.arange(even), np.arange(even)] = whole[np.arange(even), partner] = 0.0
    assert not whole.any()
    return diagonal, coupling


def padded(matrix, rows=0, columns=0):
    """A matrix with zeros below and beside it, up to at least that size."""
    height, width = np.shape(matrix)
    return np.pad(np.asarray(matrix, dtype=float), ((0, max(rows - height, 0)), (0, max(columns - width, 0))))


def build_ensemble(case):
    """The kernel's record of a pointing loop."""
    loop = case.loop
    plant, _ = oracles.build_plant(case.mirror, case.step_s)
    Ad = oracles.first_order_hold(case.mirror.A, case.mirror.E, case.step_s)[0]
    record, _ = oracles.build_loop(loop, case.step_s)
    states = plant.diagonal.size
    diagonal, coupling = in_pairs(case.As)
    return kernels.Ensemble(
        step_s=plant.step_s,
        feedback=plant.feedback,
        direct=plant.direct,
        diagonal=plant.diagonal,
        coupling=plant.coupling,
        rest=plant.rest,
        By=padded(plant.B0 + Ad @ plant.B1, rows=states),
        E=padded(plant.E_held - plant.E1 + Ad @ plant.E1, rows=states),
        F=padded(plant.F, columns=states),
        H=plant.F @ plant.E1,
        G=plant.G + plant.F @ plant.B1,
        Cy=padded(plant.C, columns=states),
        Dy=plant.D + plant.C @ plant.B1,
        Ky=plant.K + plant.C @ plant.E1,
        bouc_wen=plant.bouc_wen,
        operator=plant.operator,
        play_start=plant.play_start,
        play_threshold=plant.play_threshold,
        play_weight=plant.play_weight,
        optics=case.optics,
        shaping_diagonal=diagonal,
        shaping_coupling=coupling,
        shaping_noise=padded(case.Bs, rows=diagonal.size),
        shaping_output=padded(case.Cs, columns=diagonal.size),
        purpose=np.array(case.purpose, dtype=np.uint64),
        seed=np.array([case.seed % WORD, case.seed // WORD], dtype=np.uint64),
        steps_per_sample=loop.steps_per_sample,
        delay_steps=loop.delay_steps,
        sensor_delay_steps=case.sensor_delay_steps,
        sensor_every=case.sensor_every,
        optical_noise=np.array(case.optical_noise, dtype=float),
        optical_resolution=float(case.optical_resolution),
        field_of_view=float(case.field_of_view),
        gauge_noise=float(case.gauge_noise),
        gauge_resolution=float(case.gauge_resolution),
        feedforward=case.feedforward,
        A=loop.Ac,
        B=loop.Bc,
        C=loop.Cc,
        D=loop.Dc,
        L=loop.L,
        actuator=np.column_stack([record.actuator, case.drive_low, case.drive_high]),
        inverse_direct=record.inverse_direct,
        inverse_bouc_wen=record.inverse_bouc_wen,
        inverse_bouc_wen_actuator=record.inverse_bouc_wen_actuator,
        inverse_play_threshold=record.inverse_play_threshold,
        inverse_play_weight=record.inverse_play_weight,
        inverse_play_actuator=record.inverse_play_actuator,
        inverse_widening=record.inverse_widening,
        inverse_lag_keep=record.inverse_lag_keep,
        inverse_lag_weight=record.inverse_lag_weight,
        inverse_lag_actuator=record.inverse_lag_actuator,
        forward=build_forward(case),
        **adaptive_arrays(case.adaptive),
    )


def build_forward(case):
    """The kernel's record of the hysteresis that a controller runs."""
    plant, _ = oracles.build_plant(case.forward, case.step_s * case.loop.steps_per_sample)
    bank = {name: getattr(plant, name) for name in kernels.ForwardBank._fields if name != "drives"}
    return kernels.ForwardBank(**bank, drives=np.ascontiguousarray(case.forward.K))


def adaptive_arrays(of):
    """The kernel's arrays of an adaptive inverse of one actuator, or of none."""
    columns = np.zeros((1 if of else 0, kernels.ADAPTIVE_COLUMNS))
    if of:
        columns[0, kernels.CYCLE], columns[0, kernels.DELAY] = of.cycle, of.delay
        columns[0, kernels.GAIN], columns[0, kernels.SHARE] = of.gain, of.slow
        columns[0, kernels.KEEP], columns[0, kernels.DEAD_ZONE] = 1.0 - of.forgotten, of.dead_zone
        columns[0, kernels.SPEED], columns[0, kernels.LEAST_SIZE] = of.speed, of.least_size
        columns[0, kernels.LEAST_TRAVEL], columns[0, kernels.LEAST_WEIGHT] = of.least_travel, of.least_weight
        columns[0, kernels.MOST_WEIGHT], columns[0, kernels.OFFSET_LIMIT] = of.most_weight, of.offset_limit
    return {
        "adaptive": columns,
        "adaptive_threshold": np.array(of.thresholds if of else (), dtype=float),
        "adaptive_weight": np.array(of.weights if of else (), dtype=float),
        "adaptive_start": np.array([0, len(of.weights)] if of else [0], dtype=np.int64),
    }


def learns_from(state, of):
    """Writes what the inverse has learnt at the begin into the kernel's memory: the weights that it starts from."""
    plays = state.learnt.reshape(-1, kernels.LANES)[: len(of.weights) * kernels.PLAY_FIELDS]
    plays = plays.reshape(len(of.weights), kernels.PLAY_FIELDS, kernels.LANES)
    weights, slopes = np.array(of.weights), np.cumsum(of.weights)
    plays[:, kernels.LEARNT] = plays[:, kernels.WEIGHT] = weights[:, None]
    plays[:, kernels.SLOPE] = slopes[:, None]
    plays[:, kernels.RECIPROCAL] = plays[:, kernels.NEXT_RECIPROCAL] = 1.0 / slopes[:, None]
    for j in range(1, len(weights)):
        plays[j, kernels.THRESHOLD] = sum(weights[i] * (of.thresholds[j] - of.thresholds[i]) for i in range(j))
    plays[:, kernels.VOLTS] = np.diff(1.0 / slopes, prepend=0.0)[:, None]


def build_state(case, p, first_run, shaping, reference):
    """The kernel's memory at rest, with ``shaping`` (states, LANES) and the first reference; statistics are taken."""
    m, outputs, axes = case.actuators, len(case.mirror.C), case.axes
    lines = {
        "x": p.diagonal.size,
        "x_next": p.diagonal.size,
        "drive": kernels.DRIVE_FIELDS * m,
        "q": len(p.G),
        "z": len(p.G),
        "bank": kernels.BANK_FIELDS * len(p.G),
        "play": p.play_threshold.size,
        "y": outputs,
        "shaping": p.shaping_diagonal.size,
        "disturbance": axes,
        "gauss": 4 * p.purpose.size,
        "sensor_gauss": 4 * -(-(axes + outputs) // 4),
        "error": axes,
        "error_ring": (p.sensor_delay_steps + 1) * axes,
        "measured": p.B.shape[1],
        "xc": len(p.A),
        "xc_next": len(p.A),
        "output": len(p.C),
        "command": (-(-p.delay_steps // p.steps_per_sample) + 1) * m,
        "target": 2 * m,
        "inverse": len(p.inverse_bouc_wen),
        "inverse_play": p.inverse_play_threshold.size,
        "inverse_lag": p.inverse_lag_keep.size,
        "forward_z": p.forward.drives.shape[1],
        "forward_bank": kernels.BANK_FIELDS * p.forward.drives.shape[1],
        "forward_play": p.forward.play_threshold.size,
        "learnt": p.adaptive_weight.size * kernels.PLAY_FIELDS,
        "track": len(p.adaptive) * kernels.TRACK_FIELDS,
        "work": m,
        "sum": axes,
        "sum_square": axes,
        "largest": 1,
        "counts": kernels.COUNT_FIELDS,
    }
    state = kernels.EnsembleState(
        first_run=np.array([first_run], dtype=np.uint64),
        place=np.array([0, 0, 1], dtype=np.int64),
        histogram=np.zeros((kernels.LANES, kernels.BINS), dtype=np.int32),
        drawn=np.zeros(0),
        **{name: np.zeros(max(count, 1) * kernels.LANES) for name, count in lines.items()},
    )
    state.shaping[: shaping.size] = shaping.ravel()
    disturbance = case.Cs @ shaping
    state.disturbance[:] = disturbance.ravel()
    state.error[:] = (reference[:, None] + disturbance).ravel()
    state.error_ring[:] = np.tile(state.error, p.sensor_delay_steps + 1)
    if case.adaptive:
        learns_from(state, case.adaptive)
    return state


class EnsembleRun(NamedTuple):
    """What the kernel did with a batch: residual and trace (samples, rows, LANES), and its memory at the end."""

    residual: np.ndarray
    trace: np.ndarray
    state: kernels.EnsembleState

    def lines(self, name):
        """A quantity of the state, (rows, LANES)."""
        return getattr(self.state, name).reshape(-1, kernels.LANES)


def run_kernel(case, first_run, shaping, reference, state=None, shift=kernels.UNSHIFTED):
    """The compiled ``ensemble_loop`` over the control samples of ``reference``, from rest or from ``state``."""
    p = build_ensemble(case)
    state = build_state(case, p, first_run, shaping, reference[0]) if state is None else state
    channels = case.axes + kernels.DRIVE_FIELDS * case.actuators + len(case.mirror.C) + p.B.shape[1]
    residual = np.empty((len(reference) - 1, case.axes, kernels.LANES))
    trace = np.empty((len(reference) - 1, channels, kernels.LANES))
    one_for_all = np.ascontiguousarray(reference, dtype=float)[..., None]
    kernels.ensemble_loop(p, state, one_for_all, residual, trace, shift)
    return EnsembleRun(residual, trace, state)
