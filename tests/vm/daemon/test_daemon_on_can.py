"""thermocompd between two CAN buses: thermocouples on vcan0, a controller on vcan1 (both made by
tests/vm/run_with_can.sh)."""

import pathlib
import re
import struct
import subprocess
import threading

import pytest

import spindle
from lab import assert_replays_exactly, eventually
from plain_devices import BLOCKS

pytestmark = pytest.mark.skipif(not pathlib.Path("/sys/class/net/vcan1").exists(),
                                reason="there is no vcan1 (tests/vm/run_with_can.sh makes one)")

MODEL = """
format = 1
inputs = ["column_degC", "spindle_degC"]
outputs = ["z_um"]
reference = [20.0, 20.0]
matrix_um_per_K = [[3.0, -1.5]]
"""
CONFIG = """
format = 1
@STATE@
[loop]
rate_hz = 100
[model]
file = "model.toml"
[[bus]]
name = "body"
kind = "can"
interface = "vcan0"
[[device]]
name = "node"
bus = "body"
id = 0x181
length_bits = 16
scale = 0.01
open_circuit_codes = [0x7FFF]
[[sensor]]
name = "column"
device = "node"
start_bit = 0
[[sensor]]
name = "spindle"
device = "node"
start_bit = 23
byte_order = "big_endian"
""" + BLOCKS.format(stale_after_s=60.0) + """[controller]
name = "cnc"
kind = "can"
interface = "vcan1"
period_s = 0.05
valid_bits = { id = 0x200, start_bit = 32, length_bits = 8 }
heartbeat = { id = 0x200, start_bit = 40, length_bits = 8 }
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 100.0
rate_um_per_s_max = 200.0
offset = { id = 0x200, start_bit = 0, length_bits = 32, scale = 0.01 }
applied = { id = 0x300, start_bit = 7, length_bits = 32, byte_order = "big_endian", scale = 0.01 }
[compensation]
enabled_at_first_start = true
[history]
@HISTORY@
offsets_period_s = 0.01
commit_s = 0.2
"""


def send_temperatures(column_degC, spindle_degC):
    data = (struct.pack("<h", round(100 * column_degC)) +
            struct.pack(">h", round(100 * spindle_degC)))
    subprocess.run(["cansend", "vcan0", "181#" + data.hex().upper()], check=True, timeout=20)


class Controller:
    """Applies the offset frame and reports it, with python3-can on vcan1."""

    def __init__(self):
        self.applied = 0
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        import can
        with can.Bus(interface="socketcan", channel="vcan1") as bus:
            while not self.ending.is_set():
                message = bus.recv(0.05)
                if message is not None and message.arbitration_id == 0x200:
                    offset, valid = struct.unpack("<iB", bytes(message.data)[:5])
                    if valid & 1:
                        self.applied = offset
                bus.send(can.Message(arbitration_id=0x300, is_extended_id=False,
                                     data=struct.pack(">i", self.applied)))

    def close(self):
        self.ending.set()
        self.thread.join(20)


class Candump:
    def __init__(self, path):
        self.path = path
        with path.open("w") as out:
            self.process = subprocess.Popen(["candump", "-L", "vcan1"], stdout=out,
                                            stdin=subprocess.DEVNULL)

    def newest_offset(self):
        """(hundredths of um, valid bits, heartbeat) of the last offset frame, or None."""
        frames = re.findall(r" vcan1 200#([0-9A-F]{12})\n", self.path.read_text())
        return struct.unpack("<iBB", bytes.fromhex(frames[-1])) if frames else None


def test_thermocouple_frames_become_offset_frames(lab):
    pytest.importorskip("can")
    (lab.folder / "model.toml").write_text(MODEL)
    candump = lab.also_end(Candump(lab.folder / "candump.log"))
    daemon = lab.daemon(CONFIG).start()
    send_temperatures(20.0, 20.0)
    assert daemon.status()["mode"] == "starting"  # there is no controller yet
    lab.also_end(Controller())
    daemon.wait_for_mode("compensating")
    heartbeats = set()
    for column, spindle_degC in ((20.0, 20.0), (23.5, 20.0), (23.5, 29.25), (11.0, -3.5)):
        send_temperatures(column, spindle_degC)
        wanted = round(-100 * (3.0 * (column - 20.0) - 1.5 * (spindle_degC - 20.0)))

        def shown():
            newest = candump.newest_offset()
            if newest is None or newest[0] != wanted or newest[1] != 1:
                return False
            heartbeats.add(newest[2])
            return True

        eventually(shown, f"offset frame {wanted}")
    eventually(lambda: heartbeats.add(candump.newest_offset()[2]) or len(heartbeats) > 4,
               "the heartbeat beats")
    eventually(lambda: daemon.axis()["applied"] == daemon.axis()["offset"], "read back")
    daemon.committed()
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


@pytest.mark.skipif(not spindle.is_here(), reason=spindle.MISSING)
def test_offsets_over_can_are_the_model_of_every_row(lab):
    # One slow processor for all: rows take longer than on the host.
    spindle.replay_spindle(lab, spindle.can_bus("vcan0", "vcan1"), 600, 0.1, rate_hz=200,
                           tick_ms=10)
