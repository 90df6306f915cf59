"""Parts that are kept from run to run: taken again where all they read is the same, and never trusted otherwise."""

import errno
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from microrad.core import kept, machine
from microrad.core.kept import Kept


@dataclass(frozen=True, slots=True)
class Inputs:
    gain: float
    label: str = ""
    limit: float = 1.0


@dataclass(frozen=True, slots=True)
class Result:
    samples: np.ndarray
    inputs: Inputs | None = None


CALLS = []


def samples(inputs, count, on_progress=None):
    CALLS.append(inputs.gain)
    return Result(inputs.gain * np.arange(float(count)))


def with_inputs(inputs):
    CALLS.append(inputs.gain)
    return Result(np.zeros(1), inputs)


def refused(inputs):
    CALLS.append(inputs.gain)
    raise ValueError("no")


@pytest.fixture(autouse=True)
def no_calls():
    CALLS.clear()


@pytest.fixture
def place(tmp_path):
    return tmp_path / "cache" / "parts"


def files(place):
    return sorted(place.rglob("*.part"))


ONE = Inputs(2.0, "one")


def test_a_part_is_computed_once_and_again_for_what_it_reads(place):
    for inputs in (ONE, ONE, replace(ONE, label="other"), replace(ONE, limit=9.0)):
        found = Kept(place).part(samples, inputs, 3, on_progress=print)
        assert found.samples.tolist() == [0.0, 2.0, 4.0]
    assert CALLS == [2.0]
    assert Kept(place).part(samples, replace(ONE, gain=3.0), 3).samples.tolist() == [0.0, 3.0, 6.0]
    assert Kept(place).part(samples, ONE, 2).samples.tolist() == [0.0, 2.0]
    assert CALLS == [2.0, 3.0, 2.0]


def test_what_is_handed_out_is_the_same_when_it_is_made_and_when_it_is_kept(place):
    first, second = (Kept(place).part(with_inputs, ONE) for _ in range(2))
    assert pickle.dumps(first) == pickle.dumps(second)
    assert [type(each.inputs) for each in (first, second)] == [Inputs, Inputs]
    assert first.inputs == ONE
    third = Kept(place).part(with_inputs, replace(ONE, limit=2.0))  # nothing of it was read, but it is in the result
    assert third.inputs.limit == 2.0


@dataclass(frozen=True, slots=True)
class Compiled:
    """A record that holds what cannot be copied, as the orbit of an element set does, and says what it is made of."""

    gain: float
    handle: object = field(init=False, default_factory=object)

    def __reduce__(self):
        return Compiled, (self.gain,)


def with_handle(inputs, compiled):
    CALLS.append(inputs.gain)
    return inputs.gain * compiled.gain, compiled.handle is not None


def test_a_record_that_says_what_it_is_made_of_is_known_by_that(place):
    for gain in (1.5, 1.5, 2.5):
        assert Kept(place).part(with_handle, ONE, Compiled(gain)) == (2.0 * gain, True)
    assert CALLS == [2.0, 2.0]


def test_errors_are_not_kept(place):
    for _ in range(2):
        with pytest.raises(ValueError, match="no"):
            Kept(place).part(refused, ONE)
    assert CALLS == [2.0, 2.0]
    assert not files(place)


def test_what_cannot_be_told_from_another_value_is_computed(place):
    def local(inputs):
        CALLS.append("")
        return inputs.gain is not None

    for _ in range(2):
        assert Kept(place).part(local, Inputs(object()))
    assert len(CALLS) == 2
    assert not files(place)


@pytest.mark.parametrize("spoil", ["cut", "empty", "flipped", "other"])
def test_a_damaged_part_is_made_again_without_a_word(place, spoil, capfd):
    Kept(place).part(samples, ONE, 3)
    (file,) = files(place)
    content = file.read_bytes()
    for at in range(0, len(content), 97) if spoil == "flipped" else [0]:
        flipped = content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]
        file.write_bytes(
            {"cut": content[:-1], "empty": b"", "flipped": flipped, "other": b"microrad part 0\n" + content[16:]}[spoil]
        )
        CALLS.clear()
        parts = Kept(place)
        assert parts.part(samples, ONE, 3).samples.tolist() == [0.0, 2.0, 4.0]
        assert (CALLS, parts.trouble, capfd.readouterr()) == ([2.0], "", ("", ""))
        assert file.read_bytes() == content


@pytest.mark.parametrize("of", ["source_sha256", "machine", "versions"])
def test_parts_of_other_code_libraries_or_machines_are_not_taken(place, monkeypatch, of):
    Kept(place).part(samples, ONE, 3)
    monkeypatch.setattr(kept, of, lambda: "another")
    Kept(place).part(samples, ONE, 3)
    assert CALLS == [2.0, 2.0]


def test_parts_depend_on_the_files_beside_them(place):
    contents = ["a"]
    Kept(place, lambda: contents).part(samples, ONE, 3)
    Kept(place, lambda: ["b"]).part(samples, ONE, 3)
    assert CALLS == [2.0, 2.0]
    parts = Kept(place, lambda: list(contents))
    contents[0] = "changed while it runs"
    parts.part(samples, replace(ONE, gain=5.0), 3)
    Kept(place, lambda: ["a"]).part(samples, replace(ONE, gain=5.0), 3)
    assert CALLS[2:] == [5.0, 5.0]


def test_a_file_in_the_place_of_the_folder_is_told_once(place):
    place.parent.mkdir()
    place.write_text("not a folder")
    parts = Kept(place)
    assert str(place) in parts.trouble
    assert "nothing is kept" in parts.trouble
    for _ in range(2):
        assert parts.part(samples, ONE, 3).samples.size == 3
    assert place.read_text() == "not a folder"


@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
@pytest.mark.parametrize("mode", [0o777, 0o770, 0o707])
def test_a_folder_into_which_others_may_write_is_not_used(place, mode):
    place.mkdir(parents=True)
    place.chmod(mode)
    parts = Kept(place)
    assert "others may write" in parts.trouble
    parts.part(samples, ONE, 3)
    assert not files(place)


@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
def test_the_folder_of_another_user_is_not_used(place, monkeypatch):
    place.mkdir(parents=True, mode=0o700)
    monkeypatch.setattr(os, "getuid", lambda: place.stat().st_uid + 1)
    assert "others may write" in Kept(place).trouble


@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
def test_parts_are_private(place):
    Kept(place).part(samples, ONE, 3)
    (file,) = files(place)
    assert [p.stat().st_mode & 0o077 for p in (place, file.parent)] == [0, 0]


def test_a_full_disk_ends_the_keeping_and_nothing_else(place, monkeypatch):
    def full(path, content, **_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    parts = Kept(place)
    monkeypatch.setattr(kept, "write_whole", full)
    for _ in range(2):
        assert parts.part(samples, ONE, 3).samples.size == 3
    assert os.strerror(errno.ENOSPC) in parts.trouble
    assert not files(place)


def test_the_folder_stays_within_its_size(place):
    parts = Kept(place, most_bytes=40_000)
    for gain in range(6):
        parts.part(samples, Inputs(float(gain)), 1000)  # 8 kB each
    assert 0 < sum(f.stat().st_size for f in files(place)) <= 40_000
    CALLS.clear()
    Kept(place).part(samples, Inputs(5.0), 1000)
    assert CALLS == []  # the latest one is still there
    Kept(place).part(samples, Inputs(0.0), 1000)
    assert CALLS == [0.0]


def test_only_the_latest_results_of_a_part_are_kept(place):
    for gain in range(kept.MOST_OF_A_PART + 3):
        Kept(place).part(samples, Inputs(float(gain)), 3)
    assert len(files(place)) == kept.MOST_OF_A_PART


def test_many_at_once_do_no_harm(place):
    def run(number):
        return [Kept(place).part(samples, Inputs(float(g % 3)), 50).samples[-1] for g in range(number, number + 6)]

    with ThreadPoolExecutor(8) as pool:
        for number, found in enumerate(pool.map(run, range(16))):
            assert found == [49.0 * (g % 3) for g in range(number, number + 6)]
    assert [f for f in place.rglob("*") if f.suffix == ".part" and f.name.startswith(".")] == []


def test_another_process_takes_it(place):
    code = (
        "import sys; from pathlib import Path; from microrad.core import kept, reads\n"
        "print(kept.Kept(Path(sys.argv[1])).part(reads.digest, (1.5, 'x')).hex())"
    )
    found = set()
    for seed in ("1", "2"):
        run = [sys.executable, "-c", code, place]
        own = {**os.environ, "PYTHONHASHSEED": seed}
        found.add(subprocess.run(run, env=own, capture_output=True, text=True, check=True).stdout)
        changed = [f.stat().st_ino for f in files(place)]
        assert len(changed) == 1
    assert len(found) == 1


def test_a_user_without_a_home_has_nothing_kept(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    for name in ("XDG_CACHE_HOME", kept.OFF):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(kept.Path, "home", homeless)
    for _ in range(2):
        kept.of_user().part(samples, ONE, 3)
    assert CALLS == [2.0, 2.0]


def test_it_is_off_where_the_environment_says_so(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv(kept.OFF, "no")
    assert kept.of_user() is kept.NOTHING
    monkeypatch.delenv(kept.OFF)
    kept.of_user().part(samples, ONE, 3)
    assert len(files(tmp_path / "microrad" / "parts")) == 1


def test_the_code_of_a_number_is_known_by_its_files_and_not_by_what_is_compiled_or_gives_a_page_its_looks(
    monkeypatch, tmp_path
):
    for name in ("machine.py", "values.toml", "style.css", "__pycache__/machine.pyc"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1")
    monkeypatch.setattr(machine, "__file__", str(tmp_path / "machine.py"))
    known = {machine.source_sha256.__wrapped__()}
    (tmp_path / "__pycache__" / "loops.nbc").write_text("compiled meanwhile")
    (tmp_path / "style.css").write_text("other looks")
    known.add(machine.source_sha256.__wrapped__())
    assert len(known) == 1
    for name in ("machine.py", "values.toml"):
        (tmp_path / name).write_text("2")
        known.add(machine.source_sha256.__wrapped__())
    assert len(known) == 3
