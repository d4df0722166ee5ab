"""Sensors and controller read by mbpoll and by raw bytes, with all events of the script."""

import random
import socket
import struct
import time

import pytest

from conftest import answer, ask, eventually, mbpoll, read_request, receive, request

BODY = """
format = 1
[plant]
[[signal]]
name = "spindle_rpm"
kind = "steps"
times_s = [0]
values = [6000]
[[signal]]
name = "x_mm"
kind = "steps"
times_s = [0]
values = [-123.456]
[[output]]
name = "z_um"
[room]
mean_degC = 21.25
[[node]]
name = "spindle"
capacity_J_per_K = 1000
displacement_um_per_K = { z_um = 10.0 }
[[thermocouple]]
name = "spindle"
node = "spindle"
[[thermocouple]]
name = "room"
node = "room"
"""

BUSES = """
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
[[bus]]
name = "line"
kind = "modbus_rtu"
device = "line"
baud = 38400
[[device]]
name = "module"
bus = "cabinet"
unit = 3
renewal = { table = "input", address = 9 }
scale = 0.01
open_circuit_codes = [32767]
[[device]]
name = "second"
bus = "cabinet"
unit = 4
table = "holding"
encoding = "float32"
word_order = "ABCD"
[[device]]
name = "on_line"
bus = "line"
unit = 7
table = "holding"
encoding = "float32"
word_order = "CDAB"
[[device]]
name = "other_on_line"
bus = "line"
unit = 8
table = "input"
scale = 0.1
[[channel]]
name = "a"
device = "module"
column = "room_degC"
address = 0
status = { table = "discrete_input", address = 0 }
[[channel]]
name = "b"
device = "second"
column = "room_degC"
address = 0
[[channel]]
name = "c"
device = "on_line"
column = "room_degC"
address = 0
[[channel]]
name = "d"
device = "other_on_line"
column = "room_degC"
address = 0
"""

CONTROLLER = """
[controller]
name = "cnc"
kind = "modbus_tcp"
heartbeat_timeout_s = 0
valid_bits = { address = 10, encoding = "uint16" }
heartbeat = { address = 11, encoding = "uint16" }
[[controller.signal]]
name = "x_mm"
address = 20
encoding = "int32"
scale = 0.001
[[controller.signal]]
name = "spindle_rpm"
address = 26
encoding = "uint16"
[[controller.signal]]
name = "disable_on"
table = "discrete_input"
address = 1
value = 1
[[axis]]
name = "z"
output = "z_um"
offset = { address = 0, encoding = "int32", scale = 0.01 }
applied = { table = "input", address = 0, encoding = "int32", scale = 0.01 }
"""

MACHINE = BODY + BUSES + CONTROLLER
LATER_S = 1e8  # plant time: an event that never ends in a test


STANDING = "--start-on-heartbeat"  # the script's time starts with begin()


def begin(simulator):
    """Starts the script's time of a STANDING simulator."""
    link = simulator.connect("cnc")
    for beat in (1, 2):
        ask(link, 1, struct.pack(">BHH", 6, 11, beat))
    link.close()


def event(kind, target, more="", at_s=0.0, duration_s=LATER_S):
    duration = "" if kind == "rehome" else f"duration_s = {duration_s}\n"
    return f'[[event]]\nkind = "{kind}"\ntarget = "{target}"\nat_s = {at_s}\n{duration}{more}\n'


def room_of(link):
    """Raw value of the room sensor."""
    body = ask(link, 3, read_request(4, 0, 1))
    return struct.unpack(">h", body[2:])[0]


def rtu_options(simulator, unit):
    return ["-m", "rtu", "-b", 38400, "-P", "none", "-a", unit, "-0", "-r", 0, "-c", 1,
            simulator.folder / "line"]


def tcp_options(simulator, bus, unit):
    return ["-m", "tcp", "-p", simulator.port(bus), "-a", unit, "-0"]


def test_mbpoll_reads_every_unit_over_tcp_and_serial_line(simulate):
    simulator = simulate(MACHINE)
    host = "127.0.0.1"
    values, errors = mbpoll(*tcp_options(simulator, "cabinet", 3), "-t", 3, "-r", 0, "-c", 1, host)
    assert values == {0: "2125"}, errors
    values, errors = mbpoll(*tcp_options(simulator, "cabinet", 4), "-t", "4:float", "-B", "-r", 0,
                            "-c", 1, host)
    assert float(values[0]) == pytest.approx(21.25), errors
    values, errors = mbpoll("-t", "4:float", *rtu_options(simulator, 7))
    assert float(values[0]) == pytest.approx(21.25), errors
    values, errors = mbpoll("-t", 3, *rtu_options(simulator, 8))
    assert values == {0: "213"}, errors


def test_mbpoll_writes_offsets_and_reads_what_is_applied(simulate):
    simulator = simulate(MACHINE)
    options = tcp_options(simulator, "cnc", 1)
    mbpoll(*options, "-t", 4, "-r", 10, "127.0.0.1", 1)                # valid
    mbpoll(*options, "-t", "4:int", "-B", "-r", 0, "127.0.0.1", "--", -1234)
    values, errors = mbpoll(*options, "-t", "3:int", "-B", "-r", 0, "-c", 1, "127.0.0.1")
    assert values == {0: "-1234"}, errors
    values, errors = mbpoll(*options, "-t", "3:int", "-B", "-r", 20, "-c", 1, "127.0.0.1")
    assert values == {20: "-123456"}, errors
    values, errors = mbpoll(*options, "-t", 3, "-r", 26, "-c", 1, "127.0.0.1")
    assert values == {26: "6000"}, errors
    values, errors = mbpoll(*options, "-t", 1, "-r", 1, "-c", 1, "127.0.0.1")
    assert values == {1: "1"}, errors


def test_an_offset_counts_at_the_tool(simulate, tmp_path):
    simulator = simulate(MACHINE, "--truth", tmp_path / "truth.csv", "--truth-period-s", 0.05)
    link = simulator.connect("cnc")
    ask(link, 1, struct.pack(">BHHB2H", 16, 10, 2, 4, 1, 1))
    ask(link, 1, struct.pack(">BHHBi", 16, 0, 2, 4, 300))
    time.sleep(0.3)
    lines = simulator.end().splitlines()
    assert lines[-1].startswith("error rms at the tool: uncompensated 0.00 um, compensated ")
    rows = (tmp_path / "truth.csv").read_text().splitlines()
    assert rows[0] == "time_s,x_mm,spindle_degC,room_degC,z_um,z_offset_um,z_error_um"
    assert rows[-1].split(",")[-2:] == ["3", "3"]
    times = [float(row.split(",")[0]) for row in rows[1:]]
    assert times == pytest.approx([0.05 * i for i in range(len(times))])


def test_a_renewal_register_counts_until_the_device_freezes(simulate):
    simulator = simulate(MACHINE)
    link = simulator.connect("cabinet")
    first = ask(link, 3, read_request(4, 9, 1))
    eventually(lambda: ask(link, 3, read_request(4, 9, 1)) != first, "a conversion")
    frozen = simulate(MACHINE + event("freeze", "module", at_s=0.2))
    link = frozen.connect("cabinet")

    def stands():
        seen = ask(link, 3, read_request(4, 9, 1))
        time.sleep(0.5)
        return ask(link, 3, read_request(4, 9, 1)) == seen

    eventually(stands, "no more conversions")
    assert stands()


def test_an_open_circuit_shows_its_code_and_status_and_ends(simulate):
    simulator = simulate(MACHINE + event("open_circuit", "a", at_s=0.0, duration_s=0.5), STANDING)
    link = simulator.connect("cabinet")
    assert room_of(link) == 32767
    assert ask(link, 3, read_request(2, 0, 1)) == bytes([2, 1, 1])
    begin(simulator)
    eventually(lambda: room_of(link) == 2125, "the circuit closed again")
    assert ask(link, 3, read_request(2, 0, 1)) == bytes([2, 1, 0])


def test_an_exception_is_the_one_in_the_script_and_only_of_its_device(simulate):
    code = random.Random(1).choice([4, 5, 6])
    link = simulate(MACHINE + event("exception", "module", f"code = {code}")).connect("cabinet")
    assert ask(link, 3, read_request(4, 0, 1)) == bytes([0x84, code])
    assert ask(link, 4, read_request(3, 0, 2))[0] == 3


def test_a_dropped_device_is_silent_while_its_neighbour_answers(simulate):
    simulator = simulate(MACHINE + event("drop", "module") + event("drop", "on_line"))
    link = simulator.connect("cabinet")
    link.sendall(request(3, read_request(4, 0, 1), 11))
    assert ask(link, 4, read_request(3, 0, 2), 12)[0] == 3  # answer 11 was not sent before it
    values, errors = mbpoll("-t", 3, *rtu_options(simulator, 8))
    assert values == {0: "213"}, errors
    values, errors = mbpoll("-t", "4:float", "-o", 0.2, *rtu_options(simulator, 7))
    assert values == {}
    assert "timed out" in errors


def test_a_delayed_answer_comes_late_with_its_own_transaction(simulate):
    link = simulate(MACHINE + event("delay", "module", "delay_ms = 300")).connect("cabinet")
    begin = time.monotonic()
    link.sendall(request(3, read_request(4, 0, 1), 21) + request(4, read_request(3, 0, 2), 22))
    assert answer(link)[0] == 22
    assert answer(link)[0] == 21
    assert time.monotonic() - begin >= 0.3


def test_garbage_is_not_an_answer(simulate):
    simulator = simulate(MACHINE + event("garbage", "module") + event("garbage", "on_line"))
    link = simulator.connect("cabinet")
    link.sendall(request(3, read_request(4, 0, 1), 31))
    assert receive(link, 3)[:2] != bytes([0, 31])
    values, errors = mbpoll("-t", "4:float", "-o", 0.2, *rtu_options(simulator, 7))
    assert values == {}, errors
    assert simulator.alive()


def closed(link):
    try:
        return link.recv(1) == b""
    except ConnectionResetError:
        return True


def test_a_rebooting_device_closes_connections_is_silent_and_comes_back(simulate):
    simulator = simulate(MACHINE + event("reboot", "module", at_s=0.2, duration_s=2.0), STANDING)
    link = simulator.connect("cabinet")
    assert room_of(link) == 2125
    begin(simulator)
    assert closed(link)
    link = simulator.connect("cabinet")  # the coupler answers, the module does not
    link.sendall(request(3, read_request(4, 0, 1), 41))
    assert ask(link, 4, read_request(3, 0, 2), 42)[0] == 3

    def back():
        link.settimeout(0.2)
        try:
            return room_of(link) == 2125
        except (TimeoutError, socket.timeout):
            return False

    eventually(back, "the module answers again")


def refused(simulator, name):
    try:
        simulator.connect(name).close()
        return False
    except ConnectionRefusedError:
        return True


def test_a_bus_without_power_refuses_connections_and_keeps_its_port(simulate):
    simulator = simulate(MACHINE + event("reboot", "cabinet", at_s=0.2, duration_s=2.0), STANDING)
    assert not refused(simulator, "cabinet")
    begin(simulator)
    eventually(lambda: refused(simulator, "cabinet"), "the bus went down")
    eventually(lambda: not refused(simulator, "cabinet"), "the bus came back")
    assert room_of(simulator.connect("cabinet")) == 2125


def write_offset(link, hundredths):
    ask(link, 1, struct.pack(">BHHB2H", 16, 10, 2, 4, 1, 1))
    ask(link, 1, struct.pack(">BHHBi", 16, 0, 2, 4, hundredths))


def applied(link):
    return struct.unpack(">i", ask(link, 1, read_request(4, 0, 2))[2:])[0]


def test_a_controller_that_was_off_has_forgotten_its_offset(simulate):
    simulator = simulate(MACHINE + event("reboot", "cnc", at_s=0.2, duration_s=0.5), STANDING)
    link = simulator.connect("cnc")
    write_offset(link, 500)
    assert applied(link) == 500
    begin(simulator)
    assert closed(link)
    eventually(lambda: not refused(simulator, "cnc"), "the controller came back")
    link = simulator.connect("cnc")
    assert applied(link) == 0
    assert ask(link, 1, read_request(3, 0, 2))[2:] == bytes(4)
    write_offset(link, 700)
    assert applied(link) == 700


def test_many_clients_at_once_are_answered(simulate):
    simulator = simulate(MACHINE)
    links = [simulator.connect("cabinet") for _ in range(100)]
    for i, link in enumerate(links):
        link.sendall(b"".join(request(3, read_request(4, 0, 1), 10 * i + k) for k in range(10)))
    for i, link in enumerate(links):
        assert [answer(link)[0] for _ in range(10)] == [10 * i + k for k in range(10)]


def test_a_client_that_never_reads_is_put_out(simulate):
    simulator = simulate(MACHINE)
    greedy = simulator.connect("cabinet")
    greedy.settimeout(0.5)
    with pytest.raises((OSError, TimeoutError)):
        for _ in range(2000):
            greedy.sendall(request(3, read_request(4, 0, 9)) * 1000)
    assert room_of(simulator.connect("cabinet")) == 2125


def test_a_slow_line_takes_the_time_of_its_bytes(simulate):
    slow = MACHINE.replace("baud = 38400", "baud = 300\nline_delay = true")
    simulator = simulate(slow)
    begin = time.monotonic()
    values, errors = mbpoll("-t", 3, "-o", 5, *rtu_options(simulator, 8))
    assert values == {0: "213"}, errors
    # 8 characters out, 3.5 of silence, 7 back, 11 bits each at 300 baud
    assert time.monotonic() - begin >= 0.67
