"""A running thermocomp-sim, and a minimal Modbus client."""

import pathlib
import re
import struct
import subprocess
import sys

import pytest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))
from lab import BIN, PATIENCE_S, Simulator, eventually  # noqa: E402, F401


@pytest.fixture
def simulate(tmp_path):
    running = []

    def start(machine, *options):
        running.append(Simulator(tmp_path, machine, *options))
        return running[-1]

    yield start
    for simulator in running:
        simulator.kill()


def request(unit, pdu, transaction=1):
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def read_request(function, address, count):
    return struct.pack(">BHH", function, address, count)


def receive(link, count):
    data = b""
    while len(data) < count:
        piece = link.recv(count - len(data))
        if not piece:
            raise EOFError
        data += piece
    return data


def answer(link):
    """(transaction, unit, PDU) of the next answer."""
    transaction, _, length, unit = struct.unpack(">HHHB", receive(link, 7))
    return transaction, unit, receive(link, length - 1)


def ask(link, unit, pdu, transaction=1):
    link.sendall(request(unit, pdu, transaction))
    got, _, body = answer(link)
    assert got == transaction
    return body


def mbpoll(*arguments):
    """Values read by mbpoll: {address: text}."""
    done = subprocess.run(["mbpoll", "-1", "-q", *map(str, arguments)], capture_output=True,
                          text=True, timeout=PATIENCE_S)
    values = dict(re.findall(r"\[(\d+)\]:\s+(\S+)", done.stdout))
    return {int(key): value for key, value in values.items()}, done.stderr
