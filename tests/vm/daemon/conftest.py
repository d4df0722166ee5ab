import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "integration" / "daemon"))

import pytest  # noqa: E402

from lab import Lab  # noqa: E402


@pytest.fixture
def lab(tmp_path):
    opened = Lab(tmp_path)
    try:
        yield opened
    finally:
        opened.end()
