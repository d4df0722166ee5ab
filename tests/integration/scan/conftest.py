"""A simulated machine on a Modbus TCP port and on a pseudo terminal, and scans of both."""

import json
import os
import pathlib
import struct
import subprocess
import sys

import pytest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))
import lab  # noqa: E402
from lab import BIN, eventually  # noqa: E402, F401
from modbus_server import ask, read_request  # noqa: E402

SOURCE = pathlib.Path(os.environ.get("THERMOCOMP_SOURCE", "."))
PATIENCE_S = 60.0
ROOM_DEGC = 25.0

PLANT = f"""format = 1
[plant]
[room]
mean_degC = {ROOM_DEGC}
[[node]]
name = "body"
capacity_J_per_K = 1e6
[[thermocouple]]
name = "body"
node = "body"
[[bus]]
name = "net"
kind = "modbus_tcp"
[[bus]]
name = "line"
kind = "modbus_rtu"
device = "LINE"
baud = 115200
"""

MODEL = """format = 1
inputs = ["t_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
"""


class Simulator(lab.Simulator):
    def __init__(self, folder, machine):
        self.line = folder / "line"
        super().__init__(folder, machine.replace("LINE", str(self.line)))

    def read(self, unit, function, address, count):
        """Words or bits of the answer, from an independent client."""
        with self.connect("net") as link:
            head, *body = ask(link, unit, read_request(function, address, count))
        assert head == function, f"exception {body}"
        body = bytes(body[1:])
        if function in (1, 2):
            return [(body[i // 8] >> (i % 8)) & 1 for i in range(count)]
        return list(struct.unpack(f">{count}H", body))


@pytest.fixture
def simulate(tmp_path):
    running = []

    def start(machine):
        running.append(Simulator(tmp_path, machine))
        return running[-1]

    yield start
    for simulator in running:
        simulator.kill()


def bus(simulator, kind, **keys):
    if kind == "modbus_tcp":
        keys = {"host": "127.0.0.1", "port": simulator.port("net"), **keys}
    else:
        keys = {"device": str(simulator.line), "baud": 115200, "parity": "none", **keys}
    return table("[[bus]]", name="bus", kind=kind, **keys)


def table(head, **keys):
    """A TOML table; a str in a tuple is inserted verbatim."""
    def shown(value):
        if isinstance(value, tuple):
            return value[0]
        if isinstance(value, bool):
            return str(value).lower()
        return json.dumps(value) if isinstance(value, (str, list)) else repr(value)
    return head + "\n" + "".join(f"{key} = {shown(value)}\n" for key, value in keys.items())


NO_CONTROLLER = ('[controller]\nname = "none"\nkind = "dry_run"\n'
                 '[[axis]]\nname = "z"\noutput = "z_um"\n')


def configuration(folder, buses, devices, sensors, controller=NO_CONTROLLER):
    """A daemon configuration with these buses and devices; sensors: (name, keys). `controller` ends
    with the axis."""
    (folder / "model.toml").write_text(MODEL)
    text = "format = 1\n[model]\nfile = \"model.toml\"\n" + buses
    text += devices
    text += "".join(table("[[sensor]]", name=name, **keys) for name, keys in sensors)
    names = json.dumps([name for name, _ in sensors])
    text += f'[[block]]\nname = "all"\ninput = "t_degC"\nsensors = {names}\n'
    text += controller + "offset_um_max = 60.0\nrate_um_per_s_max = 0.5\n"
    path = folder / "thermocompd.toml"
    path.write_text(text)
    return path


def thermocomp(*arguments, timeout_s=PATIENCE_S):
    return subprocess.run([str(BIN / "thermocomp"), *map(str, arguments)], capture_output=True,
                          text=True, timeout=timeout_s)


def scan(path, *options):
    """The scan as JSON, and its channels by their sensors' names."""
    done = thermocomp("scan", path, "--json", *options)
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    channels = {channel["sensor"]: channel for found in report["buses"]
                for device in found["devices"] for channel in device["channels"]}
    whole = report["controller"] is None or report["controller"]["complete"]
    assert done.returncode == (0 if whole and report["good"] == report["channels"] else 1)
    return report, channels
