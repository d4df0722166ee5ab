"""Notifications to systemd while the cycle hangs; while it is heavily used: test_reloads.py."""

import time

from lab import eventually
from plain_devices import Machine
from service_manager import ServiceManager
from stall import Stall


def test_the_watchdog_is_not_fed_while_the_cycle_hangs(lab):
    manager = lab.also_end(ServiceManager(lab.sockets / "notify"))
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
