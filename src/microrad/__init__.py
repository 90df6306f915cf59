"""The pointing chain of a small-satellite laser terminal: link budget, piezo mirror with hysteresis, sampled control.

Every public name stands in the table below once, with the module it lives in. Importing `microrad` loads none of them:
a name brings its module in when it is first used.
"""

from importlib import import_module
from typing import Any

_PUBLIC = {
    # hysteresis
    "BoucWen": "mirror.hysteresis.BoucWen",
    "PrandtlIshlinskii": "mirror.hysteresis.PrandtlIshlinskii",
    "Creep": "mirror.hysteresis.Creep",
    "fit_hysteresis": "lab.identify.fit_hysteresis",
    # recordings and responses
    "read_recording": "lab.recording.read_recording",
    "recording_from_arrays": "lab.recording.recording_from_arrays",
    "measure_frequency_response": "lab.identify.measure_frequency_response",
    "fit_frequency_response": "lab.identify.fit_frequency_response",
    "identify_mirror": "lab.identify.identify",  # `microrad.lab.identify` is the package that it lives in
    # the sampled loop
    "Mirror": "mirror.Mirror",
    "read_mirror": "mirror.read_mirror",
    "fit_spectrum": "loop.disturbance.fit_spectrum",
    "Controller": "loop.workbench.Controller",
    "Loop": "loop.workbench.Loop",
    "tune": "loop.workbench.tune",
    # light and orbits
    "received_power": "link.by_numbers.received_power",
    "Jitter": "link.pointing.Jitter",
    "outage_loss_db": "link.pointing.outage_loss_db",
    "best_divergence": "link.pointing.best_divergence_for_outage",
    "scan_times": "link.by_numbers.scan_times",
    "read_elements": "orbit.files.elements.read_elements",
    "find_contacts": "orbit.between.find_contacts",
    # whole missions
    "load_mission": "mission.file.load_mission",
    "run_study": "study.study.run_study",
    "load_campaign": "campaign.file.load_campaign",
    "run_campaign": "campaign.run.run_campaign",
    "write_report": "report.write",
    # plots
    "plot_bode": "report.plots.plot_bode",
    "plot_loops": "report.plots.plot_loops",
    "plot_residual": "report.plots.plot_residual",
    "plot_spectrum": "report.plots.plot_spectrum",
    "plot_pointing_errors": "report.plots.plot_pointing_errors",
    "plot_contributions": "report.plots.plot_contributions",
    "plot_margin_map": "report.plots.plot_margin_map",
    "plot_contacts": "report.plots.plot_contacts",
    # what all have in common
    "parse_quantity": "core.units.parse_quantity",
    "MicroradError": "core.errors.MicroradError",
}

_MOVED = {
    "load_mirror": "mission.file.load_mirror",
    "load_link": "mission.file.load_link",
    "mission_schema": "mission.model.mission_schema",
    "MissionFile": "mission.file.MissionFile",
    "LinkFile": "mission.file.LinkFile",
    "MissionError": "mission.file.MissionError",
    "Study": "study.study.Study",
    "run_link_study": "link.study.run_link_study",
    "LinkStudy": "link.study.LinkStudy",
    "run_day_study": "orbit.day.run_day_study",
    "DayStudy": "orbit.day.DayStudy",
    "PointingLoss": "orbit.day.PointingLoss",
    "run_constellation": "orbit.constellation.run_constellation",
    "ConstellationPlan": "orbit.constellation.ConstellationPlan",
    "resume_campaign": "campaign.run.resume_campaign",
    "summarise_campaign": "campaign.statistics.summary.summarise_campaign",
    "CampaignMeans": "campaign.run.Means",
    "CampaignError": "campaign.records.CampaignError",
    "verdict_text": "report.verdict_text",
    "summary": "report.summary",
    "FolderError": "core.folder.FolderError",
    "LinkError": "link.LinkError",
    "OrbitError": "orbit.OrbitError",
    "OperationsError": "orbit.operations.OperationsError",
    "read_arrays": "lab.recording.read_arrays",
    "read_recordings_list": "lab.recording.list_file.read_list",
    "Recording": "lab.recording.Recording",
    "RecordingError": "lab.recording.RecordingError",
    "mirror_file_text": "lab.identify.mirror_file_text",
    "Identification": "lab.identify.Identification",
    "IdentificationError": "lab.identify.IdentificationError",
    "format_quantity": "core.units.format_quantity",
    "UnitError": "core.units.UnitError",
}
"""Public names of 0.1.0 that live in their room alone now; kept here until 0.3.0, with a warning that says where."""


def __getattr__(name: str) -> Any:
    """A public name, from its module; the version, from the installed package."""
    if name == "__version__":
        from importlib.metadata import version

        return version("microrad")
    if name == "__all__":
        return [*_PUBLIC, "__version__"]
    if name in _MOVED:
        from warnings import warn

        module, _, attribute = _MOVED[name].rpartition(".")
        place = f"from microrad.{module} import {attribute}"
        warn(f"microrad.{name} goes in 0.3.0: write {place}", DeprecationWarning, stacklevel=2)
        return getattr(import_module(f"microrad.{module}"), attribute)
    if name not in _PUBLIC:
        raise AttributeError(f"microrad has no public name '{name}'; it has {', '.join(_PUBLIC)}")
    module, _, attribute = _PUBLIC[name].rpartition(".")
    value = getattr(import_module(f"microrad.{module}"), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names."""
    return [*_PUBLIC, "__version__"]
