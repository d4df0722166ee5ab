"""The adapter port, read by the grammar that MTConnect publishes for adapters, not by ours."""

import re
import socket
import subprocess
import time
import xml.etree.ElementTree

import pytest

from gateway_lab import Gateway
from lab import BIN, PATIENCE_S, eventually

# From the published description of the protocol: a time stamp, then either pairs of key and value
# or one condition with level, native code, native severity, qualifier and text; commands begin with
# `*`.
TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?Z"
KEY = r"[A-Za-z_][A-Za-z0-9_.:-]*"
LEVEL = r"(?i:NORMAL|WARNING|FAULT|UNAVAILABLE)"
CONDITION = re.compile(
    rf"({TIME})\|({KEY})\|({LEVEL})\|([^|]*)\|([^|]*)\|((?i:HIGH|LOW)?)\|([^|]*)")
VALUES = re.compile(rf"({TIME})((?:\|{KEY}\|[^|]*)+)")
COMMAND = re.compile(r"\* PONG \d+")
NUMBER = re.compile(r"-?\d+(\.\d+)?|UNAVAILABLE")


class Agent:
    """What an agent keeps of an adapter's lines."""

    def __init__(self, port):
        self.link = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.rest = b""
        self.values = {}
        self.conditions = {}
        self.pongs = []

    def close(self):
        self.link.close()

    def read(self):
        block = self.link.recv(65536)
        assert block, "the adapter closed"
        *lines, self.rest = (self.rest + block).split(b"\n")
        for line in lines:
            self.take(line.decode())

    def take(self, line):
        if condition := CONDITION.fullmatch(line):
            _, key, level, code, _, _, text = condition.groups()
            active = self.conditions.setdefault(key, {})
            if level in ("NORMAL", "UNAVAILABLE") and not code:
                active.clear()
            if level not in ("NORMAL", "UNAVAILABLE"):
                active[code] = (level, text)
        elif values := VALUES.fullmatch(line):
            fields = values.group(2).split("|")[1:]
            self.values.update(zip(fields[::2], fields[1::2]))
        else:
            assert COMMAND.fullmatch(line), "no line of the protocol: " + line
            self.pongs.append(line)

    def wait_for(self, check, what):
        end = time.monotonic() + PATIENCE_S
        while not check():
            assert time.monotonic() < end, what
            self.read()


@pytest.fixture
def gateway(lab, machine):
    return lab.also_end(Gateway(lab, machine.daemon, "", "[shdr]\nport = 0")).start()


@pytest.fixture
def agent(lab, gateway):
    return lab.also_end(Agent(gateway.ready["shdr"]))


def test_values_and_conditions_follow_the_machine(machine, agent):
    agent.wait_for(lambda: agent.values.get("avail") == "AVAILABLE", "available")
    machine.warm_by(9.0)
    agent.wait_for(lambda: abs(float(agent.values["offset_z"]) - 0.009) < 1e-4, "offset in mm")
    agent.wait_for(lambda: abs(float(agent.values["displacement_z"]) + 0.009) < 1e-4, "its cause")
    agent.wait_for(lambda: abs(float(agent.values["temp_column"]) - 17.0) < 0.05, "a temperature")
    assert agent.values["mode"] == "compensating"
    assert not any(agent.conditions.values()), agent.conditions
    machine.module.stop()
    agent.wait_for(lambda: "block_lost" in agent.conditions["system"], "the reason")
    level, text = agent.conditions["system"]["block_lost"]
    assert level == "FAULT" and "no good sensor" in text
    agent.wait_for(lambda: agent.conditions["bus_cabinet"] and agent.conditions["sensor_column"],
                   "bus and sensor")
    assert agent.values["temp_column"] == "UNAVAILABLE"
    machine.module.start()
    machine.warm_by(9.0)
    agent.wait_for(lambda: not any(agent.conditions.values()), "all is normal again")
    machine.daemon.call("disable")
    agent.wait_for(lambda: "operator_disabled" in agent.conditions["system"], "switched off")
    assert agent.conditions["system"]["operator_disabled"][0] == "WARNING"
    machine.daemon.kill()
    agent.wait_for(lambda: agent.values["avail"] == "UNAVAILABLE", "the daemon is away")
    for key, value in agent.values.items():
        if key.startswith(("temp_", "offset_", "displacement_")):
            assert NUMBER.fullmatch(value), (key, value)


def test_ping_is_answered_and_what_is_no_line_ends_the_connection(gateway, agent):
    agent.link.sendall(b"* PING\r\n* PING\nnonsense\n")
    agent.wait_for(lambda: len(agent.pongs) == 2, "two answers")
    assert agent.pongs[0] == "* PONG 10000"
    with socket.create_connection(("127.0.0.1", gateway.ready["shdr"]), PATIENCE_S) as rogue:
        rogue.sendall(b"x" * 100000)
        with_end = b"y"
        try:
            while with_end:
                with_end = rogue.recv(65536)
        except ConnectionResetError:
            pass
    agent.link.sendall(b"* PING\n")
    agent.wait_for(lambda: len(agent.pongs) == 3, "others are served")


def test_the_device_file_names_every_item(machine, gateway, agent):
    agent.wait_for(lambda: "offset_z" in agent.values and "system" in agent.conditions, "items")
    done = subprocess.run([str(BIN / "thermocomp-gateway"), "--device-file", str(gateway.config)],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    items = {item.get("name"): item for item in
             xml.etree.ElementTree.fromstring(done.stdout).iter() if item.tag.endswith("DataItem")}
    eventually(lambda: set(agent.values) | set(agent.conditions) == set(items), "the same items")
    for key in agent.conditions:
        assert items[key].get("category") == "CONDITION"
    assert items["offset_z"].get("units") == "MILLIMETER"
