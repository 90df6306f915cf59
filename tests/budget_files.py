"""Budgets of pointing errors: a mission's table and its study, and lists of sources beside it."""

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from microrad.mission.file import load_mission
from microrad.study import paper, study, verdict
from shared import once
from shipped import SHIPPED, whole_study, without_day, without_fine_pointing

TABLE = """
[error_budget]
with_loop = false

[error_budget.sources.alignment]
class = "constant"
size = "2 urad"            # assumption: calibrated on the ground
statistic = "3-sigma"
axes = "together"
gains = [1.0, 0.5]

[error_budget.sources.thermo_elastic]
class = "periodic"
size = "1.5 urad"
statistic = "fixed"
axes = "each"
gains = [0.0, 1.0]
frequency = "0.2 mHz"

[error_budget.requirements.code_word]
index = "RPE"
window = "10 ms"
confidence = 0.9973
interpretation = "temporal"
axes = "radial"
limit = "4 urad"

[error_budget.requirements.drift]
index = "APE"
confidence = 0.95
interpretation = "temporal"
axes = "y"
limit = "2 urad"
"""
LIST = "name,class,size,statistic,axes,x,y,origin\nstar tracker,random,3 urad,3-sigma,each,1,1,data sheet\n"

HEADING = "name,class,size,rate,statistic,axes,x,y,z,corner,frequency,period,decay,origin"
ROWS = (
    "alignment,constant,2 urad,,3-sigma,each,1,0.5,,,,,,ground calibration",
    "star tracker,random,3 urad,,bound,each,1,1,,,,,,",
    "drift,drift,,0.1 nrad/s,1-sigma,each,1,1,,,,6 h,,",
    "wheels,process,1 urad,,1-sigma,each,1,1,,40 Hz,,,,",
    "unloading,transient,5 urad,,fixed,together,0.5,-1,,,,95 min,20 s,",
)

KEPT = (
    ('limit = "2 urad"', 'limit = "4 urad"'),
    ('margin = "3 dB"', 'margin = "1 dB"'),
    ('pointing_error = "10 urad"            # paper: section 2.2 and 3.1', 'pointing_error = "50 urad"'),
)
"""Changes by which the mission without a loop meets every requirement."""


def mission_text(*changes, whole=False):
    """The paper's mission with a budget, without its day; its fine-pointing loop is there, and a source, if `whole`."""
    text = without_day(SHIPPED.read_text("utf-8"))
    text = (
        text + TABLE.replace("with_loop = false", "with_loop = true") if whole else without_fine_pointing(text) + TABLE
    )
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def loaded(*changes, whole=False):
    """That mission, read."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mission.toml"
        path.write_text(mission_text(*changes, whole=whole), "utf-8")
        return load_mission(path)


@cache
def kept_study():
    """The study of the mission that meets every requirement; once for all tests."""

    def run():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(paper, "applies", lambda mission: False)
            return study.run_study(loaded(*KEPT))

    return once("study with a budget", run)


@cache
def looped_study():
    """The whole study of the shipped mission as it is with a budget that has the loop as a source."""
    found, file = whole_study()[0], loaded(whole=True)
    asked = study.error_budget.of_mission(file.mission.error_budget, file.sources)
    errors = study.pointing_errors(asked, found.fine_pointing)
    more = verdict.of_error_budget(errors, file.sources, found.fine_pointing)
    return replace(found, file=file, error_budget=errors, requirements=(*found.requirements, *more))
