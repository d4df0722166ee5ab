"""`thermocomp init`: from other projects' devices to a compensating daemon, without manual edits."""
import json
import contextlib
import os
import pathlib
import pty
import select
import signal
import socket
import subprocess
import sys
import time

import pytest
from conftest import PROGRAM, SOURCE, run

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))
from lab import eventually, free_port  # noqa: E402

HERE = pathlib.Path(__file__).parent
DAEMON = pathlib.Path(PROGRAM).parent / "thermocompd"
PATIENCE_S = 60.0
NAMES = "bed column spindle"


def listens(port):
    with contextlib.suppress(OSError):
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
        return True
    return False


@pytest.fixture(scope="module")
def machine():
    """Ports: modules, PLC, the modules behind a gateway."""
    ports = free_port(), free_port(), free_port()
    machine = subprocess.Popen([sys.executable, HERE / "foreign_machine.py", *map(str, ports)],
                               stderr=subprocess.DEVNULL)
    eventually(lambda: all(map(listens, ports)), "the devices listen")
    yield ports
    machine.kill()
    machine.wait(PATIENCE_S)


@pytest.fixture
def foreign(machine):
    """A search for units gets an answer for each number."""
    return machine[2], machine[1]


@pytest.fixture
def silent(machine):
    """A search for units waits for each number without a unit."""
    return machine[0], machine[1]


@pytest.fixture
def folder(tmp_path):
    """A short path, since it contains the socket; with the presets next to the configuration."""
    (tmp_path / "devices").symlink_to(SOURCE / "config" / "devices")
    return tmp_path


def converse(arguments, answers):
    """Runs thermocomp on a terminal and answers each question; (exit status, all output)."""
    ours, theirs = pty.openpty()
    program = subprocess.Popen([PROGRAM, *map(str, arguments)], stdin=theirs, stdout=theirs,
                               stderr=theirs)
    os.close(theirs)
    shown, waiting, end = "", list(answers), time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if not select.select([ours], [], [], 0.5)[0]:
            continue
        try:
            shown += os.read(ours, 4096).decode()
        except OSError:  # it has ended
            break
        if shown.endswith(": "):
            assert waiting, "one more question:\n" + shown
            answer = waiting.pop(0)
            os.write(ours, answer.encode() + b"\n")
    assert program.wait(PATIENCE_S) is not None
    os.close(ours)
    assert not waiting, (waiting, shown)
    return program.returncode, shown


@contextlib.contextmanager
def running(config):
    log = (config.parent / "log").open("w")
    daemon = subprocess.Popen([DAEMON, config], stdout=log, stderr=log)
    try:
        eventually(lambda: "ready: " in (config.parent / "log").read_text(), "the daemon is ready")
        yield
    finally:
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(PATIENCE_S) == 0


def assert_in_this_order(shown, *steps):
    """The next steps, in the order of docs/first_machine.md and the README."""
    places = [shown.find(step, shown.index("Next:")) for step in steps]
    assert -1 not in places and places == sorted(places), (steps, places, shown)


def assert_runs(config):
    """Without edits: check, start, enable. Init's model of zeros must report that a fitted one is missing."""
    answer = run("check", config)
    assert answer.returncode == 0, answer.stderr
    sock = config.parent / "status.sock"

    def status():
        return run("--socket", sock, "status").stdout

    with running(config):
        eventually(lambda: "disabled" in status() or "switched off" in status(), "it waits")
        assert run("--socket", sock, "enable").returncode == 0
        eventually(lambda: json.loads(run("--socket", sock, "status", "--json").stdout)["mode"] == "compensating",
                   "it runs")
        assert "no (the model gives no displacement" in status() and "fit one to measured runs" in status()


def test_invalid_answers_and_searches_for_presets(foreign, folder):
    modules, plc = foreign
    answers = [f"tcp:127.0.0.1:{modules}", "?pt100", "",  # no such host
               "?pt100", "?rtd", "wago_750_458", NAMES, "holding:float32/CDAB:1:100,102", "",
               f"tcp:127.0.0.1:{plc}", "yes", "none", "spindle", "z"]
    status, shown = converse(["init", folder / "thermocompd.toml"], answers)
    assert status == 0, shown
    assert '"?pt100" is not a host' in shown and "spindle: must be an axis" in shown
    lists = [part.split("Module of")[0].split("\n", 1)[1]
             for part in shown.split("presets:")[1:3]]
    assert lists[0] == lists[1] and "pt100" in lists[0].lower() and "rtd" in lists[0].lower()


def test_interview_on_a_terminal(silent, folder):
    modules, plc = silent
    config = folder / "thermocompd.toml"
    answers = [f"tcp:127.0.0.1:{modules}", "",  # one bus
               "wago_750_458", NAMES,
               "holding:float32/CDAB:1:100,102", "",
               f"tcp:127.0.0.1:{plc}", "yes", "spindle_rpm=input:26:uint16", "z"]
    begun = time.monotonic()
    status, shown = converse(["init", config], answers)
    assert status == 0, shown
    assert "channel 1: 20.10 degC" in shown and "channel 3: open_circuit" in shown
    assert f"5 sensors, {len(answers)} questions" in shown
    text = config.read_text()
    assert 'preset = "wago_750_458"' in text and 'name = "spindle"\ndevice = "module1"\nchannel = 5' in text
    assert text.count("[[block]]") == 5
    assert_runs(config)
    print(f"{len(answers)} questions, 0 edits, {time.monotonic() - begun:.1f} s until it runs")


def test_nothing_answered_is_lost_to_a_mistake_or_a_step_back(foreign, folder):
    """From init to a scan without complaints: 3 commands and no edit."""
    modules, plc = foreign
    config = folder / "thermocompd.toml"
    bus = f"tcp:127.0.0.1:{modules}"
    answers = [bus, f"udp:127.0.0.1:{free_port()}", "",  # a bus that finally has no module
               "?Wago", "wago_750", "wago_750_458", "bed bed spindle", NAMES,
               "holding:float32:1:100,102", "yes",  # offered: low word first
               "ram table", "<", "ram bed", "ram slide",
               "1", "",  # on the second bus: left out
               f"tcp:127.0.0.1:{plc}", "yes", "spindle_rpm=input:26:uint16 feed_mm_per_min=input:6:uint16",
               "Z"]
    status, shown = converse(["init", config], answers)
    assert status == 0, shown
    for output in ("    wago_750_464: WAGO, 750-464, two or four RTD", "wago_750 is not a preset",
                   "bed: the names of sensors must be unique",
                   f"Module of unit 4 on bus1 (127.0.0.1:{modules})", "In word order CDAB all give",
                   "is left out: it has no module"):
        assert output in shown, (output, shown)
    assert "pixsys" not in shown  # does not match "Wago"
    text = config.read_text()
    assert text.count('\n[[bus]]\n') == 1 and 'word_order = "CDAB"' in text
    assert "gap_registers_max = 0 " in text  # the PLC refuses a common read of inputs 0 to 6
    assert 'name = "Z"\noutput = "z_um"' in text
    for command in ("check", "scan"):
        answer = run(command, config)
        assert answer.returncode == 0, answer.stdout + answer.stderr
    print(f"3 commands, {len(answers)} answers, 0 edits")


def test_by_options_without_a_terminal(foreign, folder):
    modules, plc = foreign
    config = folder / "thermocompd.toml"
    arguments = ["init", config, "--bus", f"tcp:127.0.0.1:{modules}", "--module", "3=wago_750_458",
                 "--names", "bed,column,spindle", "--controller", f"tcp:127.0.0.1:{plc}@1",
                 "--axes", "z"]
    answer = run(*arguments)
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert_in_this_order(answer.stdout, " check ", "thermocompd ", " sensors ", " prove z 5 ",
                         "gives no displacement yet", " reference ", " enable\n")
    assert_runs(config)
    before = config.read_text()
    answer = run(*arguments)
    assert answer.returncode == 2 and "--force" in answer.stderr
    assert config.read_text() == before
    assert run(*arguments, "--force").returncode == 0
    assert (folder / "thermocompd.toml.old").read_text() == before
    assert (folder / "model.toml.old").exists()
    arguments[5] = "bus1/" + arguments[5]  # as named by the configuration
    assert run(*arguments, "--force").returncode == 0
    assert config.read_text() == before


def test_a_model_that_is_there_is_bound_by_the_sensors_names(foreign, folder):
    modules, plc = foreign
    (folder / "mill.toml").write_text(
        'format = 1\ninputs = ["bed_degC", "spindle_degC"]\noutputs = ["y_um", "z_um"]\n'
        'reference = "first_sample"\nmatrix_um_per_K = [[1.0, 2.0], [3.0, 4.0]]\n')
    config = folder / "thermocompd.toml"
    arguments = ["init", config, "--bus", f"tcp:127.0.0.1:{modules}", "--module",
                 "3=wago_750_458", "--controller", f"tcp:127.0.0.1:{plc}", "--model",
                 folder / "mill.toml"]
    answer = run(*arguments, "--names", "bed,column,spindle")
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert_in_this_order(answer.stdout, " sensors ", " prove ", " reference ", " enable\n")
    assert "no displacement yet" not in answer.stdout
    text = config.read_text()
    assert text.count("[[block]]") == 2 and 'output = "y_um"' in text
    assert "in no block: column" in run("check", config).stdout


def test_missing_signals_and_names_are_requested(foreign, folder):
    modules, plc = foreign
    (folder / "mill.toml").write_text(
        'format = 1\ninputs = ["bed_degC"]\noutputs = ["z_um"]\nreference = "first_sample"\n'
        'matrix_um_per_K = [[1.0]]\n[[term]]\nkind = "speed_growth"\nsubject = "spindle_rpm"\n'
        'gain_um_per_unit2 = { z_um = 1e-7 }\n')
    config = folder / "thermocompd.toml"
    arguments = ["init", config, "--bus", f"tcp:127.0.0.1:{modules}", "--module",
                 "3=wago_750_458:1-2", "--model", folder / "mill.toml"]
    plc_there = ["--controller", f"tcp:127.0.0.1:{plc}"]
    for more, output in ((["--names", "bed,x", "--controller", "none"], "give it by --controller"),
                         (["--names", "bed,x", *plc_there], "--signal spindle_rpm=TABLE:ADDRESS"),
                         (["--names", "x", *plc_there, "--signal", "spindle_rpm=input:26:uint16"],
                          "1 names for 2 sensors: m3_1 m3_2"),
                         (["--names", "x,y", *plc_there, "--signal", "spindle_rpm=input:26:uint16"],
                          "name a sensor bed (--names)")):
        answer = run(*arguments, *more)
        assert answer.returncode == 2 and output in answer.stderr, answer.stdout + answer.stderr
        assert answer.stderr.count("\n") - answer.stderr.count("reading") <= 1, answer.stderr
        assert not config.exists()
    status, shown = converse([*arguments, "--names", "bed,x"], ["bed column", f"tcp:127.0.0.1:{plc}", "yes", "none",
                                         "spindle_rpm=input:26:uint16"][1:])
    assert "(the model needs spindle_rpm)" in shown and "the model needs spindle_rpm\r" in shown


def test_the_code_of_an_open_circuit_is_taken_without_an_edit(foreign, folder):
    modules, plc = foreign
    config = folder / "thermocompd.toml"
    answer = run("init", config, "--bus", f"tcp:127.0.0.1:{modules}", "--module",
                 "3=input:int16:0.1:0-2:0x7FFF,-9999,0x8000", "--names", "bed,column,table",
                 "--controller", f"tcp:127.0.0.1:{plc}", "--axes", "z")
    assert answer.returncode == 1, answer.stdout + answer.stderr  # the third channel is open
    assert "open_circuit" in answer.stdout and "the device's code for it" in answer.stdout
    assert "\nopen_circuit_codes = [32767, -9999, 32768]" in config.read_text()


def test_a_code_that_a_channel_shows_is_written_down(foreign, folder):
    modules, plc = foreign
    config = folder / "thermocompd.toml"
    status, shown = converse(["init", config], [
        f"tcp:127.0.0.1:{modules}", "", "input:int16:0.1:0-4", NAMES, "",
        f"tcp:127.0.0.1:{plc}", "yes", "none", "z"])
    assert status == 0, shown
    assert "open_circuit_codes: 32767 is written down as one" in shown
    assert "\nopen_circuit_codes = [32767]" in config.read_text()


def test_a_dry_run_from_the_first_start_on(foreign, folder):
    modules, plc = foreign
    config = folder / "thermocompd.toml"
    arguments = ["init", config, "--bus", f"tcp:127.0.0.1:{modules}", "--module",
                 "3=wago_750_458", "--controller", f"tcp:127.0.0.1:{plc}", "--axes", "z"]
    answer = run(*arguments, "--dry-run")
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert_in_this_order(answer.stdout, " sensors ", "gives no displacement yet", " disable\n",
                         "dry_run = false in ", " prove z 5 ", " reference ", " enable\n")
    with running(config):
        shown = run("--socket", config.parent / "status.sock", "status")
        assert shown.returncode == 1 and "DRY RUN" in shown.stdout
        assert "switch it off before the dry run ends" in shown.stdout
        enabled = run("--socket", config.parent / "status.sock", "enable")
        assert enabled.returncode == 0 and "thermocomp disable before" in enabled.stdout
    run(*arguments, "--force")
    assert "\n# dry_run = true" in config.read_text()


def test_missing_options_are_named(foreign, folder):
    _, plc = foreign
    config = folder / "thermocompd.toml"
    answer = run("init", config, "--bus", f"tcp:127.0.0.1:{free_port()}", "--module",
                 "3=wago_750_458:1-2", "--controller", f"tcp:127.0.0.1:{plc}", "--axes", "z")
    assert answer.returncode == 1, answer.stdout + answer.stderr
    assert "Not everything answers yet" in answer.stdout
    assert run("check", config).returncode == 0
    answer = run("init", folder / "other" / "c.toml", "--axes", "z", stdin=subprocess.DEVNULL)
    assert answer.returncode == 2
    assert answer.stderr.rstrip().endswith("missing: --bus --module --controller")


def test_no_scan_looks_at_no_bus_while_it_asks(folder):
    config = folder / "thermocompd.toml"
    with socket.create_server(("127.0.0.1", 0)) as device:
        bus = f"tcp:127.0.0.1:{device.getsockname()[1]}"
        status, shown = converse(["init", config, "--no-scan", "--controller", "none", "--axes", "z"],
                                 [bus, "", "3", "wago_750_458", "wago_750_458:1-2", "bed column"])
        device.setblocking(False)
        with pytest.raises(BlockingIOError):
            device.accept()
    assert status == 0, shown
    assert "Units of the modules on" in shown and "No unit answers" not in shown
    assert "with --no-scan the channels must be named" in shown
    assert run("check", config).returncode == 0


@pytest.mark.parametrize("option, value, named", [
    ("--bus", "tcp:", "tcp:HOST"), ("--bus", "rtu:/dev/x:0", "baud"),
    ("--bus", "rtu:/dev/x:9600:maybe", "parity"), ("--bus", "tcp:h:99999", "port"),
    ("--module", "3", "UNIT="), ("--module", "3=", "preset"), ("--module", "9/3=wago_750_458", "bus 9"),
    ("--module", "3=input:int16:0.1", "ADDRESSES"), ("--module", "3=input:int12:0.1:0", "type"),
    ("--module", "3=input:int16:0:0", "count"), ("--module", "3=input:int16:1:0:no", "codes"),
    ("--module", "3=input:int16:1:0:1:1", "CODES"), ("--module", "3=wago_750_458:4-1", "ranges"),
    ("--controller", "tcp:h@x", "unit"), ("--signal", "x", "NAME="),
    ("--signal", "x=coil:0:int16", "TABLE:ADDRESS"), ("--offset", "disc:0", "holding")])
def test_a_usage_error_is_one_line(folder, option, value, named):
    answer = run("init", folder / "c.toml", "--bus", "tcp:127.0.0.1:9", option, value,
                 stdin=subprocess.DEVNULL)
    assert answer.returncode == 2, answer.stdout
    assert answer.stderr.count("\n") == 1 and named in answer.stderr, answer.stderr
    assert not list(folder.glob("*.toml")) and not list(folder.glob(".thermocomp*"))
