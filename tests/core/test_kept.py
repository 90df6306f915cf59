"""Parts that are kept from run to run: taken again where all they read is the same, and never trusted otherwise."""

import errno
import os
import pickle
import shutil
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from microrad.core import kept, machine
from microrad.core.folder import DRAFT
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


def is_given(inputs):
    CALLS.append(inputs.gain if isinstance(inputs.gain, float) else "?")
    return isinstance(inputs.gain, float)


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


def drafts(place):
    return sorted(place.rglob(f".microrad-*{DRAFT}"))


ONE = Inputs(2.0, "one")


@pytest.mark.promise("report-4")
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


def test_a_kept_part_does_not_end_a_run_with_values_that_have_no_digest(place):
    assert Kept(place).part(is_given, ONE)
    parts = Kept(place)
    assert not parts.part(is_given, Inputs(object()))
    assert (CALLS, parts.trouble) == ([2.0, "?"], "")


@pytest.mark.promise("decisions-1", "report-5")
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


@pytest.mark.promise("report-4")
@pytest.mark.parametrize("of", ["source_sha256", "machine", "versions"])
def test_parts_of_other_code_libraries_or_machines_are_not_taken(place, monkeypatch, of):
    Kept(place).part(samples, ONE, 3)
    monkeypatch.setattr(kept, of, lambda: "another")
    Kept(place).part(samples, ONE, 3)
    assert CALLS == [2.0, 2.0]


def test_a_file_in_the_place_of_the_folder_is_told_once(place):
    place.parent.mkdir()
    place.write_text("not a folder")
    parts = Kept(place)
    assert str(place) in parts.trouble
    assert "nothing is kept" in parts.trouble
    for _ in range(2):
        assert parts.part(samples, ONE, 3).samples.size == 3
    assert place.read_text() == "not a folder"


@pytest.mark.promise("report-5")
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


@pytest.fixture
def entered(monkeypatch):
    """Folders as if others might enter each of them, but for those in the list; a link in it is another user's."""
    lstat, but = kept.Path.lstat, []

    def seen(path):
        found = lstat(path)
        mode = found.st_mode | (0 if path in but else 0o011)
        own = found.st_uid + (path in but and stat.S_ISLNK(mode))
        return os.stat_result((mode, *found[1:4], own, *found[5:]))

    monkeypatch.setattr(kept.Path, "lstat", seen)
    return but


@pytest.mark.promise("report-5")
@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
def test_a_folder_below_one_that_others_may_write_into_is_not_used(tmp_path, entered):
    shared = tmp_path / "shared"
    place = shared / "cache" / "parts"
    shared.mkdir()
    for mode, taken in ((0o777, False), (0o770, False), (0o1777, True), (0o755, True)):
        shared.chmod(mode)
        parts = Kept(place)
        parts.part(samples, ONE, 3)
        said = f"{place}: others may write into {shared}: nothing is kept for a quicker next run"
        assert parts.trouble == ("" if taken else said)
    assert CALLS == [2.0] * 3  # the last one was kept by the one before
    shared.chmod(0o777)
    entered.append(tmp_path)  # nobody else comes that far
    assert Kept(place).trouble == ""


@pytest.mark.skipif(sys.platform == "win32", reason="no such links")
def test_a_folder_behind_a_link_of_another_user_is_not_used(tmp_path, entered):
    link, behind = tmp_path / "link", tmp_path / "shared" / "behind"
    behind.mkdir(parents=True)
    link.symlink_to("shared/behind")
    place = link / "cache" / "parts"
    parts = Kept(place)
    parts.part(samples, ONE, 3)
    assert parts.trouble == ""
    assert len(files(behind)) == 1
    behind.parent.chmod(0o777)
    assert f"others may write into {behind.parent}" in Kept(place).trouble
    behind.parent.chmod(0o755)
    entered.append(link)
    assert f"{link} is another user's" in Kept(place).trouble


@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
@pytest.mark.parametrize(("above", "trouble"), [(0, ""), (1, " is another user's: nothing is kept")])
def test_folders_of_the_system_may_stand_above_the_users_and_those_of_others_may_not(
    tmp_path, monkeypatch, above, trouble
):
    """As /home is: what the user has made is here that of the user 1000, and all above it that of another one."""
    place = tmp_path / "cache" / "parts"

    def owned(path, **_):
        found = os.lstat(path)
        by = 1000 if path.is_relative_to(tmp_path) else above
        return os.stat_result((found.st_mode | 0o011, *found[1:4], by, *found[5:]))

    monkeypatch.setattr(os, "getuid", lambda: 1000)
    monkeypatch.setattr(kept.Path, "stat", owned)
    monkeypatch.setattr(kept.Path, "lstat", owned)
    assert trouble in Kept(place).trouble
    assert bool(Kept(place).trouble) == bool(trouble)


@pytest.mark.promise("report-5")
@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
def test_the_folders_that_are_made_are_private(tmp_path):
    Kept(tmp_path / "new" / "microrad" / "parts")
    made = [tmp_path / "new", tmp_path / "new" / "microrad", tmp_path / "new" / "microrad" / "parts"]
    assert [each.stat().st_mode & 0o777 for each in made] == [0o700] * 3


@pytest.mark.promise("report-5")
def test_a_folder_that_cannot_be_written_is_told_once(place, monkeypatch):
    asked = []
    monkeypatch.setattr(os, "access", lambda path, mode: asked.append((path, mode)))
    parts = Kept(place)
    for _ in range(2):
        assert parts.part(samples, ONE, 3).samples.size == 3
    assert parts.trouble == f"{place}: the folder cannot be written: nothing is kept for a quicker next run"
    assert (asked, CALLS, files(place)) == ([(place, os.W_OK | os.X_OK)], [2.0, 2.0], [])


@pytest.mark.promise("report-5")
@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
def test_parts_are_private(place):
    Kept(place).part(samples, ONE, 3)
    (file,) = files(place)
    assert [p.stat().st_mode & 0o077 for p in (place, file.parent)] == [0, 0]


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "a"), os.strerror(errno.ENOSPC)),
        (OSError("the library says so"), "the library says so"),  # without a number it has no text of the system's
    ],
)
def test_a_full_disk_ends_the_keeping_and_nothing_else(place, monkeypatch, error, said):
    def full(path, content, **_):
        raise error

    parts = Kept(place)
    monkeypatch.setattr(kept, "write_whole", full)
    for _ in range(2):
        assert parts.part(samples, ONE, 3).samples.size == 3
    assert parts.trouble == f"{place}: {said}: nothing is kept for a quicker next run"
    assert not files(place)


@pytest.mark.promise("report-5")
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


@pytest.mark.parametrize(("beyond", "left"), [(0, 2), (1, 1)])
def test_the_folder_may_be_as_large_as_it_may_be_and_no_larger(place, beyond, left):
    Kept(place).part(samples, ONE, 3)
    (one,) = files(place)
    Kept(place, most_bytes=2 * one.stat().st_size - beyond).part(samples, replace(ONE, gain=3.0), 3)
    assert len(files(place)) == left
    assert one.exists() == (left == 2)  # the one that was used last stays


def test_the_empty_folder_of_a_part_goes_once_it_is_old(place):
    Kept(place)
    for name, age_s in (("old", kept.LONGEST_EMPTY_S + 5.0), ("new", kept.LONGEST_EMPTY_S - 50.0)):
        (place / name).mkdir()
        os.utime(place / name, (time.time() - age_s,) * 2)
    Kept(place).part(samples, ONE, 3)
    assert not (place / "old").exists() and (place / "new").exists()


def test_only_the_latest_results_of_a_part_are_kept(place):
    for gain in range(kept.MOST_OF_A_PART + 3):
        Kept(place).part(samples, Inputs(float(gain)), 3)
    assert len(files(place)) == kept.MOST_OF_A_PART


@pytest.mark.promise("report-5")
def test_many_at_once_do_no_harm(place):
    def run(number):
        parts = Kept(place)
        last = [parts.part(samples, Inputs(float(g % 3)), 50).samples[-1] for g in range(number, number + 6)]
        return last, parts.trouble

    with ThreadPoolExecutor(8) as pool:
        for number, found in enumerate(pool.map(run, range(16))):
            assert found == ([49.0 * (g % 3) for g in range(number, number + 6)], "")
    assert drafts(place) == []


AT_ONCE = """
import sys
from pathlib import Path
from microrad.core import kept

kept.LONGEST_EMPTY_S = -1.0  # folders vanish beneath whoever is about to write into them
kept.machine = dict  # quick
parts = kept.Kept(Path(sys.argv[1]), most_bytes=2_000_000)  # four of nine, so that each is soon deleted
print("ready", flush=True)
sys.stdin.readline()
for number in range(60):
    size = 499_000 + number * int(sys.argv[2]) % 9
    assert parts.part(bytes, size) == bytes(size)
print(repr(parts.trouble))
"""


@pytest.mark.promise("report-5")
def test_two_processes_at_once_do_no_harm(place):
    piped = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    runs = [subprocess.Popen([sys.executable, "-c", AT_ONCE, place, step], **piped) for step in "25"]
    for run in runs:
        assert run.stdout.readline() == "ready\n", run.stderr.read()
    for run in runs:
        run.stdin.write("go\n")
        run.stdin.flush()
    for run in runs:
        assert run.communicate() == ("''\n", "")
        assert run.returncode == 0
    assert drafts(place) == []


def test_a_draft_of_another_run_is_left_alone_and_one_of_a_run_that_was_killed_goes(place, monkeypatch):
    """The other run has half of its part written when this one looks for parts, writes its own and makes room."""
    parts = Kept(place)
    parts.part(samples, ONE, 3)
    (file,) = files(place)
    half = file.read_bytes()[:50]
    others = [file.with_name(f".microrad-{name}{DRAFT}") for name in (os.getpid(), f"{os.getpid()}-1", "0" * 16)]
    for other in others:
        other.write_bytes(half)
    for gain in range(4):
        Kept(place, most_bytes=1).part(samples, Inputs(float(gain)), 3)
        parts.part(samples, Inputs(float(gain)), 3)
    assert [other.read_bytes() for other in others] == [half] * 3
    assert parts.trouble == ""
    old = time.time() - kept.LONGEST_DRAFT_S - 1.0
    os.utime(others[0], (old, old))
    parts.part(samples, Inputs(9.0), 3)
    assert drafts(place) == sorted(others[1:])


@pytest.mark.promise("report-5")
@pytest.mark.parametrize("of", ["_latest_first", "_touch", "write_whole"])
def test_a_folder_that_vanishes_meanwhile_ends_nothing(place, monkeypatch, of):
    """As another run makes room in it, or the user deletes it: each step finds the folder gone."""
    parts, step = Kept(place), getattr(kept, of)

    def gone(*args, **more):
        shutil.rmtree(place, ignore_errors=True)
        return step(*args, **more)

    with monkeypatch.context() as patch:
        patch.setattr(kept, of, gone)
        assert parts.part(samples, ONE, 3).samples.size == 3
    assert parts.trouble == ""
    place.mkdir(mode=0o700, exist_ok=True)
    parts.part(samples, ONE, 3)
    assert len(files(place)) == 1  # kept again where it can be


def test_what_else_stands_in_the_folder_is_left_alone(place):
    place.mkdir(parents=True, mode=0o700)
    (place / "notes.txt").write_text("a file")
    (place / "mine").mkdir()
    (place / "mine" / "keep.txt").write_text("another")
    Kept(place).part(samples, ONE, 3)
    folder = files(place)[0].with_name("folder.part")
    folder.mkdir()
    elsewhere = place.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "a.part").write_text("of somebody else")
    (place / "link").symlink_to(elsewhere)
    parts = Kept(place, most_bytes=1)
    parts.part(samples, Inputs(3.0), 3)
    assert parts.trouble == ""
    assert files(place) == [folder]
    assert [path.name for path in elsewhere.iterdir()] == ["a.part"]
    assert [(place / name).read_text() for name in ("notes.txt", "mine/keep.txt")] == ["a file", "another"]


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


@pytest.mark.parametrize("said", [None, ""])
def test_without_a_folder_for_caches_parts_stand_in_the_users_home(monkeypatch, tmp_path, said):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    if said is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", said)
    monkeypatch.setattr(kept.Path, "home", lambda: tmp_path)
    assert kept.folder_of_user() == tmp_path / ".cache" / "microrad" / "parts"


@pytest.mark.promise("report-4", "report-5")
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
    core = tmp_path / "core"  # the package is the folder above it, and all that is in there is read
    for name in ("machine.py", "values.toml", "style.css", "__pycache__/machine.pyc"):
        (core / name).parent.mkdir(exist_ok=True)
        (core / name).write_text("1")
    monkeypatch.setattr(machine, "__file__", str(core / "machine.py"))
    known = {machine.source_sha256.__wrapped__()}
    (core / "__pycache__" / "loops.nbc").write_text("compiled meanwhile")
    (core / "style.css").write_text("other looks")
    known.add(machine.source_sha256.__wrapped__())
    assert len(known) == 1
    for name in ("machine.py", "values.toml"):
        (core / name).write_text("2")
        known.add(machine.source_sha256.__wrapped__())
    assert len(known) == 3


@pytest.mark.skipif(sys.platform == "win32", reason="no such permissions")
@pytest.mark.parametrize(
    ("above", "below", "said"),
    [
        ((1000, 0o755), (1000, 0o755), ""),
        ((1000, 0o755), (1000, 0o775), "others may write into {below}"),
        ((1000, 0o710), (1000, 0o775), "others may write into {below}"),  # the group may enter
        ((1000, 0o701), (1000, 0o777), "others may write into {below}"),  # all but the group may
        ((1000, 0o700), (1000, 0o777), ""),
        ((1000, 0o766), (1000, 0o777), ""),
        ((0, 0o700), (1000, 0o777), "others may write into {below}"),  # it is not the user who keeps others out
        ((1000, 0o777), (1000, 0o700), "others may write into {above}"),
        ((1000, 0o757), (1000, 0o711), "others may write into {above}"),
        ((1000, 0o1777), (1000, 0o1777), ""),
        ((0, 0o775), (1000, 0o755), "others may write into {above}"),
        ((0, 0o1777), (0, 0o755), ""),
        ((1001, 0o755), (1000, 0o755), "{above} is another user's"),
        ((1001, 0o1777), (1000, 0o777), "{above} is another user's"),
        ((1000, 0o755), (1001, 0o700), "{below} is another user's"),
        ((1000, 0o700), (1001, 0o755), ""),
    ],
)
def test_a_folder_is_the_users_alone_by_who_may_enter_and_change_those_above_it(
    tmp_path, monkeypatch, above, below, said
):
    """Of two folders above it the user and the mode are given; those above these are the system's."""
    outer, inner = tmp_path / "above", tmp_path / "above" / "below"
    place = inner / "parts"
    place.mkdir(parents=True)
    known = {outer: above, inner: below, place: (1000, 0o700)}

    def owned(path, **_):
        found = os.lstat(path)
        by, mode = known.get(path, (0, 0o755))
        return os.stat_result((stat.S_IFDIR | mode, *found[1:4], by, *found[5:]))

    monkeypatch.setattr(os, "getuid", lambda: 1000)
    monkeypatch.setattr(kept.Path, "stat", owned)
    monkeypatch.setattr(kept.Path, "lstat", owned)
    if said:
        with pytest.raises(PermissionError) as refused:
            kept._refuse_others(place)
        assert refused.value.strerror == said.format(above=outer, below=inner)
    else:
        kept._refuse_others(place)


def test_a_damaged_part_goes_though_another_one_is_asked_for(place):
    for gain in (2.0, 3.0):
        Kept(place).part(samples, Inputs(gain), 3)
    damaged = max(files(place), key=lambda file: file.stat().st_mtime_ns)
    damaged.write_bytes(damaged.read_bytes()[:-1])
    CALLS.clear()
    Kept(place).part(samples, Inputs(2.0), 3)
    assert CALLS == [] and not damaged.exists() and len(files(place)) == 1


def test_of_the_results_of_a_part_those_that_were_used_last_stay(place, monkeypatch):
    """The first is used again before there is one too many, so the second goes; another part has its own."""
    monkeypatch.setattr(kept, "MOST_OF_A_PART", 4)
    Kept(place).part(with_inputs, ONE)
    for gain in range(4):
        Kept(place).part(samples, Inputs(float(gain)), 3)
    Kept(place).part(samples, Inputs(0.0), 3)
    Kept(place).part(samples, Inputs(-1.0), 3)
    CALLS.clear()
    for gain in (0.0, -1.0, 2.0, 3.0):
        Kept(place).part(samples, Inputs(float(gain)), 3)
    assert CALLS == []
    Kept(place).part(with_inputs, ONE)
    Kept(place).part(samples, Inputs(1.0), 3)
    assert CALLS[-1:] == [1.0] and len(files(place)) == 5


@pytest.mark.parametrize(
    ("most_bytes", "left"),
    [(160, "abcd"), (159, "acd"), (100, "acd"), (99, "ac"), (30, "ac"), (29, "c"), (10, "c"), (9, ""), (0, "")],
)
def test_room_is_made_by_what_was_not_used_for_longest_in_all_folders(tmp_path, most_bytes, left):
    """Parts of 20, 60, 10 and 70 bytes, the oldest last but b, in two folders; what else stands there counts not."""
    now = time.time()
    for name, size, age_s in (("one/a", 20, 20), ("two/b", 60, 40), ("two/c", 10, 10), ("one/d", 70, 30)):
        path = tmp_path / f"{name}.part"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(bytes(size))
        os.utime(path, (now - age_s, now - age_s))
    (tmp_path / "one" / "notes.txt").write_bytes(bytes(1000))
    for name in ("one", "two"):  # old, and not empty
        os.utime(tmp_path / name, (now - 2 * kept.LONGEST_EMPTY_S,) * 2)
    kept._make_room(tmp_path, most_bytes)
    assert sorted(path.stem for path in tmp_path.rglob("*.part")) == list(left)
    assert (tmp_path / "one" / "notes.txt").stat().st_size == 1000 and (tmp_path / "two").is_dir()
