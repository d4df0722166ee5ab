"""A running thermocomp-sim, and the few bytes of Modbus the tests speak themselves."""

import json
import os
import pathlib
import re
import signal
import socket
import struct
import subprocess
import time

import pytest

BIN = pathlib.Path(os.environ.get("THERMOCOMP_BIN", "build/release/bin"))
PATIENCE_S = 20.0


def eventually(check, what):
    """Polls until check() gives something true; that value."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        value = check()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError("never happened: " + what)


class Simulator:
    def __init__(self, folder, machine, *options):
        self.folder = folder
        self.machine = folder / "machine.toml"
        self.machine.write_text(machine)
        self.process = subprocess.Popen(
            [str(BIN / "thermocomp-sim"), str(self.machine), *map(str, options)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)
        line = self.process.stdout.readline()
        if not line:
            raise AssertionError("no ready line: " + self.process.stderr.read())
        self.ready = json.loads(line)

    def port(self, name):
        return self.ready["ports"][name]

    def connect(self, name):
        link = socket.create_connection(("127.0.0.1", self.port(name)), timeout=PATIENCE_S)
        link.settimeout(PATIENCE_S)
        return link

    def alive(self):
        return self.process.poll() is None

    def end(self):
        """Stops it as an operator would; the rest of what it printed."""
        if self.alive():
            self.process.send_signal(signal.SIGTERM)
        out, err = self.process.communicate(timeout=PATIENCE_S)
        assert self.process.returncode == 0, err
        return out


@pytest.fixture
def simulate(tmp_path):
    running = []

    def start(machine, *options):
        running.append(Simulator(tmp_path, machine, *options))
        return running[-1]

    yield start
    for simulator in running:
        if simulator.alive():
            simulator.process.kill()
        simulator.process.communicate()


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
    """What mbpoll, which is not ours, reads: {address: text}."""
    done = subprocess.run(["mbpoll", "-1", "-q", *map(str, arguments)], capture_output=True,
                          text=True, timeout=PATIENCE_S)
    values = dict(re.findall(r"\[(\d+)\]:\s+(\S+)", done.stdout))
    return {int(key): value for key, value in values.items()}, done.stderr
