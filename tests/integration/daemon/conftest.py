import pytest

from lab import Lab
from plain_devices import Machine


@pytest.fixture
def lab(tmp_path):
    opened = Lab(tmp_path)
    try:
        yield opened
    finally:
        opened.end()


@pytest.fixture
def machine(lab):
    """With a daemon that is not yet started."""
    return Machine(lab)
