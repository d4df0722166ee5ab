"""A pymodbus server is read as a thermocouple module, over TCP and over a serial line."""
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import time

import pytest

HERE = pathlib.Path(__file__).parent
READ_SENSORS = os.environ["READ_SENSORS"]
PYTHON = "/usr/bin/python3"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(holds, limit_s=20.0):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        if holds():
            return
        time.sleep(0.05)
    pytest.fail("did not happen in time")


def accepts(port):
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
        return True
    except OSError:
        return False


@pytest.fixture(params=["tcp", "rtu"])
def module(request, tmp_path):
    """The line's description for read_sensors, with the server running behind it."""
    processes = []

    def start(*command):
        processes.append(subprocess.Popen(command, stdout=sys.stderr))

    if request.param == "tcp":
        port = free_port()
        start(PYTHON, str(HERE / "thermocouple_module.py"), "tcp", str(port))
        wait_for(lambda: accepts(port))
        line = {"tcp": {"host": "127.0.0.1", "port": port}}
    else:
        if shutil.which("socat") is None:
            pytest.skip("socat is not installed")
        ours, theirs = tmp_path / "ours", tmp_path / "theirs"
        start("socat", f"pty,raw,echo=0,link={ours}", f"pty,raw,echo=0,link={theirs}")
        wait_for(lambda: ours.exists() and theirs.exists())
        start(PYTHON, str(HERE / "thermocouple_module.py"), "rtu", str(theirs), "19200")
        line = {"rtu": {"device": str(ours), "baud": 19200}}
    yield line
    for process in processes:
        process.kill()
        process.wait()


def read(tmp_path, line, channels, unit=5):
    bus = tmp_path / "bus.json"
    bus.write_text(json.dumps({**line, "unit": unit, "channels": channels}))
    done = subprocess.run([READ_SENSORS, str(bus)], capture_output=True, text=True, timeout=60,
                          check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_float32_is_read_in_all_four_word_orders(tmp_path, module):
    orders = ["ABCD", "DCBA", "BADC", "CDAB"]
    channels = [{"address": 2 * i, "encoding": "float32", "word_order": order}
                for i, order in enumerate(orders)]
    for order, reading in zip(orders, read(tmp_path, module, channels)):
        assert reading == {"fault": "none", "temp_degC": 23.4375}, order


def test_a_sentinel_is_an_open_circuit_and_its_neighbours_are_values(tmp_path, module):
    channels = [{"address": 20 + i, "encoding": "int16", "scale": 0.1,
                 "open_circuit_codes": [32767]} for i in range(4)]
    readings = read(tmp_path, module, channels)
    assert [reading["fault"] for reading in readings] == ["none", "none", "open_circuit", "none"]
    assert readings[0]["temp_degC"] == pytest.approx(21.5)
    assert readings[1]["temp_degC"] == pytest.approx(-5.7)
    assert readings[2]["temp_degC"] is None
    assert readings[3]["temp_degC"] == pytest.approx(0.1)


def test_status_bits_holding_registers_and_wide_values(tmp_path, module):
    readings = read(tmp_path, module, [
        {"address": 20, "scale": 0.1, "status_bit": 0},
        {"address": 21, "scale": 0.1, "status_bit": 1},
        {"table": "holding", "address": 0, "encoding": "float64"},
        {"table": "holding", "address": 10, "encoding": "int32", "word_order": "CDAB"},
    ])
    assert [reading["fault"] for reading in readings] == ["none", "open_circuit", "none", "none"]
    assert readings[2]["temp_degC"] == -12.625
    assert readings[3]["temp_degC"] == -123456.0


def test_registers_the_module_does_not_have_are_a_device_error(tmp_path, module):
    readings = read(tmp_path, module, [{"address": 20, "scale": 0.1}, {"address": 5000}])
    assert readings[0]["fault"] == "none"
    assert readings[1]["fault"] == "device_error"
