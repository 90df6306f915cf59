"""Halts a campaign's command behind its first chunk, once, where ``MICRORAD_TEST_HALT`` names a file that is there.

A test that looks at a campaign in mid run can so never come too late. Python loads this file by its name, in each
process that is started with this folder in PYTHONPATH.
"""

import os
import signal
import sys
from pathlib import Path

_FLAG = Path(os.environ.get("MICRORAD_TEST_HALT", os.devnull))

if "campaign" in sys.orig_argv and "MICRORAD_TEST_HALT" in os.environ:
    os.cpu_count = lambda: 1  # one worker: each takes a second to start

if "campaign" in sys.orig_argv and _FLAG.is_file():
    from microrad.campaign.run import _Runner

    _keep = _Runner._keep

    def _keep_and_halt(run, job, payload):
        _keep(run, job, payload)
        if _FLAG.is_file():
            _FLAG.unlink()
            os.kill(os.getpid(), signal.SIGSTOP)

    _Runner._keep = _keep_and_halt
