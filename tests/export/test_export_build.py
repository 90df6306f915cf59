"""Compiling exported code and running its bench: results, and what is said where it fails."""

import math
import os
import re
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from microrad.export.flight import build
from microrad.export.records import ExportError
from waiting import gone, lines_of

needs_compiler = pytest.mark.skipif(not any(map(shutil.which, build.COMPILERS)), reason="no C compiler here")
needs_make = pytest.mark.skipif(shutil.which("make") is None, reason="no make here")

CODE = "double gain_step(double x);\ndouble gain_step(double x) { return 2.0 * x; }\n"

BENCH = """#include <stdio.h>
double gain_step(double x);
int main(int count, char **words) {
    char line[64];
    FILE *file = fopen(words[1], "r");
    if (file == NULL || fgets(line, 64, file) == NULL || fclose(file)) return 2;
    printf("samples %d\\nlargest_difference_v %g\\n", count, gain_step(DIFFERENCE));
    printf("peak_command_v 3.5\\nbound_v 1e-3\\nsaturated 4\\nrate_clamped 5\\nrejected 6\\nfaults 7\\n");
    printf("worst_step_ns %s\\nmedian_step_ns 20.5\\nclock_ns 18\\ncycles_per_ns 2.5\\nBEHIND", words[2]);
    return gain_step(DIFFERENCE) > 1e-3;
}
"""

EXPECTED = build.BenchResult(3, 2e-4, 3.5, 1e-3, 4, 5, 6, 7, 11.0, 20.5, 18.0, 2.5)


def written(folder: Path, difference: str = "1e-4", behind: str = "", makefile: str | None = None) -> Path:
    """Code named ``gain`` in the folder, whose bench finds twice this difference and ends with a line more."""
    bench = BENCH.replace("DIFFERENCE", difference).replace("BEHIND", behind)
    for name, text in {"gain.c": CODE, "gain_bench.c": bench, "vectors.csv": "a,b\n1,2\n"}.items():
        (folder / name).write_text(text)
    if makefile is not None:
        (folder / "Makefile").write_text(makefile)
    return folder


# ---------------------------------------------------------------------------------------------------- the compiler
def test_the_first_compiler_on_the_path_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert build.compiler() is None
    for name in reversed(build.COMPILERS):
        (tmp_path / name).write_text("#!/bin/sh\n")
        (tmp_path / name).chmod(0o755)
        assert build.compiler() == name
    assert build.compiler_words() == ("cc",)


def test_no_compiler_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", " ")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ExportError, match=r"no C compiler was found \(looked for cc, gcc, clang\): install one or"):
        build.compiler_words()


def test_the_environment_variable_names_the_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    odd = tmp_path / "with space" / "my cc"
    odd.parent.mkdir()
    odd.write_text("#!/bin/sh\n")
    odd.chmod(0o755)
    monkeypatch.setenv("CC", f"'{odd}' -m32")
    assert build.compiler() == f"'{odd}' -m32"
    assert build.compiler_words() == (str(odd), "-m32")
    monkeypatch.setenv("CC", str(odd))
    assert build.compiler_words() == (str(odd),)


def test_a_compiler_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -O3")
    with pytest.raises(ExportError, match="CC is 'no-such-compiler -O3', and there is no such program on the path"):
        build.compiler()
    monkeypatch.setenv("CC", "'gcc")
    with pytest.raises(ExportError, match='CC is "\'gcc": no closing quotation'):
        build.compiler()


# ----------------------------------------------------------------------------------------------------- the results
@pytest.mark.promise("export-22")
@needs_compiler
def test_the_bench_s_lines_become_a_record(tmp_path: Path) -> None:
    assert build.compile_and_run(written(tmp_path), "gain", passes=11) == EXPECTED
    assert build.compile_and_run(tmp_path, "gain") == replace(EXPECTED, worst_step_ns=20.0)


@needs_compiler
def test_what_else_the_bench_prints_is_passed_over(tmp_path: Path) -> None:
    found = build.compile_and_run(written(tmp_path, behind="noise_v 2.5e-5\\nsome 12 words\\nno number\\n"), "gain", 11)
    assert found == EXPECTED


@needs_compiler
def test_without_a_makefile_all_sources_but_other_benches_are_compiled(tmp_path: Path) -> None:
    written(tmp_path)
    (tmp_path / "gain.c").write_text("double twice(double x);\n" + CODE.replace("2.0 * x", "twice(x)"))
    (tmp_path / "other_bench.c").write_text("int main(void) { return 3; }\n")
    with pytest.raises(ExportError, match="twice"):
        build.compile_and_run(tmp_path, "gain", 11)
    (tmp_path / "part.c").write_text("double twice(double x);\ndouble twice(double x) { return 2.0 * x; }\n")
    assert build.compile_and_run(tmp_path, "gain", 11) == EXPECTED


@needs_compiler
def test_a_folder_is_named_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "made").mkdir()
    written(tmp_path / "made")
    monkeypatch.chdir(tmp_path)
    assert build.compile_and_run(Path("made"), "gain", 11) == EXPECTED


@needs_compiler
@needs_make
def test_the_makefile_of_the_folder_is_used_with_our_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = " ".join(build.compiler_words())
    monkeypatch.setenv("CC", f"{words} -DOURS")
    monkeypatch.setenv("MAKEFLAGS", "--dry-run")  # of a make that runs this; it would compile nothing
    makefile = "CC = false\ngain_bench: gain.c gain_bench.c\n\t$(CC) -DMADE -o $@ gain.c gain_bench.c\n"
    folder = written(tmp_path, behind="saturated %d\\n", makefile=makefile)
    bench = folder / "gain_bench.c"
    bench.write_text(bench.read_text().replace('saturated %d\\n", words[2]', 'saturated %d\\n", words[2], MADE + OURS'))
    assert build.compile_and_run(folder, "gain", 11) == replace(EXPECTED, saturated=2)


@needs_compiler
@needs_make
def test_what_was_compiled_before_is_compiled_anew(tmp_path: Path) -> None:
    makefile = "gain_bench: gain.c gain_bench.c\n\t$(CC) -o $@ gain.c gain_bench.c\n"
    folder = written(tmp_path, makefile=makefile)
    build.compile_and_run(folder, "gain", 11)
    written(tmp_path, difference="2e-4")
    for old in ("gain.c", "gain_bench.c"):
        os.utime(folder / old, (0, 0))
    assert build.compile_and_run(folder, "gain", 11) == replace(EXPECTED, largest_difference_v=4e-4)


# ----------------------------------------------------------------------------------------------------- the refusals
@needs_compiler
def test_a_difference_beyond_the_bound_is_an_error(tmp_path: Path) -> None:
    written(tmp_path, difference="1e-2")
    with pytest.raises(ExportError, match=r"gain in .* commands up to 0\.02 V off the recorded run, .* 0\.001 V: comp"):
        build.compile_and_run(tmp_path, "gain")


@needs_compiler
@pytest.mark.parametrize("status", [1, 3])
def test_a_failing_bench_s_first_lines_are_shown(tmp_path: Path, status: int) -> None:
    printed = "".join(f'printf("line {i} of it\\n");' for i in range(20))
    (written(tmp_path) / "gain_bench.c").write_text(
        f"#include <stdio.h>\nint main(void) {{ {printed} return {status}; }}\n"
    )
    with pytest.raises(ExportError) as caught:
        build.compile_and_run(tmp_path, "gain")
    shown = str(caught.value).splitlines()
    assert shown[0] == f"the bench of gain in {tmp_path} failed with exit status {status}:"
    assert shown[1:] == [f"  line {i} of it" for i in range(build.FIRST_LINES)] + ["  ... and 8 lines more"]


@needs_compiler
def test_a_bench_that_is_killed_and_one_that_is_silent_are_said(tmp_path: Path) -> None:
    (written(tmp_path) / "gain_bench.c").write_text("#include <stdlib.h>\nint main(void) { abort(); }\n")
    with pytest.raises(ExportError, match=r"the bench of gain in .* was ended by signal 6:\n  \(it wrote nothing\)"):
        build.compile_and_run(tmp_path, "gain")
    (tmp_path / "gain_bench.c").write_text('#include <stdio.h>\nint main(void) { puts("samples 1"); return 0; }\n')
    with pytest.raises(ExportError, match=r"printed no largest_difference_v, no peak_command_v, .*:\n  samples 1"):
        build.compile_and_run(tmp_path, "gain")


@needs_compiler
@pytest.mark.parametrize("makefile", [None, "gain_bench:\n\t$(CC) -std=c99 -Werror -o $@ gain.c gain_bench.c\n"])
def test_what_does_not_compile_is_shown(tmp_path: Path, makefile: str | None) -> None:
    (written(tmp_path, makefile=makefile) / "gain.c").write_text("int gain_step(double x) { return y; }\n")
    with pytest.raises(ExportError, match=r" in .* failed with exit status \d+:\n") as caught:
        build.compile_and_run(tmp_path, "gain")
    assert re.search(r"gain\.c:1:\d+: error: .*y", str(caught.value))
    assert len(str(caught.value).splitlines()) <= build.FIRST_LINES + 2


@needs_compiler
def test_warnings_are_errors(tmp_path: Path) -> None:
    (written(tmp_path) / "gain.c").write_text(CODE + "int unused(int x);\nint unused(int x) { return 1; }\n")
    with pytest.raises(ExportError, match="unused"):
        build.compile_and_run(tmp_path, "gain")


@needs_compiler
@needs_make
def test_what_does_not_end_is_ended_with_all_that_it_started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    makefile = "gain_bench:\n\tsleep 86400 & echo $$! > sleeping; wait\n"
    written(tmp_path, makefile=makefile)
    sleeping: list[str] = []

    class Popen(subprocess.Popen[str]):
        """Its time begins when make has started the program that does not end."""

        def communicate(self, input: str | None = None, timeout: float | None = None) -> tuple[str, str]:
            sleeping.extend(lines_of(tmp_path / "sleeping"))
            return super().communicate(input, timeout)

    monkeypatch.setattr(subprocess, "Popen", Popen)
    monkeypatch.setattr(build, "TIME_LIMIT_S", 0.5)
    with pytest.raises(ExportError, match=r"make .* gain_bench in .* did not end within 0.5 s and was stopped"):
        build.compile_and_run(tmp_path, "gain")
    assert gone(int(sleeping[0]))


def test_no_passes_and_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="0 passes of the bench: it takes at least 1"):
        build.compile_and_run(tmp_path, "gain", passes=0)
    with pytest.raises(ExportError, match=r"has no gain\.c, no gain_bench\.c, no vectors\.csv: export the code there"):
        build.compile_and_run(tmp_path, "gain")
    (written(tmp_path) / "vectors.csv").unlink()
    with pytest.raises(ExportError, match=r"has no vectors\.csv: export"):
        build.compile_and_run(tmp_path, "gain")


@needs_compiler
def test_a_compiler_that_cannot_be_started_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "broken-cc"
    broken.write_bytes(b"\x7fELF nothing")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    with pytest.raises(ExportError, match=r"broken-cc cannot be run in .*: Exec format error"):
        build.compile_and_run(written(tmp_path), "gain")


# ------------------------------------------------------------------------------------- what a bench says, without one
WHOLE = (
    "samples 3\nlargest_difference_v {}\npeak_command_v 3.5\nbound_v 1e-3\nsaturated 4\nrate_clamped 5\nrejected 6\n"
    "faults 7\nworst_step_ns 11\nmedian_step_ns 20.5\nclock_ns 18\ncycles_per_ns 2.5\n"
)


@pytest.mark.parametrize(
    ("code", "difference", "words"),
    [
        (0, "2e-4", ""),
        (0, "1e-3", ""),
        (1, "1.1e-3", r"commands up to 0\.0011 V off the recorded run, and its bound is 0\.001 V"),
        (1, "1e-3", "the bench of gain in .* failed with exit status 1:"),  # something else, within the bound
        (2, "1.1e-3", "the bench of gain in .* failed with exit status 2:"),
        (-11, "1.1e-3", "the bench of gain in .* was ended by signal 11:"),
    ],
)
def test_a_difference_is_blamed_where_the_bench_says_so_and_it_is_beyond_the_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, difference: str, words: str
) -> None:
    asked = []
    monkeypatch.setattr(build, "_compile", lambda folder, name: folder / f"{name}_bench")
    monkeypatch.setattr(
        build, "run", lambda command, folder: (asked.append(command), (code, WHOLE.format(difference)))[1]
    )
    written(tmp_path)
    if words:
        with pytest.raises(ExportError, match=words):
            build.compile_and_run(tmp_path, "gain", 1)
    else:
        found = build.compile_and_run(tmp_path, "gain", 1)
        assert found == replace(EXPECTED, largest_difference_v=float(difference))
    assert asked == [(str(tmp_path / "gain_bench"), "vectors.csv", "1")]


@pytest.mark.parametrize(("lines", "more"), [(0, []), (1, []), (12, []), (13, ["  ... and 1 lines more"])])
def test_a_failure_shows_the_first_lines_and_how_many_there_are_more(lines: int, more: list[str]) -> None:
    assert build.FIRST_LINES == 12
    text = "\n \n".join(f"line {k}" for k in range(lines))
    shown = str(build._failure("what", text)).splitlines()
    first = [f"  line {k}" for k in range(min(lines, 12))] or ["  (it wrote nothing)"]
    assert shown == ["what:", *first, *more]


@pytest.mark.parametrize(
    ("code", "words"), [(1, "failed with exit status 1"), (-1, "was ended by signal 1"), (-9, "was ended by signal 9")]
)
def test_an_ending_is_told_by_its_status_or_its_signal(code: int, words: str) -> None:
    assert build._ending(code) == words


def test_a_program_runs_in_its_folder_without_input_in_plain_words_and_as_no_part_of_another_make(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "LC_ALL", "OTHER_FLAGS"):
        monkeypatch.setenv(key, "odd")
    script = (
        "import os, sys\n"
        "print(sorted(k for k, v in os.environ.items() if v == 'odd'), os.environ['LC_ALL'], repr(sys.stdin.read()))\n"
        "print(os.path.basename(os.getcwd()), sys.argv[1:], flush=True)\n"
        "os.write(2, b'an error of \\xff\\n')\n"
        "sys.exit(3)\n"
    )
    asked: dict[str, object] = {}

    class Popen(subprocess.Popen[str]):
        def __init__(self, command: tuple[str, ...], **more: Any) -> None:
            asked.update(more)
            super().__init__(command, **more)

    monkeypatch.setattr(subprocess, "Popen", Popen)
    (tmp_path / "deep").mkdir()
    code, text = build.run((sys.executable, "-c", script, "a b", "c"), tmp_path / "deep")
    assert code == 3
    assert text.splitlines() == ["['OTHER_FLAGS'] C ''", "deep ['a b', 'c']", "an error of \ufffd"]
    assert (asked["stdin"], asked["start_new_session"]) == (subprocess.DEVNULL, True)


def test_numbers_of_a_bench_are_the_lines_of_one_word_and_one_number() -> None:
    text = "samples 3\nbound_v 1e-3 V\n  peak_command_v\t-2.5  \nmedian fast\nlonely\n\nsamples 4\nfound nan\n7 8\n"
    found = build._numbers(text)
    assert math.isnan(found.pop("found"))
    assert found == {"samples": 4.0, "peak_command_v": -2.5, "7": 8.0}


@pytest.mark.parametrize(
    ("asked", "there", "words"),
    [
        ("gcc -m32", {"gcc"}, ("gcc", "-m32")),
        ("/my tools/cc", {"/my tools/cc", "/my"}, ("/my tools/cc",)),
        ("'/my tools/cc' -O0 \"-D A\"", {"/my tools/cc"}, ("/my tools/cc", "-O0", "-D A")),
        ("  clang  ", {"clang"}, ("clang",)),
        ("cc 'open", set(), 'the environment variable CC is "cc \'open": no closing quotation'),
        (
            "gone -m32",
            {"cc"},
            "the environment variable CC is 'gone -m32', and there is no such program on the path: set",
        ),
    ],
)
def test_the_words_of_the_compiler_are_those_of_the_environment(
    monkeypatch: pytest.MonkeyPatch, asked: str, there: set[str], words: tuple[str, ...] | str
) -> None:
    monkeypatch.setenv("CC", asked)
    monkeypatch.setattr(build.shutil, "which", lambda name: name if name in there else None)
    if isinstance(words, tuple):
        assert (build.compiler(), build.compiler_words()) == (asked.strip(), words)
        return
    with pytest.raises(ExportError) as told:
        build.compiler_words()
    assert str(told.value).startswith(words)


# ------------------------------------------------------------------------------------------- what ends early, and how
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no groups of processes here")
def test_who_interrupts_the_wait_ends_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[subprocess.Popen[str]] = []

    class Popen(subprocess.Popen[str]):
        def communicate(self, input: str | None = None, timeout: float | None = None) -> tuple[str, str]:
            made.append(self)
            raise KeyboardInterrupt

    monkeypatch.setattr(subprocess, "Popen", Popen)
    with pytest.raises(KeyboardInterrupt):
        build.run((sys.executable, "-c", "import time; time.sleep(5)"), tmp_path)
    assert made[0].returncode == -signal.SIGKILL


@pytest.mark.parametrize("groups", [True, False])
def test_a_program_that_ended_just_in_time_or_has_no_group_is_told_to_have_taken_too_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, groups: bool
) -> None:
    """Where there are no groups of processes, as on Windows, the program itself is ended."""
    ended: list[str] = []

    class Popen(subprocess.Popen[str]):
        def communicate(self, input: str | None = None, timeout: float | None = None) -> tuple[str, str]:
            assert timeout == 2.5
            raise subprocess.TimeoutExpired(self.args, timeout)

        def kill(self) -> None:
            ended.append("program")
            super().kill()

    def killpg(group: int, number: int) -> None:
        ended.append("group")
        raise ProcessLookupError

    monkeypatch.setattr(subprocess, "Popen", Popen)
    monkeypatch.setattr(build, "TIME_LIMIT_S", 2.5)
    if groups:
        monkeypatch.setattr(build.os, "killpg", killpg, raising=False)
    else:
        monkeypatch.delattr(build.os, "killpg", raising=False)
    with pytest.raises(ExportError) as told:
        build.run((sys.executable, "-c", "0", "a b"), tmp_path)
    assert str(told.value) == f"{sys.executable} -c 0 'a b' in {tmp_path} did not end within 2.5 s and was stopped"
    assert ended == (["group"] if groups else ["program"])


def test_of_three_files_of_code_those_that_are_missing_are_named_and_one_pass_is_enough(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path)
    asked: list[object] = []
    monkeypatch.setattr(build, "_compile", lambda folder, name: asked.append((folder, name)) or folder / "made")
    monkeypatch.setattr(
        build, "run", lambda command, folder: asked.append((command, folder)) or (0, WHOLE.format("1e-4"))
    )
    for passes, words in (({}, "20"), ({"passes": 1}, "1")):
        asked.clear()
        assert build.compile_and_run(tmp_path, "gain", **passes) == replace(EXPECTED, largest_difference_v=1e-4)
        assert asked == [(tmp_path, "gain"), ((str(tmp_path / "made"), "vectors.csv", words), tmp_path)]
    (tmp_path / "vectors.csv").unlink()
    (tmp_path / "vectors.csv").mkdir()
    (tmp_path / "gain.c").unlink()
    with pytest.raises(ExportError) as told:
        build.compile_and_run(tmp_path, "gain")
    assert str(told.value) == (
        f"{tmp_path} has no gain.c, no vectors.csv: export the code there first (microrad export c)"
    )


def test_what_a_bench_leaves_out_is_named_in_the_order_of_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "".join(
        f"{line}\n" for line in WHOLE.format("1e-4").splitlines() if line.split()[0] not in ("clock_ns", "bound_v")
    )
    monkeypatch.setattr(build, "_compile", lambda folder, name: folder / "made")
    for code, said in (
        (0, "printed no bound_v, no clock_ns:"),
        (1, "failed with exit status 1:"),  # with no bound nothing is beyond it
    ):
        monkeypatch.setattr(build, "run", lambda command, folder, code=code: (code, text))
        with pytest.raises(ExportError) as told:
            build.compile_and_run(written(tmp_path), "gain")
        first, *lines = str(told.value).splitlines()
        assert first == f"the bench of gain in {tmp_path} {said}"
        assert lines == [f"  {line}" for line in text.splitlines()]
