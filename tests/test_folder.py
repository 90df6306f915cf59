"""What a file holds, read without a wait for one that never ends."""

import os

import pytest

from microrad.folder import read_bytes


def test_as_many_bytes_as_are_asked_for(tmp_path):
    path = tmp_path / "whole"
    path.write_bytes(b"0123456789")
    assert [read_bytes(path, most) for most in (0, 3, 10, 11)] == [b"", b"012", b"0123456789", b"0123456789"]


@pytest.mark.skipif(os.name != "posix", reason="POSIX has pipes by name")
def test_a_file_whose_content_never_comes_is_refused_at_once(tmp_path):
    """As /proc/kmsg, a regular file by its mode."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with (
        os.fdopen(os.open(path, os.O_RDWR), "wb", buffering=0),
        pytest.raises(BlockingIOError, match="no file on disk"),
    ):
        read_bytes(path, 10)
