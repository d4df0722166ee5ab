"""Notifications to systemd while the daemon is heavily used."""

import threading
import time

import pytest

from lab import eventually
from plain_devices import Machine
from service_manager import WATCHDOG_S, ServiceManager, largest_gap_s
from stall import Stall


@pytest.fixture
def manager(lab):
    return lab.also_end(ServiceManager(lab.sockets / "notify"))


def test_many_reloads_at_1_hz_starve_neither_watchdog_nor_clients(lab, manager):
    machine = Machine(lab)
    machine.daemon.environment = manager.environment
    machine.daemon.write_config(machine.config.replace("rate_hz = 100", "rate_hz = 1"))
    daemon = machine.start()
    begin = time.monotonic()
    took_s = []

    def ask():
        while time.monotonic() < begin + 12.0:
            begun = time.monotonic()
            daemon.status()
            took_s.append(time.monotonic() - begun)
            time.sleep(0.05)

    clients = [threading.Thread(target=ask) for _ in range(8)]
    for client in clients:
        client.start()
    while time.monotonic() < begin + 12.0:
        daemon.hang_up()
        time.sleep(0.4)
    for client in clients:
        client.join()
    end = time.monotonic()
    gap_s = largest_gap_s(manager.times_of("WATCHDOG=1"), begin, end)
    reloads = daemon.log_text().count("reloaded: ")
    print(f"watchdog fed at least every {gap_s:.2f} s, {reloads} reloads, slowest of "
          f"{len(took_s)} answers {1000 * max(took_s):.1f} ms")
    assert gap_s < 0.75 * WATCHDOG_S
    assert max(took_s) < 1.5
    assert 5 <= reloads <= 16
    eventually(lambda: len(manager.times_of("READY=1")) == 1 + len(manager.times_of("RELOADING=1")),
               "each reload ends for systemd")
    # Commands are answered at 1 Hz too.
    assert daemon.cli("disable")[0] == 0
    daemon.end()


def test_the_watchdog_is_not_fed_while_the_cycle_hangs(lab, manager):
    stall = Stall(lab.folder / "stall")
    machine = Machine(lab)
    machine.daemon.environment = {**manager.environment, **stall.environment}
    daemon = machine.start()
    with stall:
        time.sleep(0.5)
        begin = time.monotonic()
        while time.monotonic() < begin + 5.0:
            daemon.hang_up()
            daemon.status()
            time.sleep(0.2)
        assert [at for at in manager.times_of("WATCHDOG=1") if at > begin] == []
    eventually(lambda: [at for at in manager.times_of("WATCHDOG=1") if at > begin], "it is again")
