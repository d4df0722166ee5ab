import os
import pathlib
import sys

import pytest

# Shares daemon, devices and folder with the daemon's tests.
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))

from gateway_lab import Gateway  # noqa: E402
from lab import Lab  # noqa: E402
from plain_devices import Machine  # noqa: E402


@pytest.fixture
def lab(tmp_path):
    opened = Lab(tmp_path)
    try:
        yield opened
    finally:
        opened.end()


@pytest.fixture
def machine(lab):
    """A compensating daemon with its devices."""
    running = Machine(lab)
    running.start()
    return running


@pytest.fixture
def gateway(lab, machine):
    return lab.also_end(Gateway(lab, machine.daemon)).start()


os.environ.setdefault("no_proxy", "127.0.0.1,localhost")
