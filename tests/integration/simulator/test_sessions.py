"""Time factor, replay, row log, ready line, and refused arguments."""

import csv
import json
import struct
import subprocess
import time

import pytest

from conftest import BIN, PATIENCE_S, ask, eventually, read_request
from test_devices import MACHINE

REPLAY = """
format = 1
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
[[device]]
name = "module"
bus = "cabinet"
unit = 1
encoding = "int32"
scale = 0.001
open_circuit_codes = [2147483647]
[[channel]]
name = "t1"
device = "module"
address = 0
[[channel]]
name = "t2"
device = "module"
address = 2
"""


def run_file(folder, rows):
    path = folder / "run.csv"
    path.write_text("time_s,t1_degC,t2_degC,z_um\n" +
                    "".join(f"{10 * i},{i}.5,{100 - i},{i}\n" for i in range(rows)))
    return path


def both(link):
    return struct.unpack(">2i", ask(link, 1, read_request(4, 0, 4))[2:])


def test_all_registers_of_a_row_change_together_and_are_logged(simulate, tmp_path):
    log = tmp_path / "rows.csv"
    before = time.monotonic_ns()
    simulator = simulate(REPLAY, "--replay", run_file(tmp_path, 60), "--row-period-ms", 20,
                         "--rows", "5:45", "--row-log", log, "--settle-s", 0.3)
    link = simulator.connect("cabinet")
    seen = []  # (row, before request, after answer)
    try:
        while True:
            asked = time.monotonic_ns()
            first, second = both(link)
            seen.append(((first - 500) // 1000, asked, time.monotonic_ns()))
            assert second == 100000 - (first - 500)
    except (EOFError, OSError):
        pass
    lines = simulator.process.communicate(timeout=PATIENCE_S)[0].splitlines()
    assert simulator.process.returncode == 0
    # z_um is the row's index: the root of the mean of 0, 1, 4, ... 39^2
    assert lines[-1] == "error rms at the tool: uncompensated 22.66 um, compensated 22.66 um"
    rows = [(int(row["row"]), int(row["monotonic_ns"])) for row in csv.DictReader(log.open())]
    assert [row for row, _ in rows] == list(range(5, 45))
    times = [when for _, when in rows]
    assert times[0] > before and times == sorted(times)
    visible = dict(rows)
    assert {row for row, _, _ in seen} <= set(visible)
    for row, asked, answered in seen:
        assert answered > visible[row]  # never shown before it was logged as visible
        if row + 1 in visible:
            assert asked < visible[row + 1]


def test_a_missing_value_of_a_replayed_row_is_an_open_circuit(simulate, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time_s,t1_degC,t2_degC\n0,,1\n1,nan,2\n")
    simulator = simulate(REPLAY, "--replay", path, "--stay", "--time-factor", 1000)
    link = simulator.connect("cabinet")
    eventually(lambda: both(link) == (2147483647, 2000), "the last row, and it stays")
    assert simulator.alive()


def test_plant_time_goes_by_the_factor_and_ends_by_itself(simulate, tmp_path):
    truth = tmp_path / "truth.csv"
    machine = MACHINE.replace("capacity_J_per_K = 1000",
                              "capacity_J_per_K = 1000\nroom_W_per_K = 1")
    machine += '[[source]]\nnode = "spindle"\nsignal = "spindle_rpm"\nheat_W = 3\nat = 6000\n'
    simulator = simulate(machine, "--time-factor", 3600, "--duration", 1.0, "--truth", truth,
                         "--ports-file", tmp_path / "ports.json")
    assert json.loads((tmp_path / "ports.json").read_text()) == simulator.ready
    lines = simulator.process.communicate(timeout=PATIENCE_S)[0].splitlines()
    assert simulator.process.returncode == 0
    rows = list(csv.DictReader(truth.open()))
    assert [float(row["time_s"]) for row in rows] == [10.0 * i for i in range(361)]
    # 3 W against 1 W/K with 1000 s, 10 um/K
    assert float(rows[100]["z_um"]) == pytest.approx(30.0 * (1 - 2.718281828 ** -1), rel=1e-6)
    squares = [float(row["z_error_um"]) ** 2 for row in rows]
    rms = (sum(squares) / len(squares)) ** 0.5
    assert lines[-1] == (f"error rms at the tool: uncompensated {rms:.2f} um, "
                         f"compensated {rms:.2f} um")


def test_time_starts_with_the_heartbeat(simulate):
    machine = MACHINE.replace('name = "x_mm"\nkind = "steps"\ntimes_s = [0]\nvalues = [-123.456]',
                              'name = "x_mm"\nkind = "steps"\ntimes_s = [0, 0.1]\nvalues = [1, 2]')
    simulator = simulate(machine.replace("heartbeat_timeout_s = 0", "heartbeat_timeout_s = 2"),
                         "--start-on-heartbeat")
    link = simulator.connect("cnc")
    position = lambda: struct.unpack(">i", ask(link, 1, read_request(4, 20, 2))[2:])[0]
    time.sleep(0.4)
    assert position() == 1000
    for beat in (1, 2):
        ask(link, 1, struct.pack(">BHH", 6, 11, beat))
    eventually(lambda: position() == 2000, "time began")


def test_a_replay_waits_at_its_first_row_for_the_heartbeat(simulate, tmp_path):
    path = run_file(tmp_path, 4)
    machine = MACHINE[MACHINE.index("[[bus]]"):].replace("room_degC", "t1_degC")
    for signal in ("x_mm", "spindle_rpm"):
        machine = machine.replace(f'name = "{signal}"', f'name = "{signal}"\nvalue = 0')
    simulator = simulate("format = 1\n" + machine, "--replay", path, "--row-period-ms", 50,
                         "--start-on-heartbeat", "--stay")
    link = simulator.connect("cabinet")
    shown = lambda: struct.unpack(">h", ask(link, 3, read_request(4, 0, 1))[2:])[0]
    time.sleep(0.4)
    assert shown() == 50
    cnc = simulator.connect("cnc")
    for beat in (1, 2):
        ask(cnc, 1, struct.pack(">BHH", 6, 11, beat))
    eventually(lambda: shown() == 350, "the last row")


def test_ports_and_paths_can_be_given_on_the_command_line(simulate, tmp_path):
    simulator = simulate(MACHINE, "--port", "cabinet=0", "--port", "cnc=0",
                         "--path", "line=elsewhere/line")
    assert simulator.ready["paths"] == {"line": "elsewhere/line"}
    assert (tmp_path / "elsewhere" / "line").is_symlink()
    simulator.end()
    assert not (tmp_path / "elsewhere" / "line").is_symlink()


def test_a_can_bus_that_is_not_there_is_reported_and_the_rest_works(simulate):
    machine = MACHINE + """
[[bus]]
name = "body_can"
kind = "can"
interface = "no_such_can0"
"""
    simulator = simulate(machine.replace("[[device]]", "[[bus]]\nname = \"spare\"\n"
                                         "kind = \"modbus_tcp\"\n[[device]]", 1))
    assert "body_can" in simulator.ready["unavailable"]
    assert set(simulator.ready["ports"]) == {"cabinet", "spare", "cnc"}


def test_the_same_seed_gives_the_same_truth(simulate, tmp_path):
    noisy = MACHINE.replace('[[thermocouple]]\nname = "room"',
                            '[[thermocouple]]\nname = "noisy"\nnode = "spindle"\nnoise_K = 1\n'
                            '[[thermocouple]]\nname = "room"')
    texts = []
    for seed in (1, 1, 2):
        truth = tmp_path / "truth.csv"
        simulator = simulate(noisy, "--seed", seed, "--duration", 0.1, "--time-factor", 3600,
                             "--truth", truth)
        simulator.process.wait(timeout=PATIENCE_S)
        texts.append(truth.read_text())
    assert texts[0] == texts[1]
    assert texts[0] != texts[2]


@pytest.mark.parametrize("options, expected", [
    ([], "no [plant]"),
    (["--replay", "missing.csv"], "missing.csv"),
    (["--replay", "other.csv"], "has no column t2_degC, which t2 shows"),
    (["--replay", "run.csv", "--rows", "5"], "--rows"),
    (["--replay", "run.csv", "--rows", "5:5"], "--rows"),
    (["--replay", "run.csv", "--rows", "50:60"], "has rows 0:10"),
    (["--replay", "run.csv", "--row-log", "no/such/folder/log"], "cannot be written"),
    (["--replay", "run.csv", "--truth", "no/such/folder/truth"], "cannot be written"),
    (["--replay", "run.csv", "--port", "nobody=1"], "nobody"),
    (["--replay", "run.csv", "--port", "cabinet=99999"], "99999"),
    (["--rows", "1:2"], "--replay"),
    (["--replay", "run.csv", "--duration", "1"], "--duration"),
    (["--replay", "run.csv", "--row-period-ms", "1", "--time-factor", "2"], "--time-factor"),
    (["--time-factor", "0"], "--time-factor"),
    (["--time-factor", "nan"], "--time-factor"),
    (["--row-period-ms", "-1"], "--row-period-ms"),
    (["--unknown"], "--unknown"),
])
def test_a_usage_error_is_refused_with_its_reason(tmp_path, options, expected):
    (tmp_path / "machine.toml").write_text(REPLAY)
    (tmp_path / "other.csv").write_text("time_s,t1_degC\n0,1\n")
    run_file(tmp_path, 10)
    done = subprocess.run([str(BIN.resolve() / "thermocomp-sim"), "machine.toml", *options],
                          cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 2
    assert expected in done.stderr


def test_a_port_that_is_taken_and_a_link_that_is_a_file_are_refused(simulate, tmp_path):
    simulator = simulate(MACHINE)
    again = subprocess.run(
        [str(BIN.resolve() / "thermocomp-sim"), "machine.toml", "--path", "line=other_line",
         "--port", f"cabinet={simulator.port('cabinet')}"],
        cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert again.returncode == 2
    assert "cannot listen at 127.0.0.1" in again.stderr
    (tmp_path / "a_file").write_text("precious")
    again = subprocess.run(
        [str(BIN.resolve() / "thermocomp-sim"), "machine.toml", "--path", "line=a_file"],
        cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert again.returncode == 2
    assert "something other than a symbolic link" in again.stderr
    assert (tmp_path / "a_file").read_text() == "precious"


def test_help_suffices():
    done = subprocess.run([str(BIN / "thermocomp-sim"), "--help"], capture_output=True, text=True,
                          timeout=PATIENCE_S)
    assert done.returncode == 0
    for option in ("--time-factor", "--replay", "--row-log", "--truth", "--duration", "--seed"):
        assert option in done.stdout


