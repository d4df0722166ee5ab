"""The status socket under attack: other clients are answered, the watchdog is fed, the axis moves,
and nothing remains afterwards."""

import contextlib
import os
import pathlib
import threading
import time

import pytest

from lab import connect, eventually
from plain_devices import Machine
from service_manager import ServiceManager

STATUS = b'{"jsonrpc":"2.0","id":1,"method":"status"}\n'
ATTACK_S = 4.0


def send_all_it_takes(link, data):
    link.setblocking(False)
    with contextlib.suppress(OSError):
        while link.send(data):
            pass


def pipeline_without_reading(path, until):
    links = [connect(path) for _ in range(100)]
    while time.monotonic() < until:
        for link in links:
            send_all_it_takes(link, 200 * STATUS)
        time.sleep(0.05)


def connection_storm(path, until):
    while time.monotonic() < until:
        for _ in range(20):
            with contextlib.suppress(OSError):
                connect(path).close()
        time.sleep(0.01)


def half_requests(path, until):
    links = [connect(path) for _ in range(300)]
    while time.monotonic() < until:
        for link in links:
            with contextlib.suppress(OSError):
                link.send(b"{")
        time.sleep(0.2)


def silent_subscribers(path, until):
    links = [connect(path) for _ in range(200)]
    for link in links:
        link.send(b'{"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"period_s":0.1,'
                  b'"methods":["status","sensors","offsets","timing","model"]}}\n')
    time.sleep(max(0.0, until - time.monotonic()))


def operator_gone_mad(path, until):
    """Hundreds of commands, each of which waits for the cycle and for the disk."""
    links = [connect(path) for _ in range(10)]
    while time.monotonic() < until:
        for link in links:
            send_all_it_takes(link, 20 * b'{"jsonrpc":"2.0","id":1,"method":"enable"}\n')
        time.sleep(0.1)


def nonsense(path, until):
    lines = [b"\xff\xfe\n", b"[" * 60000 + b"\n", b"\n" * 5000, b"[" + STATUS[:-1] + b"]\n",
             b'{"jsonrpc":"2.0","id":1,"method":"status","params":{"a":' + b"[" * 30000 +
             b"]" * 30000 + b"}}\n", b"x" * 70000]
    while time.monotonic() < until:
        for line in lines:
            with contextlib.suppress(OSError), contextlib.closing(connect(path)) as link:
                link.sendall(line)
                link.recv(100)


@pytest.mark.parametrize("attack", [pipeline_without_reading, connection_storm, half_requests,
                                    silent_subscribers, operator_gone_mad, nonsense])
def test_an_attack_does_not_delay_other_clients(lab, attack):
    manager = lab.also_end(ServiceManager(lab.sockets / "notify"))
    machine = Machine(lab)
    machine.daemon.environment = {**manager.environment, "WATCHDOG_USEC": "600000"}
    daemon = machine.start()
    cycles = daemon.status()["cycle"]["count"]
    begun = time.monotonic()
    until = time.monotonic() + ATTACK_S
    attacker = threading.Thread(target=attack, args=(daemon.socket, until))
    attacker.start()
    time.sleep(0.3)
    machine.warm_by(6.0)
    answers = []
    while time.monotonic() < until - 0.2:
        asked = time.monotonic()
        status, _, output = daemon.cli("status")
        answers.append(time.monotonic() - asked)
        assert status in (0, 1), output
        time.sleep(0.1)
    times_fed = sum(at > begun for at in manager.times_of("WATCHDOG=1"))
    attacker.join()
    print(f"{attack.__name__}: {len(answers)} answers, worst {max(answers):.3f} s; watchdog fed "
          f"{times_fed} times; {daemon.status()['socket']}")
    assert len(answers) >= 2
    assert times_fed >= 2
    assert daemon.status()["cycle"]["count"] > cycles
    daemon.wait_for_offset(6.0, 0.05)
    eventually(lambda: daemon.status()["socket"]["clients"] <= 2, "the attackers' places are free")
    assert daemon.status()["socket"]["buffered_bytes"] < 100_000
    files = len(os.listdir(pathlib.Path("/proc") / str(daemon.process.pid) / "fd"))
    assert files < 40
    daemon.end()
