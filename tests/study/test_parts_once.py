"""One study assembles its link once, and each variant of its mirror, and everything that it does takes that one."""

from collections import Counter

import pytest

from microrad import link
from microrad.core import threads
from microrad.loop.control import PI
from microrad.loop.controller_study import designs, results
from microrad.mirror import model, variants
from microrad.study import study
from shipped import edited_file


@pytest.mark.promise("decisions-1")
def test_one_study_assembles_its_link_and_each_variant_of_its_mirror_once(tmp_path, monkeypatch):
    changes = ("runs = 64 ", "runs = 1 "), ('duration = "2 s" ', 'duration = "0.1 s" '), ('= "0.5 s" ', '= "0.05 s" ')
    file = edited_file(tmp_path, *changes, whole=True, day=False)
    made, entered, linked, whole, of = Counter(), [], [], model.assemble, link.of

    def counted(name, composition, system, hysteresis, creep=model.NO_CREEP):
        made[composition, hysteresis, creep] += 1
        return whole(name, composition, system, hysteresis, creep)

    monkeypatch.setattr(model, "assemble", counted)
    monkeypatch.setattr(study.mirror, "of", lambda m: entered.append(m) or variants.of(m))
    monkeypatch.setattr(link, "of", lambda m: linked.append(m) or of(m))
    monkeypatch.setattr(threads, "_may_fork", lambda: False)
    monkeypatch.setattr(study.paper, "PROPORTIONAL_V_MRAD", (1.0,))
    monkeypatch.setattr(study.paper, "INTEGRAL_V_MRAD_S", (8e3, 16e3))
    monkeypatch.setattr(study.alternatives, "other_readings", lambda *args: ())  # they read the mission in another way
    monkeypatch.setattr(designs, "families", lambda m: (PI,))
    monkeypatch.setattr(designs, "names", lambda m: (designs.BASELINE, PI.name))
    monkeypatch.setattr(results, "SINE_S", 0.2)
    monkeypatch.setattr(results, "SINE_SETTLE_S", 0.1)
    found = study.run_study(file)
    assert entered == [file.mission]
    assert sum(m is file.mission for m in linked) == 1
    own = found.fine_pointing.scene.mirrors.own
    composition = file.mission.mirror.composition
    assert [made[composition, axis.model, model.NO_CREEP] for axis in own.values()] == [1, 1, 1]
    assert set(found.fine_pointing.best.simulated) == set(own) == {run.mirror for run in found.runs}
    assert set(made.values()) == {1}
