"""Files that a release wrote or took: each later version reads them, or refuses them and says how to migrate.

`tests/corpus/VERSION` holds them by kind. At a release its files are added; none is ever edited or removed. Beside them
`tests/corpus/bad` holds bad inputs that something has fallen over (`test_fuzz.py`).

What follows takes little: of a report its mission is read, and what is run again are the links of another one, whose
numbers differ, which is told; a plan is played into a mirror without hysteresis. `make endurance` runs each itself.
"""

import gzip
import importlib
import os
import shutil
from dataclasses import replace
from functools import cache

import pytest

from microrad.lab.bench.mirrors import linear_output
from microrad.mission.file import load_mission
from microrad.study import study
from places import TESTS
from shared import found_once
from shipped import DEFAULT, RUN_STUDY, SHIPPED, default_study, without_day, without_fine_pointing

CORPUS = TESTS / "corpus"
FILES = sorted(path for path in CORPUS.glob("[0-9]*/*/*") if path.is_file())
BESIDE = {"mission.toml"}
"""Files that others name."""

READS = {
    "missions": ("export", "matrices", "{file}", "--json"),
    "links": ("budget", "{file}", "--json"),
    "mirrors": ("export", "matrices", str(SHIPPED), "--mirror", "{file}", "--json"),
    "plans": ("bench", "{file}", "--json"),
    "campaigns": ("campaign", "run", "{file}", "--json"),
    "ledgers": ("campaign", "status", "{file}", "--json"),
    "reports": ("reproduce", "{file}", "--json"),
}
"""The public command that reads each kind."""


OFTEN = bool(os.environ.get("MICRORAD_ENDURANCE"))


@found_once
def studied(file, *args):
    """The study of a mission; of the one that `microrad init` writes it is that of other tests, too."""
    same = file.text == DEFAULT.read_text(encoding="utf-8")
    return replace(default_study(), file=file) if same else RUN_STUDY(file, *args)


@cache
def short_study():
    """The study of a mission of links alone."""
    text = without_fine_pointing(without_day(SHIPPED.read_text(encoding="utf-8")))
    return RUN_STUDY(load_mission("mission.toml", text=text))


def read(path, folder, call):
    """Run the command that reads a file of the corpus, on a copy of it with what lies beside it."""
    copied = shutil.copytree(path.parent, folder / "corpus") / path.name
    if path.suffix == ".gz":
        copied = copied.with_suffix("")
        copied.write_bytes(gzip.decompress(path.read_bytes()))
    return call(*(word.format(file=copied) for word in READS[path.parent.name]))


def reads_or_says_how_to_migrate(done):
    """Exit codes 0 and 1 are answers, and 1 is one of a mission that does not close or of a report that differs."""
    return done.code in {0, 1} or (done.code == 2 and "migrate" in done.err)


@pytest.fixture
def once(monkeypatch):
    """A mission is studied once, whatever carries it, or not at all."""
    monkeypatch.setattr(study, "run_study", studied if OFTEN else lambda file, *args: short_study())
    if not OFTEN:
        play = importlib.import_module("microrad.lab.bench.play")  # beside it stands a function of that name
        monkeypatch.setattr(
            play, "bench_output", lambda drive, rest_v, rate_hz, _: linear_output(drive, rest_v, rate_hz)
        )


@pytest.mark.usefixtures("once", "undrawn", "rows_here")
@pytest.mark.parametrize(
    "path", [path for path in FILES if path.name not in BESIDE], ids=lambda path: str(path.relative_to(CORPUS))
)
def test_a_file_of_an_older_version_is_read_or_refused_with_how_to_migrate(path, folder, call):
    done = read(path, folder, call)
    assert reads_or_says_how_to_migrate(done), done
    assert "Traceback" not in done.err


@pytest.mark.promise("releasing-2")
def test_each_release_has_every_kind():
    for release in CORPUS.glob("[0-9]*"):
        assert {path.name for path in release.iterdir()} == READS.keys()
        assert all(any(kind.iterdir()) for kind in release.iterdir())
    assert sum(path.stat().st_size for path in FILES) < 3e6


def test_a_file_that_is_refused_without_a_word_on_migrating_would_be_found(folder, call):
    path = folder / "0.1.0" / "links" / "other.toml"
    path.parent.mkdir(parents=True)
    text = (CORPUS / "0.1.0" / "links" / "paper.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("geo_aperture = ", "geo_opening = "), encoding="utf-8")
    done = read(path, folder, call)
    assert (done.code, reads_or_says_how_to_migrate(done)) == (2, False)
    assert reads_or_says_how_to_migrate(done._replace(err="...; to migrate, rename the key"))
