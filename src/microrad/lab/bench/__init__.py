"""Excitation design and the virtual bench: a plan file becomes drives within limits, and drives become recordings.

    plan = load_plan("mirror-characterisation")      # a packaged plan, or the path of a file
    recordings = play(plan, seed=1)                  # one Recording a record, V and mrad
    files = write(plan, "records", seed=1)           # the same as a folder of lab files

The bench's own mirror is none of the models that `identify` fits; it can play Eq. 2 and Eq. 3 of SPIE 11852, 118523B
as well. This package stands below identification: it knows nothing of it.
"""

from microrad.lab.bench.folder import check_folder, read_folder, write
from microrad.lab.bench.plan import load_plan, only
from microrad.lab.bench.play import play

__all__ = ["check_folder", "load_plan", "only", "play", "read_folder", "write"]
