"""Linear models of a mission for MATLAB, JSON and python-control: state space, zeros and poles, coefficients."""

from microrad.export.matrices.files import json_text, to_control, write_mat
from microrad.export.matrices.models import models

__all__ = ["json_text", "models", "to_control", "write_mat"]
