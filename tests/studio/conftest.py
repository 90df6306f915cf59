"""What most tests of the studio's pages begin with."""

import pytest

from microrad.studio.session import Session
from shipped import SHIPPED


@pytest.fixture
def session(tmp_path):
    """The paper's mission, saved."""
    (tmp_path / "leo-geo.toml").write_bytes(SHIPPED.read_bytes())
    return Session(tmp_path)
