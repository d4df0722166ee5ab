"""A controller that interpolates its offset along the travel: real registers, a moving slide."""

import struct

import pytest

import moving_slide
from lab import eventually, run_tool
from modbus_server import ask, read_request
from moving_slide import (LINE_DEVIATION_UM, MODEL, MOVING_S, NODES_MM, REST_S, WARM_K, WARM_S,
                          Moving, write_standing_run)


def value(table, address, encoding="int32", scale=0.001):
    scaled = f", scale = {scale}" if scale else ""
    return f'{{ table = "{table}", address = {address}, encoding = "{encoding}"{scaled} }}'


LINE = f"""[axis.line]
position = "x_mm"
travel_mm = [0.0, 800.0]
p0_mm = 100.0
begin = {value("holding", 100, "uint16", 0)}
k0_um = {value("holding", 101)}
slope_um_per_m = {value("holding", 103)}
end = {value("holding", 105, "uint16", 0)}
[axis.line.applied]
k0_um = {value("input", 101)}
slope_um_per_m = {value("input", 103)}
"""
TABLE = f"""[axis.table]
position = "x_mm"
nodes_mm = {NODES_MM}
begin = {value("holding", 100, "uint16", 0)}
offsets = {value("holding", 101)}
end = {value("holding", 111, "uint16", 0)}
applied = {value("input", 101)}
"""
FORMS = {"line": LINE, "table": TABLE}

PLACES = f"""valid_bits = {value("holding", 10, "uint16", 0)}
heartbeat = {value("holding", 11, "uint16", 0)}
[[controller.signal]]
name = "x_mm"
table = "input"
address = 20
encoding = "float32"
"""
BUS = """[[bus]]
name = "sensors"
kind = "modbus_tcp"
host = "127.0.0.1"
port = {port}
[[device]]
name = "module"
bus = "sensors"
unit = 1
period_s = 0.02
table = "input"
encoding = "float32"
"""
BED = """name = "bed"
device = "module"
address = 0
"""
CONTROLLER = """[controller]
name = "cnc"
kind = "modbus_tcp"
host = "127.0.0.1"
port = {port}
unit = 1
"""


def machine_text(form):
    return moving_slide.machine_text(BUS.format(port=0), BED, CONTROLLER.format(port=0) + PLACES,
                                     FORMS[form])


def daemon_text(form, ports):
    controller = CONTROLLER.format(port=ports["cnc"]) + "period_s = 0.02\n" + PLACES
    return moving_slide.daemon_text(BUS.format(port=ports["sensors"]), BED, controller, FORMS[form])


def slide(lab, form, stay=True):
    return Moving(lab, machine_text(form), lambda ports: daemon_text(form, ports), stay)


@pytest.mark.parametrize("form", ["line", "table"])
def test_the_controller_interpolates_what_the_daemon_fitted(lab, form):
    slide(lab, form, stay=False).assert_interpolates(form, 60 + REST_S + WARM_S + MOVING_S)


def test_a_killed_daemon_continues_along_the_travel(lab):
    moving = slide(lab, "line")
    daemon = moving.daemon.start()
    moving.wait_for_warm_line()
    daemon.kill()
    daemon.start().wait_for_mode("compensating")
    status = daemon.status()
    assert not any(axis["mismatch"] for axis in status["axes"])
    far = next(axis for axis in status["axes"] if axis["name"] == "x_2")
    assert far["axis"] == "x" and far["at_mm"] == 800.0
    assert abs(far["applied"] + 4.0 * WARM_K + LINE_DEVIATION_UM) < 0.1
    # One axis for an operator, whatever its name.
    assert daemon.cli("prove", "x", "3")[0] == 0
    assert daemon.cli("prove", "y", "3")[0] != 0
    daemon.end()


def words_of(number):
    return struct.unpack(">2H", struct.pack(">i", number))


def test_a_set_that_is_broken_off_is_never_applied(lab):
    machine = machine_text("line").replace("valid_bits", "heartbeat_timeout_s = 0.0\nvalid_bits")
    simulator = lab.simulator(machine, "--replay", write_standing_run(lab.folder), "--stay")
    link = simulator.connect("cnc")

    def write(address, *words):
        pdu = struct.pack(f">BHHB{len(words)}H", 16, address, len(words), 2 * len(words), *words)
        assert ask(link, 1, pdu)[0] == 16

    def applied():
        """K0 and slope in counts."""
        return struct.unpack(">2i", ask(link, 1, read_request(4, 101, 4))[2:])

    first = (7, *words_of(1000), *words_of(2000), 7)
    write(10, 1)
    write(100, *first)
    eventually(lambda: applied() == (1000, 2000), "the whole set")
    second = (8, *words_of(-500), *words_of(9000), 8)
    for end in range(1, len(second)):  # registers 100 to 105, interrupted after each
        write(100, *second[:end])
        write(11, end)
        assert applied() == (1000, 2000), end
    write(100, *second)
    eventually(lambda: applied() == (-500, 9000), "the next whole set")


def test_check_shows_the_deviation_of_a_line(lab):
    (lab.folder / "model.toml").write_text(MODEL)
    config = lab.folder / "line.toml"
    text = daemon_text("line", {"sensors": 1502, "cnc": 1503})
    text = text.replace("@STATE@\n", "").replace("@HISTORY@\n", "")
    config.write_text(text)
    status, output, _ = run_tool("check", config)
    assert status == 0 and "axes: x (2 nodes)" in output
    assert "largest deviation from the model's curve for 10 K: 2.50 um of 40.00 um" in output
    status, output, _ = run_tool("check", "--registers", config)
    assert status == 0
    for part in ("holding 100", "begin: number of the set of axis x",
                 "K0, offset at 100 mm of axis x", "um/m, count x 0.001",
                 "offset = K0 + slope (x_mm - 100 mm)", "everywhere on the travel within +-60 um"):
        assert part in output, output
    begin = text.index('name = "cnc"')
    config.write_text(text[:begin] + 'name = "mill"\nkind = "linuxcnc"\n' +
                      text[text.index("[[controller.signal]]"):])
    status, _, output = run_tool("check", config)
    assert status == 2 and "axis[x].line" in output and "takes a set of values as a whole" in output
