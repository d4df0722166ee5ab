import os
import pathlib
import sys

import pytest

# Daemon, devices and their folder are those of the daemon's own tests.
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
    """A daemon that compensates between its devices."""
    running = Machine(lab)
    running.start()
    return running


@pytest.fixture
def gateway(lab, machine):
    return lab.also_end(Gateway(lab, machine.daemon)).start()


os.environ.setdefault("no_proxy", "127.0.0.1,localhost")
