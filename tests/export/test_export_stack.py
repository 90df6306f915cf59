"""The stack of a step: the deepest chain of calls, and no more than a step takes on a stack that was painted before."""

import platform
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest

import designs
from microrad.export import choice
from microrad.export.flight import build, stack, write
from microrad.export.flight.fixed import fixed_code, quantised
from microrad.export.flight.write import export_flight
from microrad.export.linear_part.sections import sections
from waiting import HANG_S

GRAPH = r"""
node: { title: "step" label: "step\nx.c:1:6\n100 bytes (static)" }
node: { title: "x.c:deep" label: "deep\nx.c:2:6\n40 bytes (static)" }
node: { title: "x.c:deeper" label: "deeper\nx.c:3:6\n30 bytes (static)" }
node: { title: "x.c:wide" label: "wide\nx.c:4:6\n60 bytes (static)" }
node: { title: "x.c:elsewhere" label: "elsewhere\nx.c:5:6\n9000 bytes (static)" }
node: { title: "exp" label: "exp\n<built-in>" shape : ellipse }
node: { title: "pow" label: "pow\n<built-in>" shape : ellipse }
edge: { sourcename: "step" targetname: "x.c:deep" label: "x.c:1:1" }
edge: { sourcename: "step" targetname: "x.c:wide" label: "x.c:1:2" }
edge: { sourcename: "x.c:deep" targetname: "x.c:deeper" label: "x.c:2:1" }
edge: { sourcename: "x.c:deep" targetname: "exp" label: "x.c:2:2" }
edge: { sourcename: "x.c:elsewhere" targetname: "pow" label: "x.c:5:1" }
"""
needs_gcc = pytest.mark.skipif(sys.platform != "linux" or shutil.which("gcc") is None, reason="no gcc on Linux")


@pytest.mark.promise("export-24")
def test_the_deepest_chain_counts_and_what_the_step_does_not_call_is_left_out():
    found = stack.deepest(GRAPH, "step")
    assert found == stack.StackUse(100 + 40 + 30, ("exp",))
    assert found.words == "170 bytes at most, from this machine's compiler, and what the C library takes in exp"


def test_a_frame_that_is_not_fixed_and_a_step_that_is_not_there_have_no_stack():
    assert stack.deepest(GRAPH, "other") is None
    assert stack.deepest(GRAPH.replace("30 bytes (static)", "30 bytes (dynamic)"), "step") is None


@pytest.mark.promise("export-24")
def test_a_compiler_that_does_not_tell_has_none(tmp_path, monkeypatch):
    (tmp_path / "cc").write_text("#!/bin/sh\nexit 1\n")
    (tmp_path / "cc").chmod(0o755)
    monkeypatch.setenv("CC", str(tmp_path / "cc"))
    assert stack.stack_use(tmp_path, ["code.c"], "code_step") is None


PAINTED = """
#define _XOPEN_SOURCE 700
#include "whole_fixed.h"
#include <stdio.h>
#include <ucontext.h>
static unsigned char place[1 << 16];
static whole_fixed_state state;
static int32_t reading[WHOLE_FIXED_READINGS], command[WHOLE_FIXED_ACTUATORS];
static ucontext_t here, there;
static void nothing(void) { }
static void one_step(void) { whole_fixed_step(&state, reading, command); }
static unsigned long taken(void (*of)(void))
{
    unsigned long untouched = 0;
    for (unsigned long i = 0; i < sizeof place; i++) { place[i] = 0xA5; }
    getcontext(&there);
    there.uc_stack.ss_sp = place;
    there.uc_stack.ss_size = sizeof place;
    there.uc_link = &here;
    makecontext(&there, of, 0);
    swapcontext(&here, &there);
    while (untouched < sizeof place && place[untouched] == 0xA5) { untouched++; }
    return sizeof place - untouched;
}
int main(void)
{
    whole_fixed_init(&state);
    one_step();
    for (int i = 0; i < (int)WHOLE_FIXED_READINGS; i++) { reading[i] = 12345678 * (i + 1); }
    printf("%lu %lu\\n", taken(nothing), taken(one_step));
    return 0;
}
"""


@pytest.mark.promise("export-24")
@needs_gcc
def test_a_step_takes_as_much_of_a_painted_stack_as_is_stated(tmp_path, monkeypatch):
    """Fixed point without an inverse calls no library, so that all of its stack is stated."""
    monkeypatch.setenv("CC", "gcc")
    chosen = designs.chosen("resonant damping")
    of = choice.flight_controller(chosen)
    files = fixed_code(of, sections(of), quantised(of, sections(of), choice.vectors(chosen, 300)), "whole")
    for file, text in {**files, "painted.c": PAINTED}.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    found = stack.stack_use(tmp_path, ["whole_fixed.c"], "whole_fixed_step")
    assert set(found.library) <= {"memset"}
    sources = [tmp_path / "painted.c", tmp_path / "whole_fixed.c"]
    subprocess.run(["gcc", "-std=c99", "-O2", "-o", tmp_path / "painted", *sources], check=True, timeout=HANG_S)
    told = subprocess.run([tmp_path / "painted"], check=True, capture_output=True, text=True, timeout=HANG_S).stdout
    nothing, step = map(int, told.split())
    print(f"{found.most_bytes} bytes stated, {step - nothing} touched")
    assert found.most_bytes / 2 < step - nothing <= found.most_bytes + 16  # the caller's own frame, of an alignment


@pytest.mark.promise("export-23")
def test_cycles_are_times_in_steps_of_the_counter_and_left_out_without_one():
    found = build.BenchResult(10, 0.0, 1.0, 1e-12, 0, 0, 0, 0, 200.0, 100.0, 18.0, 2.5)
    assert (
        dict(write._measured(found))["cycles"]
        == "500 at worst, 250 in the median, of this machine's counter at 2.5 GHz"
    )
    assert dict(write._measured(replace(found, cycles_per_ns=0.0)))["cycles"] == ""


@pytest.mark.promise("export-23", "export-24")
@needs_gcc
def test_the_report_states_it(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "gcc")
    done = export_flight(designs.chosen("PI + inverse"), tmp_path / "flight", samples=200)
    assert 100 < done.stack.most_bytes < 10_000
    assert "exp" in done.stack.library
    assert f"  stack         {done.stack.words}\n" in (tmp_path / "flight" / "report.txt").read_text()
    counts = platform.machine() == "x86_64"
    assert (done.bench.cycles_per_ns > 0.1) == counts
    assert ("  cycles        " in (tmp_path / "flight" / "report.txt").read_text()) == counts
    assert not list((tmp_path / "flight").glob("*.ci"))


def test_of_two_ways_to_a_function_the_deeper_one_counts_and_each_library_call_is_told_once():
    more = r"""
node: { title: "y.c:last" label: "last\ny.c:9:1\n500 bytes (static)" }
edge: { sourcename: "x.c:wide" targetname: "y.c:last" label: "x.c:4:9" }
edge: { sourcename: "x.c:deeper" targetname: "y.c:last" label: "x.c:3:9" }
edge: { sourcename: "y.c:last" targetname: "pow" label: "y.c:9:2" }
edge: { sourcename: "y.c:last" targetname: "exp" label: "y.c:9:3" }
edge: { sourcename: "y.c:last" targetname: "log" label: "y.c:9:4" }
"""
    found = stack.deepest(GRAPH + more, "step")
    assert found == stack.StackUse(100 + 40 + 30 + 500, ("exp", "log", "pow"))
    assert found.words.endswith("and what the C library takes in exp, log, pow")
    assert stack.deepest(GRAPH + more, "x.c:wide") == stack.StackUse(560, ("exp", "log", "pow"))
    assert stack.deepest(GRAPH, "x.c:deeper").words == "30 bytes at most, from this machine's compiler"
    bounded = GRAPH.replace("9000 bytes (static)", "9000 bytes (dynamic,bounded)")
    assert stack.deepest(bounded, "step") is None, "not even where the step does not call it"


@pytest.mark.parametrize(("code", "graphs", "most"), [(0, 2, 112), (0, 1, None), (0, 0, None), (1, 2, None)])
def test_the_stack_is_told_where_the_compiler_succeeds_and_has_written_the_graphs(
    tmp_path, monkeypatch, code, graphs, most
):
    """The step is in the second file and what it calls in the first one; beside the sources nothing is written."""
    asked = []
    node = 'node: {{ title: "{}" label: "{}\\nx.c\\n{} bytes (static)" }}\n'
    texts = [
        node.format("other", "other", 900) + node.format("tip_part", "tip_part", 32),
        node.format("tip_step", "tip_step", 80) + 'edge: { sourcename: "tip_step" targetname: "tip_part" }\n',
    ]

    def run(command, folder):
        asked.append(command)
        for number, text in enumerate(texts[:graphs]):
            (folder / f"g{number}.ci").write_text(text, encoding="utf-8")
        return code, ""

    monkeypatch.setattr(stack, "compiler_words", lambda: ("mycc", "-m64"))
    monkeypatch.setattr(stack, "run", run)
    found = stack.stack_use(tmp_path, ["b.c", "a.c"], "tip_step")
    assert (None if found is None else found.most_bytes) == most
    paths = [str((tmp_path / name).resolve()) for name in ("b.c", "a.c")]
    assert asked == [("mycc", "-m64", *stack.FLAGS, "-fcallgraph-info=su", "-c", *paths)]
    assert list(tmp_path.iterdir()) == []
