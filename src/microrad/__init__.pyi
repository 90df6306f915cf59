"""The public names, for editors and type checkers. Written by ``scripts/house stub``."""

from microrad.campaign.file import load_campaign
from microrad.campaign.run import run_campaign
from microrad.core.errors import MicroradError
from microrad.core.units import parse_quantity
from microrad.lab.identify import fit_frequency_response
from microrad.lab.identify import fit_hysteresis
from microrad.lab.identify import identify as identify_mirror
from microrad.lab.identify import measure_frequency_response
from microrad.lab.recording import read_recording
from microrad.lab.recording import recording_from_arrays
from microrad.link.by_numbers import received_power
from microrad.link.by_numbers import scan_times
from microrad.link.pointing import Jitter
from microrad.link.pointing import best_divergence_for_outage as best_divergence
from microrad.link.pointing import outage_loss_db
from microrad.loop.disturbance import fit_spectrum
from microrad.loop.workbench import Controller
from microrad.loop.workbench import Loop
from microrad.loop.workbench import tune
from microrad.mirror import Mirror
from microrad.mirror import read_mirror
from microrad.mirror.hysteresis import BoucWen
from microrad.mirror.hysteresis import Creep
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mission.file import load_mission
from microrad.orbit.between import find_contacts
from microrad.orbit.files.elements import read_elements
from microrad.report import write as write_report
from microrad.report.plots import plot_bode
from microrad.report.plots import plot_contacts
from microrad.report.plots import plot_contributions
from microrad.report.plots import plot_loops
from microrad.report.plots import plot_margin_map
from microrad.report.plots import plot_pointing_errors
from microrad.report.plots import plot_residual
from microrad.report.plots import plot_spectrum
from microrad.study.study import run_study

__all__ = [
    "BoucWen",
    "PrandtlIshlinskii",
    "Creep",
    "fit_hysteresis",
    "read_recording",
    "recording_from_arrays",
    "measure_frequency_response",
    "fit_frequency_response",
    "identify_mirror",
    "Mirror",
    "read_mirror",
    "fit_spectrum",
    "Controller",
    "Loop",
    "tune",
    "received_power",
    "Jitter",
    "outage_loss_db",
    "best_divergence",
    "scan_times",
    "read_elements",
    "find_contacts",
    "load_mission",
    "run_study",
    "load_campaign",
    "run_campaign",
    "write_report",
    "plot_bode",
    "plot_loops",
    "plot_residual",
    "plot_spectrum",
    "plot_pointing_errors",
    "plot_contributions",
    "plot_margin_map",
    "plot_contacts",
    "parse_quantity",
    "MicroradError",
    "__version__",
]

__version__: str
