import pytest

from lab import Lab


@pytest.fixture
def lab(tmp_path):
    opened = Lab(tmp_path)
    try:
        yield opened
    finally:
        opened.end()
