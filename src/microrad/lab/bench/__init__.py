"""Excitation design and the virtual bench: a plan file becomes drives within limits, and drives become recordings.

    plan = load_plan("mirror-characterisation")      # a packaged plan, or the path of a file
    recordings = play(plan, seed=1)                  # one Recording a record, V and mrad
    files = write_folder(plan, "records", seed=1)           # the same as a folder of lab files

The bench's own mirror is none of the models that `identify` fits; it can play Eq. 2 and Eq. 3 of SPIE 11852, 118523B
as well. This package stands below identification: it knows nothing of it.
"""

from microrad.lab.bench.folder import check_folder, read_folder, write_folder
from microrad.lab.bench.plan import load_plan, select_records
from microrad.lab.bench.play import play, play_records

__all__ = ["check_folder", "load_plan", "play", "play_records", "read_folder", "select_records", "write_folder"]
