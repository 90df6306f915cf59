"""From recordings of several channels to the smallest model within noise: per axis, coupled, hysteretic stiffness."""

from microrad.lab.identify.coupled.ladder import identify_coupled
from microrad.lab.identify.coupled.records import Candidate, CoupledIdentification

__all__ = ["Candidate", "CoupledIdentification", "identify_coupled"]
