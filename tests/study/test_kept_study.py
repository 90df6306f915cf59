"""A study with parts kept from another one: whatever key of the mission changes, its numbers are those without them."""

from functools import cache

import pytest

from microrad import report
from microrad.core import threads
from microrad.core.kept import NOTHING, Kept
from microrad.core.reads import digest
from microrad.loop.control import PI
from microrad.loop.controller_study import designs
from microrad.loop.controller_study import results as fine_results
from microrad.mission.file import MissionError, load_mission
from microrad.orbit.day import assumptions
from microrad.report.results.arrays import study_netcdf
from microrad.report.study.data import summary
from microrad.studio.draft.draft import Draft
from microrad.studio.draft.keys import value_of
from microrad.study import study
from shipped import DEFAULT, SHIPPED

SHORTER = {
    "acquisition.runs": "100",
    "orbit.duration": "2 h",
    "operations.runs": "2",
    "operations.contact.windows": "2",
    "operations.contact.window": "0.1 s",
    "constellation.satellites": "4",
    "constellation.planes": "2",
    "scenario.pid_frequencies": "15 Hz",
    "scenario.inverse_frequencies": "25 Hz",
    "fine_pointing.runs": "2",
    "fine_pointing.duration": "0.1 s",
    "fine_pointing.settle": "0.05 s",
}
HERE = (
    {"terminals.leo_aperture": "6 cm", "control.integral": "15500 V/(mrad s)"},
    {"orbit.leo.altitude": "510 km", "fine_pointing.vibration.convention": "per-axis"},
)
"""A key of the links, of the paper's loop, of the orbits and of the fine-pointing loop, two at a time that few parts
read both; the gate has the first two, and `make endurance` changes each key by itself."""
TABLES = (
    "pointing", "point_ahead", "terminals", "conventions", "beacon", "answer", "communication", "requirement",
    "acquisition", "orbit", "operations", "constellation", "mirror", "amplifier", "control", "scenario",
    "fine_pointing",
)  # fmt: skip


@cache
def shorter(path):
    """A shipped mission, and quicker."""
    draft = Draft.open(path)
    for key, typed in SHORTER.items():
        draft = draft.set(key, typed)
    assert not draft.problems, draft.report
    return draft


# ----------------------------------------------------------------------------------------------------- what is changed
FITTING = {
    "constellation.satellites": "6",
    "constellation.planes": "4",
    "constellation.phasing": "0",
    "control.rate": "100 kHz",
    "control.delay": "40 us",
    "control.plant_step": "5 us",
    "fine_pointing.rate": "25 kHz",
    "fine_pointing.delay": "400 us",
    "fine_pointing.plant_step": "20 us",
    "fine_pointing.optical_sensor.rate": "2.5 kHz",
    "fine_pointing.optical_sensor.delay": "40 us",
}
"""What fits the other keys, where a hundredth less does not."""
REFUSED = {
    "conventions.pointing_loss = pattern",
    "conventions.strehl = unused",
    "conventions.divergence = unused",
    "orbit.leo.gravity = two-body",
    "orbit.leo.limits.attitude = nadir",
    "orbit.leo.limits.attitude = sun",
    "orbit.geo.limits.attitude = free",
    "constellation.pattern = file",
    "mirror.composition = static",
    "fine_pointing.geometry.layout = tripod",
    *(f"orbit.leo.kind = {kind}" for kind in ("keplerian", "elements", "ephemeris", "geostationary")),
    *(f"orbit.geo.kind = {kind}" for kind in ("circular", "keplerian", "elements", "ephemeris")),
    *(f"fine_pointing.vibration.spectrum = {spectrum}" for spectrum in ("first-order", "bands", "table")),
}
"""Choices that ask for other keys beside them: with parts and without, the same is said of them."""


def others(value, about):
    """What a key could hold in place of a value: each other choice, a number by a hundredth, each item of a list."""
    if about is not None and about.choices:
        yield from (choice for choice in about.choices if choice != value)
    elif isinstance(value, bool):
        yield str(not value).lower()
    elif isinstance(value, int | float):
        yield less(value)
    elif isinstance(value, list):
        for place, item in enumerate(value):
            yield from (", ".join(map(str, [*value[:place], new, *value[place + 1 :]])) for new in others(item, None))
    elif value[:1] in "+-.0123456789" and " " in value:
        number, unit = value.split(" ", 1)
        yield f"{less(float(number))} {unit}"
    elif about is not None and about.rule is not None:
        yield about.example  # a word in the place of a quantity
    else:
        yield value.replace("-03-", "-06-") if value.endswith("Z") else f"{value} too"


def less(number):
    """Another number near by, which most bounds leave room for."""
    return str(number + 1) if isinstance(number, int) else f"{0.99 * number or 1.0:.9g}"


def changes(draft, table):
    """What is changed, and the draft with it: each key of a table, those it may have and those it can do without."""
    for key, value in draft.values.items():
        if key.partition(".")[0] == table or (table == "" and "." not in key):
            fitting = [FITTING[key]] if key in FITTING else others(value_of(value.raw), value.about)
            for typed in fitting:
                yield f"{key} = {typed}", draft.set(key, typed)
            if value.about is not None and not value.about.required:
                yield f"no {key}", draft.without(key)
    for about in draft.absent:
        if about.key.partition(".")[0] == table and "." in about.key:
            for typed in about.choices or (about.example or "text",):
                yield f"{about.key} = {typed}", draft.set(about.key, typed)


def refused(draft):
    try:
        draft.file()
    except MissionError:
        return True
    return False


# --------------------------------------------------------------------------------------------------- what is compared
@pytest.fixture(scope="module", autouse=True)
def quick():
    """The baseline and one more controller, and short sines."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(designs, "families", lambda m: (PI,))
        patch.setattr(designs, "names", lambda m: (designs.BASELINE, PI.name))
        patch.setattr(designs, "GRID", 4)
        patch.setattr(fine_results, "SINE_S", 0.2)
        patch.setattr(fine_results, "SINE_SETTLE_S", 0.1)
        patch.setattr(study.paper, "PROPORTIONAL_V_MRAD", (1.0,))
        patch.setattr(study.paper, "INTEGRAL_V_MRAD_S", (8e3, 16e3))
        patch.setattr(study.alternatives, "other_readings", lambda *args: ())  # no part is kept of them
        every = assumptions._changes
        patch.setattr(assumptions, "_changes", lambda *args: list(every(*args))[::5])
        patch.setattr(threads, "_may_fork", lambda: False)
        yield


def numbers(text, folder, parts):
    """Every number and word of a study by where it stands, or why there is none."""
    path = folder / "mission.toml"
    path.write_text(text, encoding="utf-8")
    try:
        found = study.run_study(load_mission(path), parts=parts)
    except (MissionError, ValueError) as error:
        return {"refused": str(error)}
    drawn = {
        each.name: (each.title, each.caption, digest(each.columns)) for each in report.study_figures(found, parts).every
    }
    assert parts.trouble == ""
    return {"summary": repr(summary(found)), "results.nc": parts.part(study_netcdf, found), **drawn}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """For a mission, a folder with the parts of it as it is."""

    @cache
    def made(path):
        folder = tmp_path_factory.mktemp("kept")
        found = numbers(shorter(path).text, folder, Kept(folder / "parts"))
        assert len(found) > 15, found
        return folder, sorted((folder / "parts").rglob("*.part"))

    return made


def differing(text, folder, known):
    """Where numbers differ with parts that were kept of the unchanged mission from those without."""
    without = numbers(text, folder, NOTHING)
    kept = numbers(text, folder, Kept(folder / "parts"))
    for path in set((folder / "parts").rglob("*.part")) - set(known):
        path.unlink()
    return sorted(name for name in kept.keys() | without if kept.get(name) != without.get(name))


# ----------------------------------------------------------------------------------------------------------- the tests
@pytest.mark.promise("decisions-1", "report-4")
@pytest.mark.parametrize(
    "changed", [HERE[0], *(pytest.param(each, marks=pytest.mark.endurance) for each in HERE[1:])], ids=" and ".join
)
def test_changed_keys_give_the_numbers_of_a_study_without_kept_parts(changed, place):
    draft = shorter(SHIPPED)
    for key, typed in changed.items():
        draft = draft.set(key, typed)
    assert not draft.problems, draft.report
    assert differing(draft.text, *place(SHIPPED)) == []


@pytest.mark.promise("decisions-1")
@pytest.mark.endurance
@pytest.mark.parametrize("table", ["", *TABLES])
@pytest.mark.parametrize("path", [SHIPPED, DEFAULT], ids=lambda path: path.stem)
def test_any_changed_key_gives_the_numbers_of_a_study_without_kept_parts(path, table, place):
    draft = shorter(path)
    assert {key.partition(".")[0] for key in draft.values if "." in key} == set(TABLES)
    found = dict(changes(draft, table))
    changed = {what: each for what, each in found.items() if what.partition(" = ")[0] in draft.values}
    assert {what for what, each in changed.items() if refused(each)} == REFUSED & found.keys()
    assert {what: wrong for what, each in found.items() if (wrong := differing(each.text, *place(path)))} == {}


@pytest.mark.promise("report-4")
def test_what_is_not_read_is_not_computed_again(place, monkeypatch):
    def computed(*args, **beside):
        pytest.fail("computed again")

    folder, _ = place(SHIPPED)
    monkeypatch.setattr(designs, "tune", computed)
    monkeypatch.setattr(study.paper, "_point", computed)
    text = shorter(SHIPPED).set("terminals.leo_aperture", "6 cm").text
    assert "summary" in numbers(text, folder, Kept(folder / "parts"))
