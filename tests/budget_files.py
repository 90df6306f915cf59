"""Budgets of pointing errors: a mission's table, and lists of sources beside it."""

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
