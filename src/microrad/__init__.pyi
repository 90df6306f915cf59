"""The public names, for editors and type checkers. Written by ``scripts/house stub``."""

from microrad.campaign.file import load_campaign
from microrad.campaign.records import CampaignError
from microrad.campaign.run import Means as CampaignMeans
from microrad.campaign.run import resume_campaign
from microrad.campaign.run import run_campaign
from microrad.campaign.statistics.summary import summarise_campaign
from microrad.core.folder import FolderError
from microrad.core.units import UnitError
from microrad.core.units import format_quantity
from microrad.core.units import parse_quantity
from microrad.lab.identify import FrequencyResponseFit
from microrad.lab.identify import Identification
from microrad.lab.identify import IdentificationError
from microrad.lab.identify import fit_frequency_response
from microrad.lab.identify import identify as identify_mirror
from microrad.lab.identify import mirror_file_text
from microrad.lab.recording import Recording
from microrad.lab.recording import RecordingError
from microrad.lab.recording import read_arrays
from microrad.lab.recording import read_recording
from microrad.lab.recording import recording_from_arrays
from microrad.lab.recording.list_file import read_list as read_recordings_list
from microrad.link import LinkError
from microrad.link.study import LinkStudy
from microrad.link.study import run_link_study
from microrad.mission.file import LinkFile
from microrad.mission.file import MissionError
from microrad.mission.file import MissionFile
from microrad.mission.file import load_link
from microrad.mission.file import load_mirror
from microrad.mission.file import load_mission
from microrad.mission.model import mission_schema
from microrad.orbit import OrbitError
from microrad.orbit.constellation import ConstellationPlan
from microrad.orbit.constellation import run_constellation
from microrad.orbit.day import DayStudy
from microrad.orbit.day import PointingLoss
from microrad.orbit.day import run_day_study
from microrad.orbit.operations import OperationsError
from microrad.report import summary
from microrad.report import verdict_text
from microrad.report import write as write_report
from microrad.study.study import Study
from microrad.study.study import run_study

__all__ = [
    "load_mission",
    "load_mirror",
    "load_link",
    "mission_schema",
    "MissionFile",
    "LinkFile",
    "MissionError",
    "run_study",
    "Study",
    "run_link_study",
    "LinkStudy",
    "run_day_study",
    "DayStudy",
    "PointingLoss",
    "run_constellation",
    "ConstellationPlan",
    "load_campaign",
    "run_campaign",
    "resume_campaign",
    "summarise_campaign",
    "CampaignMeans",
    "CampaignError",
    "write_report",
    "verdict_text",
    "summary",
    "FolderError",
    "LinkError",
    "OrbitError",
    "OperationsError",
    "read_recording",
    "read_arrays",
    "read_recordings_list",
    "recording_from_arrays",
    "Recording",
    "RecordingError",
    "identify_mirror",
    "mirror_file_text",
    "Identification",
    "IdentificationError",
    "fit_frequency_response",
    "FrequencyResponseFit",
    "parse_quantity",
    "format_quantity",
    "UnitError",
    "__version__",
]

__version__: str
