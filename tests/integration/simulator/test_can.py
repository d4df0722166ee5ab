"""The CAN node and the CAN controller, tested with python3-can. Needs vcan0."""

import pathlib
import struct
import time

import pytest

from conftest import PATIENCE_S, eventually
from test_devices import BODY, event

pytestmark = pytest.mark.skipif(not pathlib.Path("/sys/class/net/vcan0").exists(),
                                reason="there is no vcan0 (tests/vm/run_with_can.sh makes one)")

MACHINE = BODY + """
[[bus]]
name = "body"
kind = "can"
interface = "vcan0"
[[device]]
name = "node"
bus = "body"
period_s = 0.05
[[channel]]
name = "a"
device = "node"
column = "room_degC"
id = 0x181
start_bit = 0
scale = 0.01
open_circuit_codes = [-32768]
[[channel]]
name = "b"
device = "node"
column = "room_degC"
id = 0x181
start_bit = 23
byte_order = "big_endian"
scale = 0.01
[controller]
name = "cnc"
kind = "can"
interface = "vcan0"
heartbeat_timeout_s = 0
valid_bits = { id = 0x200, start_bit = 32, length_bits = 8 }
heartbeat = { id = 0x200, start_bit = 40, length_bits = 8 }
[[controller.signal]]
name = "spindle_rpm"
id = 0x300
start_bit = 32
signed = false
[[axis]]
name = "z"
output = "z_um"
offset = { id = 0x200, start_bit = 0, length_bits = 32, scale = 0.01 }
applied = { id = 0x300, start_bit = 0, length_bits = 32, scale = 0.01 }
"""


def newest(bus, identifier):
    """The next frame with this identifier sent from now on."""
    while bus.recv(0) is not None:
        pass
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        message = bus.recv(1.0)
        if message is not None and message.arbitration_id == identifier:
            return bytes(message.data)
    raise AssertionError(f"no frame 0x{identifier:x}")


@pytest.fixture
def bus():
    can = pytest.importorskip("can")
    with can.Bus(interface="socketcan", channel="vcan0") as opened:
        yield opened


def test_frames_show_the_temperatures_in_both_byte_orders(simulate, bus):
    simulator = simulate(MACHINE)
    assert simulator.ready["unavailable"] == {}
    assert newest(bus, 0x181) == struct.pack("<h", 2125) + struct.pack(">h", 2125)


def test_an_open_circuit_shows_its_code(simulate, bus):
    simulate(MACHINE + event("open_circuit", "a"))
    assert newest(bus, 0x181) == struct.pack("<h", -32768) + struct.pack(">h", 2125)


def test_a_dropped_node_sends_nothing_while_the_controller_continues(simulate, bus):
    simulate(MACHINE + event("drop", "node"))
    for _ in range(5):
        newest(bus, 0x300)
    seen = set()
    while (message := bus.recv(0.3)) is not None and len(seen) < 1:
        seen.add(message.arbitration_id)
    assert seen == {0x300}


def test_an_offset_frame_is_applied_and_shown(simulate, bus):
    import can
    simulate(MACHINE)
    assert newest(bus, 0x300) == struct.pack("<iH", 0, 6000)
    bus.send(can.Message(arbitration_id=0x200, is_extended_id=False,
                         data=struct.pack("<iBB", -1234, 1, 1)))
    eventually(lambda: newest(bus, 0x300) == struct.pack("<iH", -1234, 6000), "the offset")
    bus.send(can.Message(arbitration_id=0x200, is_extended_id=False,
                         data=struct.pack("<iBB", 9999, 0, 2)))  # not valid
    time.sleep(0.3)
    assert newest(bus, 0x300) == struct.pack("<iH", -1234, 6000)
