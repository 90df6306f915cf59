"""The light of a communication link in time, from the pointing errors of simulated runs at one end or at both."""

from dataclasses import dataclass

import numpy as np

from microrad import link
from microrad.core.arrays import Floats
from microrad.link.coupling import End
from microrad.link.pointing.statistics import transmission


@dataclass(frozen=True, slots=True)
class Light:
    """Light that is received under pointing errors, over that without any.

    ``half_angle_rad`` is that of a Gaussian beam at 1/e2 of intensity, ``ahead_rad`` an uncorrected point-ahead, which
    is added to the length of every error. ``end`` takes the light where the partner's terminal is like ours, and its
    errors are simulated as well; else ``given_db`` is what the receiver's own pointing is stated to cost.
    """

    half_angle_rad: float
    ahead_rad: float
    end: End | None = None
    given_db: float = 0.0

    @classmethod
    def of(cls, data: link.DataLink) -> "Light":
        """That of a communication link.

        Args:
            data: The communication link.
        """
        receiving, angles = data.receiving, (data.beam.fall.half_angle_rad, data.shared.point_ahead_rad)
        if receiving is not None and receiving.twin:
            return cls(*angles, receiving.end)
        return cls(*angles, None, data.added_db)

    def power(self, error_rad: Floats) -> Floats:
        """The light at each sample, without what is only stated, shape (samples, runs).

        Args:
            error_rad: Errors about each axis, those of a partner like us behind ours, shape (samples, axes, runs).
        """
        own, *others = np.split(error_rad, 1 if self.end is None else 2, axis=1)
        sent = transmission(np.sqrt(np.sum(own**2, axis=1)) + self.ahead_rad, self.half_angle_rad)
        if self.end is None:
            return sent
        along, across = others[0][:, 0], others[0][:, 1] if others[0].shape[1] > 1 else 0.0
        return np.asarray(sent * self.end.share(along, across) / self.end.share(0.0))
