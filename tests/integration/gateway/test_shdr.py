"""The adapter port, checked against MTConnect's published protocol by shdr_agent.py (Debian has no package of
an MTConnect agent)."""

import contextlib
import socket
import subprocess

import pytest

from gateway_lab import Gateway
from lab import BIN, PATIENCE_S, eventually
from shdr_agent import NUMBER, Agent, Refused, items_of


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
            assert value == "UNAVAILABLE" or NUMBER.fullmatch(value), (key, value)


def test_ping_is_answered_and_other_bytes_end_the_connection(gateway, agent):
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


def device_file(gateway):
    done = subprocess.run([str(BIN / "thermocomp-gateway"), "--device-file", str(gateway.config)],
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_device_file_names_every_item(machine, gateway, agent):
    agent.wait_for(lambda: "offset_z" in agent.values and "system" in agent.conditions, "items")
    items = items_of(device_file(gateway))
    eventually(lambda: set(agent.values) | set(agent.conditions) == set(items), "the same items")
    for key in agent.conditions:
        assert items[key]["category"] == "CONDITION"
    assert items["offset_z"]["units"] == "MILLIMETER"


def test_a_reader_of_the_device_file_accepts_every_line(machine, gateway, lab):
    """Warming, a bus disconnected, switching off and on, and a killed daemon."""
    reported = device_file(gateway)
    agent = lab.also_end(Agent(gateway.ready["shdr"], reported))
    agent.wait_for(lambda: agent.values.get("mode") == "compensating", "it compensates")
    for offset_um in (9.0, -6.0, 12.0):
        machine.warm_by(offset_um)
        agent.wait_for(lambda o=offset_um: abs(float(agent.values["offset_z"]) - 1e-3 * o) < 1e-4,
                       "the offset follows")
    machine.module.stop()
    agent.wait_for(lambda: agent.conditions["bus_cabinet"] and "block_lost" in agent.conditions["system"],
                   "bus and reason")
    machine.module.start()
    machine.warm_by(3.0)
    agent.wait_for(lambda: not any(agent.conditions.values()), "all is normal again")
    machine.daemon.call("disable")
    agent.wait_for(lambda: agent.values["mode"] == "disabled", "switched off")
    agent.link.sendall(b"* PING\n")
    agent.wait_for(lambda: agent.pongs, "a PONG")
    machine.daemon.call("enable")
    agent.wait_for(lambda: agent.values["mode"] == "compensating", "switched on")
    machine.daemon.kill()
    agent.wait_for(lambda: agent.values["avail"] == "UNAVAILABLE", "the daemon is away")
    machine.daemon.start()
    agent.wait_for(lambda: agent.values["avail"] == "AVAILABLE", "the daemon is back")
    agent.wait_for(lambda: agent.values["mode"] == "compensating", "it compensates again")
    assert set(agent.values) | set(agent.conditions) == set(agent.items)
    print(f"{agent.lines} lines, {len(agent.refused)} refused; {len(agent.items)} data items, each reported")
    assert agent.lines > 20 and agent.refused == []


@pytest.mark.parametrize("line, why", (
    ("2026-03-01T08:00:00|avail|AVAILABLE", "no time"),
    ("2026-03-01T08:00:00Z|offset_z|wide", "no number"),
    ("2026-03-01T08:00:00Z|offset_q|0.1", "not in the device file"),
    ("2026-03-01T08:00:00Z|offset_z|0.1|avail", "no pairs"),
    ("2026-03-01T08:00:00Z|avail|perhaps", "is never"),
    ("2026-03-01T08:00:00Z|system|FAULT||||broken", "nothing tells it"),
    ("2026-03-01T08:00:00Z|system|FAULT|a||AROUND|broken", "qualifier"),
    ("2026-03-01T08:00:00Z|system|BAD|a|||broken", "no item with a value"),
    ("* PONK", "no command")))
def test_the_reader_refuses_invalid_lines(machine, gateway, lab, line, why):
    agent = lab.also_end(Agent(gateway.ready["shdr"], device_file(gateway)))
    with pytest.raises(Refused, match=why):
        agent.take(line)


def test_agents_that_are_silent_give_their_places_to_new_ones(lab, machine):
    gateway = lab.also_end(Gateway(lab, machine.daemon, "",
                                   "[shdr]\nport = 0\nheartbeat_s = 1\nagents_max = 3")).start()
    with contextlib.ExitStack() as stack:
        for _ in range(3):
            stack.enter_context(socket.create_connection(("127.0.0.1", gateway.ready["shdr"])))

        def is_served():
            with socket.create_connection(("127.0.0.1", gateway.ready["shdr"]), 5) as link:
                with contextlib.suppress(OSError):
                    link.sendall(b"* PING\n")
                    return link.recv(100)

        assert not is_served()
        eventually(is_served, "a place is free")
