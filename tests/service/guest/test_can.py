"""The installed service on a CAN interface, in a guest whose kernel has CAN; also this kernel's
serial ports and device rules."""

import os
import pathlib
import signal
import socket
import struct
import threading
import time

import pytest

import service
from lab import eventually
from service import STATE, run, show
from test_3_sandbox import probe

FRAME = "<IB3x8s"
SENSORS_ID, OFFSET_ID, APPLIED_ID = 0x181, 0x200, 0x300
OVER_CAN = """[[bus]]
name = "body"
kind = "can"
interface = "vcan0"
reconnect_s = 0.5
[[device]]
name = "node"
bus = "body"
id = 0x181
length_bits = 16
scale = 0.01
[[sensor]]
name = "column"
device = "node"
start_bit = 0
[[sensor]]
name = "spindle"
device = "node"
start_bit = 16
[controller]
name = "cnc"
kind = "can"
interface = "vcan0"
period_s = 0.02
valid_bits = { id = 0x200, start_bit = 32, length_bits = 8 }
heartbeat = { id = 0x200, start_bit = 40, length_bits = 8 }
[[axis]]
name = "z"
output = "z_um"
offset = { id = 0x200, start_bit = 0, length_bits = 32, scale = 0.001 }
applied = { id = 0x300, start_bit = 0, length_bits = 32, scale = 0.001 }
"""


class Node:
    """Thermocouples and a controller on vcan0; records every received offset."""

    def __init__(self):
        self.applied_nm = 0
        self.column_degC = 20.0
        self.log = []
        self.ending = False
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind(("vcan0",))
        self.socket.settimeout(0.01)
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def send(self, identifier, data):
        self.socket.send(struct.pack(FRAME, identifier, len(data), data.ljust(8, b"\0")))

    def run(self):
        next_s = 0.0
        while not self.ending:
            try:
                identifier, _, data = struct.unpack(FRAME, self.socket.recv(16))
                if identifier == OFFSET_ID and data[4] & 1:
                    self.applied_nm, = struct.unpack("<i", data[:4])
                    self.log.append((time.monotonic(), 0.001 * self.applied_nm))
            except TimeoutError:
                pass
            except OSError:
                time.sleep(0.05)  # the interface is down
            if time.monotonic() < next_s:
                continue
            next_s = time.monotonic() + 0.05
            try:
                self.send(SENSORS_ID, struct.pack("<hh", round(100 * self.column_degC), 2000))
                self.send(APPLIED_ID, struct.pack("<i", self.applied_nm))
            except OSError:
                pass

    def settled_at(self, offset_um):
        self.column_degC = 20.0 - offset_um / 3.0
        service.wait_for_offset(offset_um)
        eventually(lambda: abs(0.001 * self.applied_nm - offset_um) < 0.01, "applied")

    def close(self):
        self.ending = True
        self.thread.join(20)


@pytest.fixture(scope="module")
def node():
    made = Node()
    yield made
    made.close()


@pytest.fixture
def compensating(node):
    if not service.active():
        service.start()
    service.wait_for_mode("compensating")
    node.settled_at(9.0)
    return node


def test_the_installed_service_compensates_over_can(node):
    run("dpkg", "-i", service.package("thermocomp"))
    service.write_config(service.COMMON + OVER_CAN + service.LIMITS + service.ENABLED)
    service.drop_in("planted", "[Service]\nEnvironment=LD_PRELOAD=/opt/service-test/planted_hang.so\n")
    service.start()
    node.settled_at(9.0)
    pid = service.main_pid()
    assert service.thread_facts(pid)["cycle"] == (1, 60)
    assert int(service.process_fact(pid, "VmLck").split()[0]) > 0
    service.assert_slewed(node.log)


def test_exposure_and_sandbox_on_this_kernel(compensating):
    pathlib.Path("/dev/ttyS0").chmod(0o660)
    run("chgrp", "dialout", "/dev/ttyS0")
    foreign = pathlib.Path("/dev/service-test")
    if not foreign.exists():
        os.mknod(foreign, 0o666 | 0o020000, os.makedev(1, 11))  # the kernel's log, under a new name
    foreign.chmod(0o666)
    could = probe()
    print(could)
    print(pathlib.Path("/proc/devices").read_text().split("\n\n")[0])
    figure, table = service.exposure()
    print(table.splitlines()[-1])
    assert figure <= 2.5
    for needed in ("can socket", "serial port", "fifo", "lock memory"):
        assert could[needed] == "", f"{needed}: {could[needed]}"
    for refused in ("foreign device", "packet socket", "kernel log"):
        assert could[refused] != "", refused


def wait_for_restart(count):
    eventually(lambda: service.restarts() > count and service.active(), "started again", 90.0)
    service.wait_for_mode("compensating")


@pytest.mark.parametrize("what", ["plant-cycle-blocks", "stopped process"])
def test_the_watchdog_bites_and_the_offset_stays(compensating, what):
    restarts, seen = service.restarts(), len(compensating.log)
    if what == "stopped process":
        os.kill(service.main_pid(), signal.SIGSTOP)
    else:
        (STATE / what).touch()
    wait_for_restart(restarts)
    eventually(lambda: len(compensating.log) > seen, "frames")
    assert all(abs(offset - 9.0) < 0.01 for _, offset in compensating.log[seen:])


def test_the_interface_goes_and_comes_under_the_sandbox(compensating):
    seen = len(compensating.log)
    run("ip", "link", "set", "vcan0", "down")
    service.wait_for_mode("holding")
    run("ip", "link", "set", "vcan0", "up")
    began = time.monotonic()
    service.wait_for_mode("compensating")
    print(f"compensating {time.monotonic() - began:.2f} s after the interface came up")
    compensating.settled_at(9.0)
    service.assert_slewed(compensating.log[seen:])


def test_it_is_removed_with_all_that_it_left(compensating):
    run("dpkg", "-P", "thermocomp")
    assert show("ActiveState") in ("inactive", "failed")
    assert not STATE.exists()
