#!/usr/bin/env python3
"""Public functions of microrad on the files of a folder: `library.py WORD` prints what they return, a line each.

The cases of the laboratory run it as a program of their folder, and keep what it prints.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import microrad

ACCEPTABLE = ("jitter", "clipping", "dead", "quantisation", "drift", "unexcited", "lead")


# ---------------------------------------------------------------------------------------------------------- recordings
def findings() -> Iterator[str]:
    """What the checks say of each file named in `recordings.json`: as it is, and with all findings taken on."""
    for name, options in json.loads(Path("recordings.json").read_text(encoding="utf-8")).items():
        for accept in ((), ACCEPTABLE):
            try:
                found = microrad.read_recording(name, accept=accept, **options)
            except microrad.MicroradError as error:
                yield f"{name}, {len(accept)} accepted: {error}"
                continue
            if not accept or any(each.refused for each in found.findings):
                yield f"{name}, {len(accept)} accepted: {found.rate_hz:.7g} Hz, {found.samples} samples"
                for each in found.findings:
                    refused = "refused" if each.refused else "noted"
                    yield f"  {each.kind}, {each.channel}, {each.row}, {each.output}, {refused}: {each.message}"


WORDS = {"findings": findings}


if __name__ == "__main__":
    for line in WORDS[sys.argv[1]]():
        print(line)
