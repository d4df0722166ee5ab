"""A running thermocomp-sim, and a minimal Modbus client."""

import pathlib
import re
import subprocess
import sys

import pytest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))
from lab import BIN, PATIENCE_S, Simulator, eventually  # noqa: E402, F401
from modbus_server import answer, ask, read_request, receive, request  # noqa: E402, F401


@pytest.fixture
def simulate(tmp_path):
    running = []

    def start(machine, *options):
        running.append(Simulator(tmp_path, machine, *options))
        return running[-1]

    yield start
    for simulator in running:
        simulator.kill()


def mbpoll(*arguments):
    """Values read by mbpoll: {address: text}."""
    done = subprocess.run(["mbpoll", "-1", "-q", *map(str, arguments)], capture_output=True,
                          text=True, timeout=PATIENCE_S)
    values = dict(re.findall(r"\[(\d+)\]:\s+(\S+)", done.stdout))
    return {int(key): value for key, value in values.items()}, done.stderr
