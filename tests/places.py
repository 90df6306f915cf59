"""Where things stand: the project, and the recordings beside it, which may be absent."""

import os
from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent
DATA = Path(os.environ.get("MICRORAD_DATA") or ROOT.parent / "shared" / "data")
