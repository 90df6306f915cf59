"""Controllers of the shipped mission, tuned once for all tests of exports and all processes of a run."""

from dataclasses import replace
from functools import cache

import pytest

import several_axes
from microrad.export import choice
from microrad.export.records import FlightController, Vectors
from microrad.loop.coupled_study import designs as coupled_designs
from microrad.mission.file import MissionFile, load_mission
from shared import once
from shipped import SHIPPED


@cache
def mission() -> MissionFile:
    return load_mission(SHIPPED)


@cache
def chosen(name: str) -> choice.Choice:
    return once(f"chosen {name}", lambda: choice.choose(mission(), name))


@cache
def of_three_actuators() -> choice.CoupledChoice:
    """LQG of all axes of a plate on three actuators, without a converter that would hide what is off."""
    file = several_axes.mission(('drive_resolution = "0.305 mV"', 'drive_resolution = "0 V"'))

    def choose() -> choice.CoupledChoice:
        with pytest.MonkeyPatch.context() as patch:  # how good it is does not matter here
            patch.setattr(coupled_designs, "STARTS", 1)
            patch.setattr(coupled_designs, "MODELS", 1)
            return choice.choose_coupled(file, several_axes.three_actuators(), "LQG")

    return once("LQG on three actuators", choose)


@cache
def without_converter(name: str) -> choice.PointingChoice:
    """The same tuning in a loop whose converter does not round: that would hide what is smaller than a count."""
    of = chosen(name)
    assert isinstance(of, choice.PointingChoice)
    loop = of.scene.loop
    exact = replace(loop, drive=replace(loop.drive, drive_resolution_v=0.0))
    return replace(of, scene=replace(of.scene, loop=exact))


@cache
def flown(name: str, samples: int) -> tuple[FlightController, Vectors]:
    """The controller as it flies, and a recorded run."""
    return choice.flight_controller(chosen(name)), choice.vectors(chosen(name), samples)
