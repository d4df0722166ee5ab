"""`thermocomp scan` of the controller: reads every register and signal, writes registers back where
that moves nothing, and names missing ones with the answer received."""

import socket
import struct
import threading

import pytest
from conftest import PLANT, bus, configuration, scan, table, thermocomp

SHOWN = {"x_mm": 250.0, "spindle_rpm": 3000, "cutting_on": 1}


def signals(is_simulated):
    places = (("x_mm", {"table": "input", "address": 20, "encoding": "int32", "scale": 0.001}),
              ("spindle_rpm", {"table": "input", "address": 24, "encoding": "uint16"}),
              ("cutting_on", {"table": "discrete_input", "address": 0}))
    return "".join(table("[[controller.signal]]", name=name, **keys,
                         **({"value": SHOWN[name]} if is_simulated else {}))
                   for name, keys in places)


SIGNALS = signals(False)
PLACES = (
    '{ table = "holding", address = 0, encoding = "int32", scale = 0.001 }',
    '{ table = "input", address = 10, encoding = "int32", scale = 0.001 }')
AXIS = f'[[axis]]\nname = "z"\noutput = "z_um"\noffset = {PLACES[0]}\napplied = {PLACES[1]}\n'
VALID_AND_HEARTBEAT = ('valid_bits = { table = "holding", address = 6, encoding = "uint16" }\n'
                       'heartbeat = { table = "holding", address = 7, encoding = "uint16" }\n')
MACHINE = (PLANT.replace('[[node]]\nname = "body"\n', '[[output]]\nname = "z_um"\n[[node]]\n'
                         'name = "body"\ndisplacement_um_per_K = {z_um = 1.0}\n')
           + table("[[device]]", name="module", bus="net", unit=4, table="input", encoding="int16",
                   scale=0.1)
           + table("[[channel]]", name="t", device="module", column="body_degC", address=0)
           + '[controller]\nname = "cnc"\nkind = "modbus_tcp"\nport = 0\n' + VALID_AND_HEARTBEAT
           + signals(True)
           + '[[axis]]\nname = "z"\noutput = "z_um"\n' + f"offset = {PLACES[0]}\napplied = {PLACES[1]}\n")
DEVICES = table("[[device]]", name="module", bus="bus", unit=4, table="input", encoding="int16",
                scale=0.1)
SENSORS = [("t", {"device": "module", "address": 0})]


class Relay:
    """Between the scan and the simulated controller: records the function of every request, and can
    discard them."""

    def __init__(self, port, is_silent=False):
        self.target, self.is_silent, self.functions = port, is_silent, []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                link, _ = self.server.accept()
            except OSError:
                return
            threading.Thread(target=self.serve, args=(link,), daemon=True).start()

    def serve(self, link):
        with link, socket.create_connection(("127.0.0.1", self.target)) as onward:
            requests, answers = link.makefile("rb"), onward.makefile("rb")
            while len(head := requests.read(7)) == 7:
                body = requests.read(struct.unpack(">H", head[4:6])[0] - 1)
                self.functions.append(body[0])
                if self.is_silent:
                    continue
                onward.sendall(head + body)
                head = answers.read(7)
                link.sendall(head + answers.read(struct.unpack(">H", head[4:6])[0] - 1))

    def close(self):
        self.server.close()


@pytest.fixture
def relay():
    opened = []

    def between(port, **options):
        opened.append(Relay(port, **options))
        return opened[-1]

    yield between
    for each in opened:
        each.close()


def controller(port, signals=SIGNALS, **keys):
    return (table("[controller]", name="cnc", kind="modbus_tcp", host="127.0.0.1", port=port, unit=1,
                  timeout_ms=3000.0, **keys) + VALID_AND_HEARTBEAT + signals + AXIS)


def written(simulator):
    """Current content of the registers written by the daemon."""
    with simulator.connect("cnc") as link:
        link.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0, 8))
        answer = link.makefile("rb").read(9 + 16)
    return answer[9:]


def test_every_register_is_read_and_none_is_changed(simulate, relay, tmp_path):
    simulator = simulate(MACHINE)
    between = relay(simulator.port("cnc"))
    before = written(simulator)
    path = configuration(tmp_path, bus(simulator, "modbus_tcp", timeout_ms=3000.0), DEVICES,
                         SENSORS, controller(between.port))
    report, seen = scan(path, "--read-only")
    assert seen["t"]["fault"] == "none"
    found = report["controller"]
    assert found["complete"] and found["name"] == "cnc" and found["address"] == "unit 1"
    values = {each["what"]: each for each in found["values"]}
    assert set(values) == {"applied of axis z", "offset of axis z", "valid_bits",
                           "heartbeat"} | set(SHOWN)
    assert {name: values[name]["value"] for name in SHOWN} == SHOWN
    assert values["x_mm"]["raw"] == "00 03 D0 90" and values["x_mm"]["unit"] == "mm"
    assert values["applied of axis z"]["value"] == 0.0
    assert [values[name]["written"] for name in ("x_mm", "heartbeat")] == [False, True]
    # All of the controller's tables were read, and nothing else requested.
    assert {2, 3, 4} <= set(between.functions) <= {1, 2, 3, 4}, between.functions
    assert written(simulator) == before

    done = thermocomp("scan", path)
    assert done.returncode == 0, done.stdout
    assert "controller cnc (modbus_tcp, 127.0.0.1:" in done.stdout
    assert "-> 250.00 mm" in done.stdout
    assert done.stdout.endswith(
        "    writes are answered: the registers' present values were written back (thermocomp status "
        "shows whether a new offset is applied)\n"
        "1 of 1 channels give a temperature\n7 of 7 values of the controller are present\n")
    assert 16 in between.functions
    assert written(simulator) == before


def write(simulator, address, words):
    with simulator.connect("cnc") as link:
        link.sendall(struct.pack(">HHHBBHHB", 1, 0, 7 + 2 * len(words), 1, 16, address, len(words),
                                 2 * len(words)) + struct.pack(f">{len(words)}H", *words))
        assert link.recv(100)[7] == 16


@pytest.mark.parametrize("keys, why", [
    ({}, "offset of axis z differs from the applied offset"),  # no valid axis
    ({"dry_run": True}, "")])
def test_nothing_is_written_that_might_move_an_axis(simulate, relay, tmp_path, keys, why):
    simulator = simulate(MACHINE)
    between = relay(simulator.port("cnc"))
    write(simulator, 0, [0, 5000])
    path = configuration(tmp_path, bus(simulator, "modbus_tcp", timeout_ms=3000.0), DEVICES,
                         SENSORS, controller(between.port, **keys))
    report, _ = scan(path)
    assert report["controller"]["complete"]
    assert report["controller"]["writes"] == (f"writes were not tried: {why}" if why else "")
    assert 16 not in between.functions


def test_a_register_that_is_not_there_is_named_with_the_exception(simulate, relay, tmp_path):
    simulator = simulate(MACHINE)
    more = table("[[controller.signal]]", name="y_mm", table="input", address=900,
                 encoding="int32", scale=0.001)
    path = configuration(tmp_path, bus(simulator, "modbus_tcp", timeout_ms=3000.0), DEVICES,
                         SENSORS, controller(relay(simulator.port("cnc")).port, SIGNALS + more))
    report, _ = scan(path)
    missing = [each for each in report["controller"]["values"] if each["why"]]
    assert [each["what"] for each in missing] == ["y_mm"]
    assert "exception 2 (illegal data address)" in missing[0]["why"]
    done = thermocomp("scan", path, "--bus", "cnc")
    assert done.returncode == 1
    assert "7 of 8 values of the controller are present; missing: y_mm\n" in done.stdout
    assert "channels give a temperature" not in done.stdout  # only the controller was tested


def test_a_read_back_that_can_be_no_offset_is_not_taken_for_one(simulate, tmp_path):
    simulator = simulate(MACHINE)
    at_position = '{ table = "input", address = 20, encoding = "int32" }'  # 250000 um
    path = configuration(tmp_path, bus(simulator, "modbus_tcp", timeout_ms=3000.0), DEVICES, SENSORS,
                         controller(simulator.port("cnc"), signals="").replace(PLACES[1], at_position))
    done = thermocomp("scan", path, "--bus", "cnc")
    assert done.returncode == 1 and "is no offset of an axis" in done.stdout, done.stdout


def test_a_silent_or_lost_controller_is_reported(simulate, relay, tmp_path):
    simulator = simulate(MACHINE)
    sensors = bus(simulator, "modbus_tcp", timeout_ms=3000.0)
    silent = controller(relay(simulator.port("cnc"), is_silent=True).port)
    path = configuration(tmp_path, sensors, DEVICES, SENSORS,
                         silent.replace("timeout_ms = 3000.0", "timeout_ms = 200.0"))
    report, _ = scan(path)
    assert report["good"] == 1  # the sensors are good
    assert "unit 1: no answer within timeout_ms = 200" in report["controller"]["error"]
    assert all(each["why"] == "no answer" for each in report["controller"]["values"])

    gone = socket.create_server(("127.0.0.1", 0))
    port = gone.getsockname()[1]
    gone.close()
    report, _ = scan(configuration(tmp_path, sensors, DEVICES, SENSORS, controller(port)))
    assert "cannot be opened" in report["controller"]["error"]
    assert all(each["why"] == "was not requested" for each in report["controller"]["values"])
