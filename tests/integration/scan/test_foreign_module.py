"""Reads Debian's pymodbus server as a thermocouple module, over TCP and over a serial line."""

import pathlib
import shutil
import socket
import subprocess

import pytest
from conftest import configuration, eventually, scan, table

SERVER = ["/usr/bin/python3", str(pathlib.Path(__file__).with_name("foreign_module.py"))]
DEVICE = table("[[device]]", name="module", bus="bus", unit=5, table="input", encoding="int16",
               scale=0.1, open_circuit_codes=[32767])
FLOATS = {order: {"address": 2 * i, "encoding": "float32", "word_order": order, "scale": 1.0}
          for i, order in enumerate(["ABCD", "DCBA", "BADC", "CDAB"])}
# Sensors: (keys, fault, degC)
OTHERS = {
    "tenths": ({"address": 20}, "none", 21.5),
    "negative": ({"address": 21}, "none", -5.7),
    "sentinel": ({"address": 22}, "open_circuit", None),
    "neighbour": ({"address": 23}, "none", 0.1),
    "status_good": ({"address": 20, "status": ('{ table = "discrete_input", address = 0 }',)},
                    "none", 21.5),
    "status_open": ({"address": 21, "status": ('{ table = "discrete_input", address = 1, '
                                               'open_circuit_codes = [1] }',)},
                    "open_circuit", None),
    "float64": ({"table": "holding", "address": 0, "encoding": "float64", "word_order": "ABCD",
                 "scale": 1.0}, "none", -12.625),
    "missing": ({"address": 5000}, "device_error", None),
}


def accepts(port):
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
        return True
    except OSError:
        return False


@pytest.fixture(params=["tcp", "rtu"])
def bus(request, tmp_path):
    """The bus with the server behind it."""
    processes = []
    if request.param == "tcp":
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        processes.append(subprocess.Popen([*SERVER, "tcp", str(port)]))
        eventually(lambda: accepts(port), "the server listens")
        keys = {"kind": "modbus_tcp", "host": "127.0.0.1", "port": port}
    else:
        if shutil.which("socat") is None:
            pytest.skip("socat is not installed")
        ours, theirs = tmp_path / "ours", tmp_path / "theirs"
        processes.append(subprocess.Popen(["socat", f"pty,raw,echo=0,link={ours}",
                                           f"pty,raw,echo=0,link={theirs}"]))
        eventually(lambda: ours.exists() and theirs.exists(), "the serial line")
        processes.append(subprocess.Popen([*SERVER, "rtu", str(theirs), "19200"]))
        keys = {"kind": "modbus_rtu", "device": str(ours), "baud": 19200, "parity": "none"}
    yield table("[[bus]]", name="bus", timeout_ms=5000.0, retries=5, **keys)
    for process in processes:
        process.kill()
        process.wait()


def test_every_kind_of_value_is_read(tmp_path, bus):
    sensors = [(name, {"device": "module", **keys}) for name, keys in FLOATS.items()]
    sensors += [(name, {"device": "module", **keys}) for name, (keys, _, _) in OTHERS.items()]
    _, seen = scan(configuration(tmp_path, bus, DEVICE, sensors))
    for name in FLOATS:
        assert (seen[name]["fault"], seen[name]["temp_degC"]) == ("none", 23.4375), name
    for name, (_, fault, temp_degC) in OTHERS.items():
        assert seen[name]["fault"] == fault, (name, seen[name])
        assert seen[name]["temp_degC"] == (None if temp_degC is None else pytest.approx(temp_degC))
