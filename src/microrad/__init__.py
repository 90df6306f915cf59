"""The pointing chain of a small-satellite laser terminal: link budget, piezo mirror with hysteresis, sampled control.

Every public name stands in the table below once, with the module it lives in. Importing `microrad` loads none of them:
a name brings its module in when it is first used.
"""

from importlib import import_module
from typing import Any

_PUBLIC = {
    "load_mission": "mission.file.load_mission",
    "load_mirror": "mission.file.load_mirror",
    "load_link": "mission.file.load_link",
    "mission_schema": "mission.model.mission_schema",
    "MissionFile": "mission.file.MissionFile",
    "LinkFile": "mission.file.LinkFile",
    "MissionError": "mission.file.MissionError",
    "run_study": "study.study.run_study",
    "Study": "study.study.Study",
    "run_link_study": "link.study.run_link_study",
    "LinkStudy": "link.study.LinkStudy",
    "run_day_study": "orbit.day.run_day_study",
    "DayStudy": "orbit.day.DayStudy",
    "PointingLoss": "orbit.day.PointingLoss",
    "run_constellation": "orbit.constellation.run_constellation",
    "ConstellationPlan": "orbit.constellation.ConstellationPlan",
    "load_campaign": "campaign.file.load_campaign",
    "run_campaign": "campaign.run.run_campaign",
    "resume_campaign": "campaign.run.resume_campaign",
    "summarise_campaign": "campaign.statistics.summary.summarise_campaign",
    "CampaignMeans": "campaign.run.Means",
    "CampaignError": "campaign.records.CampaignError",
    "write_report": "report.write",
    "verdict_text": "report.verdict_text",
    "summary": "report.summary",
    "FolderError": "core.folder.FolderError",
    "LinkError": "link.LinkError",
    "OrbitError": "orbit.OrbitError",
    "OperationsError": "orbit.operations.OperationsError",
    "read_recording": "lab.recording.read_recording",
    "read_arrays": "lab.recording.read_arrays",
    "read_recordings_list": "lab.recording.list_file.read_list",
    "recording_from_arrays": "lab.recording.recording_from_arrays",
    "Recording": "lab.recording.Recording",
    "RecordingError": "lab.recording.RecordingError",
    "identify_mirror": "lab.identify.identify",  # `microrad.lab.identify` is the package that it lives in
    "mirror_file_text": "lab.identify.mirror_file_text",
    "Identification": "lab.identify.Identification",
    "IdentificationError": "lab.identify.IdentificationError",
    "fit_frequency_response": "lab.identify.fit_frequency_response",
    "FrequencyResponseFit": "lab.identify.FrequencyResponseFit",
    "parse_quantity": "core.units.parse_quantity",
    "format_quantity": "core.units.format_quantity",
    "UnitError": "core.units.UnitError",
}


def __getattr__(name: str) -> Any:
    """A public name, from its module; the version, from the installed package."""
    if name == "__version__":
        from importlib.metadata import version

        return version("microrad")
    if name == "__all__":
        return [*_PUBLIC, "__version__"]
    if name not in _PUBLIC:
        raise AttributeError(f"microrad has no public name '{name}'; it has {', '.join(_PUBLIC)}")
    module, _, attribute = _PUBLIC[name].rpartition(".")
    value = getattr(import_module(f"microrad.{module}"), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names."""
    return [*_PUBLIC, "__version__"]
