"""Instances of co-simulation units; run as a program, one that is saved and killed, or taken up again.

slaves.py UNIT FOLDER STATE FIRST LAST save|continue
"""

import json
import sys
from pathlib import Path

import fmpy
import numpy as np
from fmpy import fmi2, fmi3


class Slave:
    """An instance of a unit, the same for both versions of FMI. ``said`` are its messages."""

    def __init__(self, path, folder, *, guid=None, start=True, **parameters):
        folder = folder / path.stem
        if not folder.exists():
            fmpy.extract(path, folder)
        self.description = fmpy.read_model_description(folder)
        self.places = {v.name: v.valueReference for v in self.description.modelVariables}
        self.sizes = {v.name: int(np.prod(v.shape or ())) for v in self.description.modelVariables}
        self.said = []
        self.two = self.description.fmiVersion == "2.0"
        known = {"guid": guid or self.description.guid, "unzipDirectory": str(folder)}
        known |= {"modelIdentifier": self.description.coSimulation.modelIdentifier, "instanceName": "one"}
        self.unit = (fmi2.FMU2Slave if self.two else fmi3.FMU3Slave)(**known)
        self._instantiate()
        self.time = 0.0
        start_of = {v.name: v.start for v in self.description.modelVariables}
        self.period_s = float(start_of.get("control_period_s", start_of["plant_step_s"]))
        if start:
            self.begin(parameters)

    def _instantiate(self):
        if self.two:
            calls = fmi2.fmi2CallbackFunctions()
            calls.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *args: self.said.append(args[4].decode()))
            self.unit.instantiate(callbacks=calls)
        else:
            self.unit.instantiate(logMessage=lambda *args: self.said.append(args[3].decode()))

    def begin(self, parameters=()):
        for name, value in dict(parameters).items():
            self.set(name, [value])
        if self.two:
            self.unit.setupExperiment(startTime=0.0)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=0.0)
        self.unit.exitInitializationMode()

    def references(self, name):
        if name in self.places:
            return [self.places[name]]
        return [self.places[each] for each in self.places if each.startswith(f"{name}[")]

    def set(self, name, values):
        (self.unit.setReal if self.two else self.unit.setFloat64)(self.references(name), list(values))

    def get(self, name):
        if self.two:
            return np.array(self.unit.getReal(self.references(name)))
        return np.array(self.unit.getFloat64(self.references(name), self.sizes[name]))

    def count(self, name):
        return (self.unit.getInteger if self.two else self.unit.getInt32)(self.references(name))[0]

    def step(self, duration):
        self.unit.doStep(currentCommunicationPoint=self.time, communicationStepSize=duration)
        self.time += duration

    def state(self):
        return self.unit.getFMUstate() if self.two else self.unit.getFMUState()

    def restore(self, state, time):
        (self.unit.setFMUstate if self.two else self.unit.setFMUState)(state)
        self.time = time

    def save(self, path):
        """The present state as bytes in a file."""
        serialise = self.unit.serializeFMUstate if self.two else self.unit.serializeFMUState
        path.write_bytes(bytes(serialise(self.state())))

    def take_up(self, path):
        """The state of a file, and the time in it."""
        read = self.unit.deSerializeFMUstate if self.two else self.unit.deserializeFMUState
        self.restore(read(path.read_bytes()), None)
        self.time = float(self.get("time")[0])


def shaken(one, samples):
    """What a closed loop shows behind each of these control samples, under a disturbance that goes by their number."""
    found = []
    for k in samples:
        one.set("disturbance_rad", [1e-4 * np.sin(0.3 * k), 5e-5 * np.cos(0.17 * k * k)])
        one.step(one.period_s)
        found.append(np.concatenate([one.get(name) for name in ("error_rad", "command_v", "drive_v", "time")]))
    return np.array(found)


def main(unit, folder, state, first, last, what):
    one, first, last = Slave(Path(unit), Path(folder)), int(first), int(last)
    if what == "save":
        shaken(one, range(first))
        one.save(Path(state))
        print("saved", flush=True)
        while True:  # until it is killed
            shaken(one, range(first, last))
    one.take_up(Path(state))
    print(json.dumps([number.hex() for number in shaken(one, range(first, last)).ravel().tolist()]))


if __name__ == "__main__":
    main(*sys.argv[1:])
