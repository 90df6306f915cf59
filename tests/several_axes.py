"""Mirrors of several axes for tests, and the mission whose loop they stand in."""

import re

import numpy as np

from microrad.core import lti
from microrad.link import arrival_of, tracking_light_w
from microrad.loop import coupled_study
from microrad.mirror import coupled
from microrad.mirror.coupled import Actuator, CoupledMirror, Output
from microrad.mirror.hysteresis import PrandtlIshlinskii
from microrad.mirror.model import Mirror
from microrad.mission.file import load_coupled_mirror, load_mission
from places import ROOT
from shipped import DEFAULT

PAGE = (ROOT / "docs" / "mirror-file.md").read_text(encoding="utf-8")
TEXT = next(t for t in re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL) if t.startswith("version = 2"))
DRIVES = (("gain = 15 ", "gain = 1 "), ('output_max = "180 V"', 'output_max = "100 V"'))
"""Edits with which the mission's amplifier drives the mirror of the page."""


def mission_text(*changes):
    text = DEFAULT.read_text(encoding="utf-8")
    for old, new in (*DRIVES, *changes):
        assert old in text, old
        text = text.replace(old, new)
    return text


def mission(*changes):
    return load_mission("mission.toml", text=mission_text(*changes))


def two_axes():
    return coupled.of(load_coupled_mirror("two-axes.toml", text=TEXT))


def scene_of(mirror, *changes):
    file = mission(*changes)
    return coupled_study.scene(file, mirror, tracking_light_w(file), arrival_of(file))


def three_actuators(hysteresis=0.05):
    """A plate on three actuators, each with its own gain, seen at three other places; resonances that pull on all."""
    angles, places = 2 * np.pi * np.arange(3) / 3, 0.03 * np.exp(2j * np.pi * (np.arange(3) / 3 + 0.1))
    pushes = np.column_stack([np.ones(3), np.cos(angles), np.sin(angles)]) * np.array([[1.0], [1.2], [0.85]])
    sees = np.column_stack([np.ones(3), places.real / 0.03, places.imag / 0.03])
    roots = [(-30.0, 1500.0), (-25.0, 1900.0), (-20.0, 2100.0)]
    A, B, C = lti.modal_matrix(roots), np.zeros((6, 3)), np.zeros((3, 6))
    turned = np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.2], [0.1, -0.2, 1.0]])
    B[1::2] = -1e3 * turned @ pushes.T
    C[:, 0::2] = 1e-6 * sees @ np.linalg.inv(turned)
    E, F = np.zeros((6, 3)), np.zeros((3, 6))
    E[1::2], F[:, 0::2] = -1e3 * np.eye(3), np.eye(3)
    plays = tuple(PrandtlIshlinskii((0.0, 0.3, 1.0), (0.0, hysteresis, hysteresis)) for _ in range(3))
    mirror = Mirror("a plate", A, B, E, F, np.zeros((3, 3)), C, np.zeros((3, 3)), np.zeros((3, 3)), (), plays, ())
    actuators = tuple(Actuator(f"actuator {i + 1}", 50.0, 0.0, 100.0, 1e5) for i in range(3))
    outputs = tuple(Output(f"sensor {i + 1}", "displacement", (z.real, z.imag)) for i, z in enumerate(places.tolist()))
    return CoupledMirror(mirror, actuators, outputs, 0.0, 10e3, 2, (0.1, 3e3))
