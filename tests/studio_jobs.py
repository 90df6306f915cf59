"""Folders of jobs as the studio leaves them, for tests that start none."""

import json

from microrad.studio.guard import signing


def described(jobs, **told):
    """The description of a job in the folder of jobs `jobs`."""
    plain = {"kind": "study", "title": "t", "arguments": [], "cwd": str(jobs), "results": [], "queued": ""}
    return json.dumps({**plain, "folder": str(jobs), **told})


def written(jobs, number=1, **told):
    """The folder of a job as `Jobs.submit` leaves it."""
    folder = jobs / str(number)
    folder.mkdir(parents=True)
    text = described(jobs, **told)
    (folder / "job.json").write_text(text, "utf-8")
    (folder / "job.code").write_text(signing.code(text.encode()), "utf-8")
    return folder
