"""The installed service and a machine around it, inside the booted guest."""

import contextlib
import grp
import json
import os
import pathlib
import re
import socket
import sqlite3
import subprocess

from lab import eventually, free_port
from plain_devices import BLOCKS, MODEL, OVER_TCP, PlainController, PlainModule

UNIT = "thermocompd.service"
CONFIG = pathlib.Path("/etc/thermocomp/thermocompd.toml")
STATE = pathlib.Path("/var/lib/thermocomp")
HISTORY = STATE / "history.db"
SOCKET = pathlib.Path("/run/thermocomp/status.sock")
DROP_INS = pathlib.Path("/etc/systemd/system/thermocompd.service.d")
FILES = pathlib.Path("/opt/service-test")
SLEW_UM_PER_S = 2.0
ORDER_PERIOD_S = 0.02


def run(*command, check=True, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True,
                          timeout=120, stdin=subprocess.DEVNULL, **more)
    if check:
        assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done


def package(name):
    found, = FILES.glob(f"packages/{name}_*.deb")
    return found


def show(*names):
    """Properties of the unit; a single name: its value."""
    text = run("systemctl", "show", UNIT, "-p", ",".join(names)).stdout
    values = dict(line.split("=", 1) for line in text.splitlines() if "=" in line)
    return values[names[0]] if len(names) == 1 else values


def active():
    return show("ActiveState") == "active"


def main_pid():
    return int(show("MainPID"))


def restarts():
    return int(show("NRestarts"))


def journal(since=None):
    more = ["--since", since] if since else []
    return run("journalctl", "-u", UNIT, "--no-pager", "-o", "cat", *more).stdout


def drop_in(name, text):
    DROP_INS.mkdir(exist_ok=True)
    file = DROP_INS / f"{name}.conf"
    if text is None:
        file.unlink(missing_ok=True)
    else:
        file.write_text(text)
    run("systemctl", "daemon-reload")


def ask(method, **params):
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(20)
        link.connect(str(SOCKET))
        request = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params}
        link.sendall(json.dumps(request).encode() + b"\n")
        with link.makefile("r") as lines:
            answer = json.loads(lines.readline())
    assert "error" not in answer, answer
    return answer["result"]


def status():
    try:
        return ask("status")
    except OSError:
        return {"mode": "none", "axes": [{"offset": float("nan")}]}


def wait_for_mode(mode):
    return eventually(lambda: (now := status())["mode"] == mode and now, "mode " + mode)


def wait_for_offset(offset_um):
    try:
        eventually(lambda: abs(status()["axes"][0]["offset"] - offset_um) < 0.01, "the offset")
    except AssertionError as error:
        raise AssertionError(f"offset {offset_um} um was not reached: {status()}") from error


# Common to all configurations, whatever their buses.
COMMON = """format = 1
[loop]
rate_hz = 100
real_time = "require"
[model]
file = "model.toml"
""" + BLOCKS.format(stale_after_s=2.0) + """[history]
offsets_period_s = 0.01
commit_s = 0.2
"""
LIMITS = f"offset_um_max = 60.0\nrate_um_per_s_max = {SLEW_UM_PER_S}\n"
ENABLED = "[compensation]\nenabled_at_first_start = true\n"


def write_config(text):
    (CONFIG.parent / "model.toml").write_text(MODEL)
    CONFIG.write_text(text)


class Machine:
    """A thermocouple module and a controller on Modbus TCP, with their configuration."""

    def __init__(self):
        self.module = PlainModule(free_port())
        self.controller = PlainController(free_port())
        self.warm_by(0.0)

    def config(self, more=""):
        over_tcp = OVER_TCP.format(module=self.module.port, controller=self.controller.port)
        return (COMMON + over_tcp.replace("rate_um_per_s_max = 8.0",
                                          f"rate_um_per_s_max = {SLEW_UM_PER_S}") + ENABLED + more)

    def warm_by(self, offset_um):
        """Sets the column temperature for this offset, relative to the 20 degC of the reference."""
        self.module.show(20.0 - offset_um / 3.0, 20.0)

    def settled_at(self, offset_um):
        self.warm_by(offset_um)
        wait_for_offset(offset_um)
        eventually(lambda: abs(self.controller.applied_um() - offset_um) < 0.01, "applied")

    def orders_since(self, count):
        return self.controller.orders()[count:]

    def count(self):
        return len(self.controller.orders())

    def close(self):
        self.module.close()
        self.controller.close()


def largest_step_um(orders):
    return max(abs(b[1] - a[1]) for a, b in zip(orders, orders[1:]))


def assert_slewed(orders, slack_s=0.5):
    """Consecutive offsets differ by at most the slew limit; the slack covers a busy machine's delay
    between computing an offset and its arrival."""
    assert len(orders) > 1
    for (earlier_s, earlier), (later_s, later) in zip(orders, orders[1:]):
        allowed = SLEW_UM_PER_S * (later_s - earlier_s + slack_s) + 0.001
        assert abs(later - earlier) <= allowed, (earlier_s, earlier, later_s, later)


def thread_facts(pid):
    """{thread's name: (policy, priority)}; policy 1 is SCHED_FIFO."""
    facts = {}
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        fields = (task / "stat").read_text().rsplit(")", 1)[1].split()
        facts[(task / "comm").read_text().strip()] = (int(fields[38]), int(fields[37]))
    return facts


def process_fact(pid, name):
    text = pathlib.Path(f"/proc/{pid}/status").read_text()
    return re.search(rf"^{name}:\s*(.*)$", text, re.MULTILINE).group(1)


def stop_and_forget():
    """Like after an installation: nothing running, stored or configured."""
    run("systemctl", "stop", UNIT)
    run("systemctl", "reset-failed", UNIT, check=False)
    for file in STATE.iterdir():
        if file.is_file():
            file.unlink()


def start(mode="compensating"):
    run("systemctl", "start", UNIT)
    return wait_for_mode(mode)


def committed_chunks():
    with contextlib.closing(sqlite3.connect(HISTORY)) as base:
        return set(base.execute("SELECT segment, number, through_cycle, count, records FROM chunk"))


def recorded_spans():
    """[from, through] of each segment on CLOCK_MONOTONIC [s], oldest first."""
    with contextlib.closing(sqlite3.connect(HISTORY)) as base:
        return [(1e-9 * (start + period * first), 1e-9 * (start + period * last))
                for start, period, first, last in base.execute(
                    "SELECT grid_start_ns, period_ns, first_cycle, last_cycle FROM segment "
                    "ORDER BY id")]


def tree(*tops):
    """All paths below, with properties that change with them."""
    found = {}
    for top in tops:
        for folder, folders, files in os.walk(top):
            for name in folders + files:
                path = os.path.join(folder, name)
                found[path] = os.readlink(path) if os.path.islink(path) else ""
    return found


def exposure():
    """(figure, the whole table) of systemd-analyze security for the installed unit."""
    text = run("systemd-analyze", "security", UNIT, "--no-pager").stdout
    return float(re.search(r"exposure level for thermocompd.service: ([0-9.]+)", text).group(1)), text


LINE = """[[bus]]
name = "line"
kind = "modbus_rtu"
device = "/run/service-test-line"
baud = 19200
[[device]]
name = "module"
bus = "line"
unit = 7
encoding = "int16"
scale = 0.01
"""


@contextlib.contextmanager
def simulated_line():
    """thermocomp-sim with a module of two thermocouples; returns the serial line's device."""
    (FILES / "run.csv").write_text("time_s,column_degC,spindle_degC\n0,21,22\n1,21,22\n")
    machine = FILES / "machine.toml"
    machine.write_text("format = 1\n" + LINE + "".join(
        f'[[channel]]\nname = "{name}"\ndevice = "module"\naddress = {i}\n'
        for i, name in enumerate(("column", "spindle"))))
    process = subprocess.Popen(["thermocomp-sim", str(machine), "--replay", FILES / "run.csv",
                                "--stay"], stdout=subprocess.PIPE, text=True)
    try:
        ready = json.loads(process.stdout.readline())
        device = pathlib.Path(ready["paths"]["line"])
        # Like udev with a serial adapter.
        os.chown(device.resolve(), 0, grp.getgrnam("dialout").gr_gid)
        device.resolve().chmod(0o660)
        yield device
    finally:
        process.terminate()
        process.wait(20)


def serial_config(device):
    """A configuration with the sensors on that line; no offsets are sent."""
    sensors = "".join(f'[[sensor]]\nname = "{name}"\ndevice = "module"\naddress = {i}\n'
                      for i, name in enumerate(("column", "spindle")))
    line = LINE.replace("/run/service-test-line", str(device)).replace(
        "encoding", 'table = "input"\nencoding').replace("baud", 'parity = "none"\nbaud')
    return (COMMON + line + sensors + '[controller]\nname = "none"\nkind = "dry_run"\n'
            '[[axis]]\nname = "z"\noutput = "z_um"\n' + LIMITS + ENABLED)
