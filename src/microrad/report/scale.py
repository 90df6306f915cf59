"""How large the steps of a mission's converters are in its results: what the tolerances of a study are made of."""

import math
from dataclasses import dataclass

from microrad.mirror.hysteresis import slow_gain
from microrad.study.study import Study

APART = 2.0
"""Steps by which a statistic of one run may move: 3.5 standard deviations of what two roundings differ by.

Two roundings to steps of q, independent of each other, differ by q / sqrt(6) rms about an axis and by 0.58 q over both.
"""


@dataclass(frozen=True, slots=True)
class Scale:
    """What one step of a converter does to the results of a mission.

    A conversion that falls to the other side moves the loop by a step, and from there on others fall otherwise.
    ``step_rad`` is the largest step of all converters as an angle, 0 where all are ideal; ``runs`` counts those of the
    fine-pointing loop, and ``rms_rad`` and ``full_rad`` are its least and largest radial rms. ``run_db`` and
    ``runs_db`` are what the communication link loses where the error that is allowed moves by `run_rad` and `runs_rad`.
    ``acquisitions`` and ``days`` count the simulated ones.
    """

    step_rad: float
    runs: int
    allowed_rad: float
    rms_rad: float
    full_rad: float
    run_db: float
    runs_db: float
    rate_bit_s: float
    acquisitions: int
    days: int

    @property
    def run_rad(self) -> float:
        """Distance by which rms and quantile of one run may move."""
        return APART * self.step_rad

    @property
    def runs_rad(self) -> float:
        """The same of all runs together, whose roundings are independent of each other."""
        return self.run_rad / math.sqrt(self.runs)


def scale_of(study: Study) -> Scale:
    """The scale of a study's mission."""
    m, fine = study.file.mission, study.fine_pointing
    step, runs = _step_rad(study), 1 if m.fine_pointing is None else m.fine_pointing.runs
    allowed = m.requirement.pointing_error_rad
    return Scale(
        step_rad=step,
        runs=runs,
        allowed_rad=allowed,
        rms_rad=allowed if fine is None else fine.optimum_rad,
        full_rad=allowed if fine is None else fine.budget.full_rad,
        run_db=_lost_db(study, APART * step),
        runs_db=_lost_db(study, APART * step / math.sqrt(runs)),
        rate_bit_s=m.communication.data_rate_bit_s,
        acquisitions=1 if m.acquisition is None else m.acquisition.runs,
        days=1 if m.operations is None else m.operations.runs,
    )


def _step_rad(study: Study) -> float:
    m, gain = study.file.mission, abs(slow_gain(study.summary.model))
    steps = [gain * m.control.drive_resolution_v, m.control.sensor_resolution_rad]
    if (fine := m.fine_pointing) is not None:
        gauge = 0.0 if fine.strain_gauge is None else fine.strain_gauge.resolution_rad
        steps += [gain * fine.drive_resolution_v, fine.optical_sensor.resolution_rad, gauge]
    return max(steps)


def _lost_db(study: Study, more_rad: float) -> float:
    m = study.file.mission
    at, loss = m.requirement.pointing_error_rad, study.links.data.beam.fall.loss_db
    return float(loss(at + more_rad)) - float(loss(at))
