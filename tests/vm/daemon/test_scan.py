"""`thermocomp scan` on CAN: received and missing frames are reported, and nodes are found."""

import json
import os
import pathlib
import socket
import struct
import subprocess
import threading

import pytest

BIN = pathlib.Path(os.environ["THERMOCOMP_BIN"])
MODEL = """format = 1
inputs = ["t_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
"""


class Bus:
    """Sends frames repeatedly, and answers to identifiers."""

    def __init__(self, frames, answers=None):
        self.frames, self.answers = frames, answers or {}
        self.link = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.link.bind(("vcan0",))
        self.link.settimeout(0.05)
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def send(self, identifier, data):
        if identifier > 0x7FF:
            identifier |= socket.CAN_EFF_FLAG
        self.link.send(struct.pack("=IB3x8s", identifier, len(data), data))

    def run(self):
        while not self.ending.is_set():
            for identifier, data in self.frames:
                self.send(identifier, data)
            try:
                while True:
                    identifier = struct.unpack("=IB3x8s", self.link.recv(16))[0]
                    if identifier in self.answers:
                        self.send(*self.answers[identifier])
            except socket.timeout:
                pass

    def end(self):
        self.ending.set()
        self.thread.join()
        self.link.close()


@pytest.fixture
def frames():
    running = []

    def start(*arguments):
        running.append(Bus(*arguments))

    yield start
    for bus in running:
        bus.end()


NO_CONTROLLER = 'name = "n"\nkind = "dry_run"\n[[axis]]\nname = "z"\noutput = "z_um"\n'


def configuration(folder, kind, device, sensors, controller=NO_CONTROLLER):
    (folder / "model.toml").write_text(MODEL)
    text = 'format = 1\n[model]\nfile = "model.toml"\n'
    text += f'[[bus]]\nname = "b"\nkind = "{kind}"\ninterface = "vcan0"\n'
    text += '[[device]]\nname = "d"\nbus = "b"\n' + device
    text += "".join(f'[[sensor]]\nname = "{name}"\ndevice = "d"\n{keys}\n'
                    for name, keys in sensors)
    names = json.dumps([name for name, _ in sensors])
    text += f'[[block]]\nname = "a"\ninput = "t_degC"\nsensors = {names}\n'
    text += "[controller]\n" + controller
    text += "offset_um_max = 60.0\nrate_um_per_s_max = 0.5\n"
    (folder / "c.toml").write_text(text)
    return folder / "c.toml"


def scan(path, *options):
    done = subprocess.run([BIN / "thermocomp", "scan", path, "--json", "--listen", "3", *options],
                          capture_output=True, text=True, timeout=120)
    assert done.returncode in (0, 1), done.stderr
    bus = json.loads(done.stdout)["buses"][0]
    return bus, {channel["sensor"]: channel for channel in bus["devices"][0]["channels"]}


def test_signals_show_their_bytes_and_a_wrong_byte_order_is_recognised(frames, tmp_path):
    frames([(0x181, bytes.fromhex("FA00FF7F00FA0000"))])
    path = configuration(
        tmp_path, "can", "id = 0x181\nlength_bits = 16\nscale = 0.1\nopen_circuit_codes = [32767]\n",
        [("good", "start_bit = 0"), ("open", "start_bit = 16"), ("order", "start_bit = 32"),
         ("absent", "start_bit = 0\nid = 0x182")])
    bus, seen = scan(path)
    assert "0x181" in bus["note"]
    assert seen["good"]["temp_degC"] == 25.0 and seen["good"]["raw"].startswith("FA 00")
    assert seen["open"]["fault"] == "open_circuit"
    assert seen["order"]["hints"] == [
        'byte_order = "big_endian" with start_bit = 39 would make it 25 degC']
    assert seen["absent"]["fault"] == "never_read" and "0x182" in seen["absent"]["why"]


def test_a_j1939_preset_gives_temperatures_and_the_standards_codes_their_faults(frames, tmp_path):
    raw = round((25.0 + 273.0) / 0.03125)
    frames([(0x18FEA380, struct.pack("<4H", raw, 0xFE00, 0xFFFF, raw))])
    path = configuration(tmp_path, "j1939", 'preset = "j1939_exhaust_ports"\naddress = 0x80\n',
                         [(f"s{i}", f"channel = {i}") for i in range(1, 5)])
    _, seen = scan(path)
    assert seen["s1"]["temp_degC"] == 25.0 and seen["s4"]["temp_degC"] == 25.0
    assert seen["s2"]["fault"] == "open_circuit"
    assert seen["s3"]["fault"] == "device_error"


def test_canopen_nodes_are_found_whether_configured_or_not(frames, tmp_path):
    answer = bytes.fromhex("4300100094010200")
    frames([(0x70C, b"\x05")], {0x605: (0x585, answer), 0x609: (0x589, answer)})
    path = configuration(tmp_path, "canopen",
                         'preset = "jumo_cantrans_t"\nnode = 5\nscale = 0.1\n',
                         [("probe", "channel = 1")])
    bus, _ = scan(path, "--find")
    assert bus["found"] == [5, 9, 12]


def test_a_controller_is_listened_to_and_nothing_is_sent(frames, tmp_path):
    applied = struct.pack(">h", -250)
    frames([(0x181, bytes.fromhex("FA00")), (0x281, applied + b"\x01"), (0x282, b"\x07")])
    controller = """name = "cnc"
kind = "can"
interface = "vcan0"
heartbeat = { id = 0x200, start_bit = 56, length_bits = 8 }
[[controller.signal]]
name = "cutting_on"
id = 0x281
start_bit = 16
length_bits = 1
signed = false
[[controller.signal]]
name = "x_mm"
id = 0x282
start_bit = 0
length_bits = 32
[[controller.signal]]
name = "y_mm"
id = 0x283
start_bit = 0
length_bits = 32
[[axis]]
name = "z"
output = "z_um"
offset = { id = 0x200, start_bit = 0, length_bits = 16, scale = 0.01 }
applied = { id = 0x281, start_bit = 7, length_bits = 16, byte_order = "big_endian", scale = 0.01 }
"""
    path = configuration(tmp_path, "can", "id = 0x181\nlength_bits = 16\nscale = 0.1\n",
                         [("good", "start_bit = 0")], controller)
    listener = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    listener.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", 0x200, 0x7FF))
    listener.bind(("vcan0",))
    listener.setblocking(False)
    done = subprocess.run([BIN / "thermocomp", "scan", path, "--json", "--listen", "3"],
                          capture_output=True, text=True, timeout=120)
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    assert report["good"] == 1
    found = report["controller"]
    assert found["kind"] == "can" and found["error"] == "" and not found["complete"]
    values = {each["what"]: each for each in found["values"]}
    assert values["applied of axis z"]["value"] == -2.5 and values["cutting_on"]["value"] == 1
    assert values["x_mm"]["why"] == "the frame has 1 bytes, which is too few"
    assert values["y_mm"]["why"] == "no frame with identifier 0x283 was received"
    with pytest.raises(BlockingIOError), listener:
        listener.recv(16)
