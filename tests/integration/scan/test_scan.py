"""`thermocomp scan` on lines with the usual mistakes: each is identified."""

import re
import struct
import subprocess

import pytest
from conftest import (BIN, PLANT, ROOM_DEGC, SOURCE, bus, configuration, eventually, scan, table,
                      thermocomp)

MACHINE = PLANT + "".join(
    table("[[device]]", name=f"{where}_floats", bus=where, unit=3, table="holding",
          encoding="float32", word_order="CDAB")
    + table("[[device]]", name=f"{where}_tenths", bus=where, unit=4, table="input",
            encoding="int16", scale=0.1, open_circuit_codes=[32767])
    + "".join(table("[[channel]]", name=f"{where}_f{i}", device=f"{where}_floats",
                    column="body_degC", address=2 * i) for i in range(2))
    + "".join(table("[[channel]]", name=f"{where}_t{i}", device=f"{where}_tenths",
                    column="body_degC", address=i) for i in range(4))
    + table("[[event]]", kind="open_circuit", target=f"{where}_t1", at_s=0.0, duration_s=1e9)
    for where in ("net", "line"))

DEVICES = (table("[[device]]", name="column_module", bus="bus", unit=3, table="holding",
                 encoding="float32", word_order="CDAB")
           + table("[[device]]", name="bed_module", bus="bus", unit=4, table="input",
                   encoding="int16", scale=0.1, open_circuit_codes=[32767])
           + table("[[device]]", name="spindle_module", bus="bus", unit=9, table="input",
                   encoding="int16", scale=0.1))
SENSORS = [
    ("column_left", {"device": "column_module", "address": 0, "word_order": "ABCD"}),
    ("column_right", {"device": "column_module", "address": 2}),
    ("bed_front", {"device": "bed_module", "address": 0}),
    ("bed_rear", {"device": "bed_module", "address": 1}),
    ("bed_middle", {"device": "bed_module", "address": 4}),
    ("spindle", {"device": "spindle_module", "address": 0}),
]


@pytest.mark.parametrize("kind", ["modbus_tcp", "modbus_rtu"])
def test_each_mistake_is_identified(simulate, tmp_path, kind):
    simulator = simulate(MACHINE)
    # Only the missing unit may ever time out.
    path = configuration(tmp_path, bus(simulator, kind, timeout_ms=3000.0), DEVICES, SENSORS)
    report, seen = scan(path)
    assert report["good"] == 2 and report["channels"] == 6
    for name in ("column_right", "bed_front"):
        assert seen[name]["fault"] == "none"
        assert seen[name]["temp_degC"] == pytest.approx(ROOM_DEGC, abs=0.1)
        assert seen[name]["round_trip_ms"] > 0 and seen[name]["age_s"] >= 0
    words = struct.unpack(">HH", struct.pack(">f", ROOM_DEGC))
    raw = f"{words[1]:04X}{words[0]:04X}"
    assert seen["column_left"]["raw"] == " ".join(raw[i:i + 2] for i in range(0, 8, 2))
    assert seen["column_left"]["fault"] == "out_of_range"
    # Two words look right in another order or from the next address: only the manual can tell.
    assert seen["column_left"]["hints"] == [
        'word_order = "CDAB" would make it 25.00 degC',
        "address = 1 would make it 25 degC: manuals often count from 1"]
    assert seen["bed_rear"]["fault"] == "open_circuit" and seen["bed_rear"]["raw"] == "7F FF"
    assert any("terminals" in hint for hint in seen["bed_rear"]["hints"])
    assert seen["bed_middle"]["fault"] == "device_error"
    assert "exception 2" in seen["bed_middle"]["why"]
    assert seen["bed_middle"]["hints"] == [
        "address = 3 would make it 25 degC: manuals often count from 1"]
    assert seen["spindle"]["fault"] in ("no_answer", "device_error")
    spindle = report["buses"][0]["devices"][2]
    assert not spindle["answers"] and "others on this bus do" in spindle["note"]


def test_the_text_agrees(simulate, tmp_path):
    simulator = simulate(MACHINE)
    path = configuration(tmp_path, bus(simulator, "modbus_rtu", timeout_ms=1500.0), DEVICES,
                         SENSORS)
    done = thermocomp("scan", path)
    assert done.returncode == 1
    for words in ("column_left", 'word_order = "CDAB"', "open_circuit", "exception 2",
                  "address = 3", "unit 9: no answer within", "2 of 6 channels give a temperature"):
        assert words in done.stdout, done.stdout
    assert "asking its devices as the daemon does" in done.stderr


def without_figures(text):
    """The text without run-dependent parts: times, place and user of the line."""
    text = re.sub(r" +$", "", re.sub(r" +also open in .*\n", "", text), flags=re.M)
    text = re.sub(r"\d+\.\d ms", "N ms", re.sub(r"\d+\.\d s old", "N s old", text))
    text = re.sub(r"timeout_ms = \d+", "timeout_ms = N", text)
    return re.sub(r"bus \w+ \(modbus_rtu, [^,]+,", "bus (modbus_rtu,", text).splitlines()


def test_the_output_in_the_documentation_is_what_is_printed(simulate, tmp_path):
    text = (SOURCE / "docs" / "commissioning.md").read_text()
    shown = next(block for block in text.split("```") if block.startswith("\n  device"))
    simulator = simulate(MACHINE)
    path = configuration(tmp_path, bus(simulator, "modbus_rtu", timeout_ms=3000.0), DEVICES,
                         SENSORS)
    done = thermocomp("scan", path, "--find", "--units", "3-5")
    printed, part = without_figures(done.stdout), without_figures(shown.lstrip("\n"))
    assert part == printed[printed.index(part[0]):][:len(part)], done.stdout


def test_a_search_finds_answering_units_and_reports_its_requests(simulate, tmp_path):
    simulator = simulate(MACHINE)
    sensors = [("spindle", {"device": "spindle_module", "address": 0})]
    devices = DEVICES[DEVICES.index('[[device]]\nname = "spindle_module"'):]
    path = configuration(tmp_path, bus(simulator, "modbus_rtu", timeout_ms=1500.0), devices,
                         sensors)
    done = thermocomp("scan", path, "--find", "--units", "3-5")
    assert "asking units 3 to 5" in done.stderr and "one request each" in done.stderr
    assert "3, 4 answer; not in the configuration: 3, 4" in done.stdout, done.stdout


def test_a_bus_that_cannot_be_opened_and_a_name_that_is_none(simulate, tmp_path):
    simulator = simulate(MACHINE)
    sensors = [("bed", {"device": "bed_module", "address": 0})]
    devices = table("[[device]]", name="bed_module", bus="bus", unit=4, table="input",
                    encoding="int16", scale=0.1)
    nobody = bus(simulator, "modbus_rtu", device=str(tmp_path / "nothing"))
    path = configuration(tmp_path, nobody, devices, sensors)
    report, seen = scan(path)
    assert "No such file" in report["buses"][0]["error"]
    assert seen["bed"]["fault"] == "no_answer"
    for arguments, output in (([path, "--bus", "other"], "other: no such bus in"),
                              ([path, "--units", "9-3"], "9-3"),
                              ([tmp_path / "none.toml"], "none.toml")):
        done = thermocomp("scan", *arguments)
        assert done.returncode == 2 and output in done.stderr, done.stderr


def test_a_line_that_the_daemon_reads_is_left_alone(simulate, tmp_path):
    simulator = simulate(MACHINE)
    sensors = [("bed", {"device": "bed_module", "address": 0})]
    devices = table("[[device]]", name="bed_module", bus="bus", unit=4, table="input",
                    encoding="int16", scale=0.1)
    path = configuration(tmp_path, bus(simulator, "modbus_rtu", timeout_ms=10000.0), devices,
                         sensors)
    extra = (f'state_file = "{tmp_path}/state.json"\n[history]\nenabled = false\n'
             f'[socket]\npath = "{tmp_path}/s"\n')
    text = path.read_text().replace("format = 1\n", "format = 1\n" + extra.split("[", 1)[0], 1)
    path.write_text(text + "[" + extra.split("[", 1)[1])
    with open(tmp_path / "daemon.log", "w", encoding="utf-8") as log:
        daemon = subprocess.Popen([str(BIN / "thermocompd"), str(path)], stdout=log, stderr=log)
    try:
        def held():
            assert daemon.poll() is None, (tmp_path / "daemon.log").read_text()
            report, _ = scan(path)
            return report["buses"][0]["error"]
        error = eventually(held, "the daemon opens its line")
        assert f"thermocompd (process {daemon.pid})" in error and "two masters" in error
    finally:
        daemon.terminate()
        daemon.wait(timeout=60)
    report, seen = scan(path)
    assert report["good"] == 1, seen


def test_a_preset_that_is_wrong_is_named_by_file_line_key_and_rule(tmp_path):
    folder = tmp_path / "devices"
    folder.mkdir()
    (folder / "mine.toml").write_text(
        'format = 1\nmaker = "x"\nmodel = "y"\nprotocol = "modbus"\ndocument = "d"\n'
        'section = "s"\nchannel = [{ channel = 1, address = 70000 }]\n[device]\n'
        'table = "input"\nencoding = "int16"\nscal = 0.1\n')
    devices = table("[[device]]", name="m", bus="bus", unit=4, preset="mine")
    text = table("[[bus]]", name="bus", kind="modbus_tcp", host="127.0.0.1")
    path = configuration(tmp_path, text, devices, [("bed", {"device": "m", "channel": 1})])
    done = thermocomp("check", path)
    assert done.returncode == 2
    assert f"{folder}/mine.toml:7: channel[1].address = 70000: must be" in done.stderr
    assert f'{folder}/mine.toml:11: device.scal = 0.1: unknown key; did you mean "scale"?' in (
        done.stderr)
    path = configuration(tmp_path, text, devices, [("bed", {"device": "m", "channel": 2})])
    assert "sensor[bed].channel = 2: must be a channel of the preset: 1" in thermocomp(
        "check", path).stderr
