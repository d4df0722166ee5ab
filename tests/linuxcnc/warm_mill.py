"""The simulated mill: thermocomp-sim warms it and serves its thermocouples over Modbus, thermocompd
compensates it, and a real LinuxCNC is its controller."""

import contextlib
import pathlib
import shutil
import tempfile
import time

from cnc import AXES, LinuxCnc
from lab import Lab, eventually

ROOM_degC = 21.0
UM_PER_K = {"x": -3.0, "y": 2.0, "z": 2.5}  # displacement per column rise; offset: the negative
STEADY_K = 10.0
FOLLOWS_um = 1.0  # required accuracy

MACHINE = """format = 1
[plant]
[[signal]]
name = "spindle_rpm"
kind = "steps"
times_s = [{times}]
values = [{values}]
repeat_s = {repeat_s}
[room]
mean_degC = 21.0
[[output]]
name = "z_um"
[[node]]
name = "column"
capacity_J_per_K = 10e3
room_W_per_K = 10.0
displacement_um_per_K = {{ z_um = 2.5 }}
[[source]]
node = "column"
signal = "spindle_rpm"
heat_W = 100.0
at = 6000.0
[[thermocouple]]
name = "column"
node = "column"
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
port = 0
[[device]]
name = "module"
bus = "cabinet"
unit = 1
encoding = "float32"
[[channel]]
name = "column"
device = "module"
address = 0
"""
# Warms to 10 K above ambient and stays there; or cycles for ever.
STEADY = MACHINE.format(times="0", values="6000", repeat_s=1e6)
SWINGING = MACHINE.format(times="0, 500", values="6000, 0", repeat_s=1000)

MODEL = f"""format = 1
inputs = ["column_degC"]
outputs = ["x_um", "y_um", "z_um"]
reference = [{ROOM_degC}]
matrix_um_per_K = [[{UM_PER_K["x"]}], [{UM_PER_K["y"]}], [{UM_PER_K["z"]}]]
"""
CONFIG = """format = 1
@STATE@
[loop]
rate_hz = 100
[model]
file = "model.toml"
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
host = "127.0.0.1"
port = @PORT@
timeout_ms = 1000
reconnect_s = 0.2
[[device]]
name = "module"
bus = "cabinet"
unit = 1
period_s = 0.02
table = "input"
encoding = "float32"
[[sensor]]
name = "column"
device = "module"
address = 0
[screening]
settle_s = 0.0
stale_after_s = 1.0
rate_K_per_s_max = 100.0
[smoothing]
form = "off"
[[block]]
name = "column"
input = "column_degC"
sensors = ["column"]
[controller]
name = "mill"
kind = "linuxcnc"
silent_after_s = @SILENT@
""" + "".join(f'[[controller.signal]]\nname = "{name}"\n' for name in
              ("x_mm", "y_mm", "z_mm", "spindle_rpm", "coolant_on", "cutting_on", "enabled_on",
               "homed_on")) + "".join(
    f'[[axis]]\nname = "{a}"\noutput = "{a}_um"\noffset_um_max = 100.0\n'
    "rate_um_per_s_max = @RATE@\n" for a in AXES) + """[compensation]
enabled_at_first_start = true
cutting_signal = "cutting_on"
mismatch_um = 5.0
controller_stale_after_s = 5.0
[history]
@HISTORY@
commit_s = 1.0
"""


def expected_um(axis):
    return -UM_PER_K[axis] * STEADY_K


class WarmMill:
    """LinuxCNC, daemon and simulator. The daemon's socket is visible in LinuxCNC's namespaces."""

    def __init__(self, way, machine, time_factor, rate_um_per_s, silent_after_s,
                 unit_mm=1.0):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="tc"))
        self.folder.chmod(0o755)
        (self.folder / "cnc").mkdir()
        (self.folder / "daemon").mkdir()
        self.lab = Lab(self.folder / "daemon")
        shutil.rmtree(self.lab.sockets)
        self.lab.sockets = self.folder / "cnc" / "run"
        self.lab.sockets.mkdir()
        self.simulator = self.lab.simulator(machine, "--time-factor", time_factor)
        (self.lab.folder / "model.toml").write_text(MODEL)
        config = CONFIG
        for key, value in (("@PORT@", self.simulator.ready["ports"]["cabinet"]),
                           ("@RATE@", float(rate_um_per_s)), ("@SILENT@", float(silent_after_s))):
            config = config.replace(key, str(value))
        self.daemon = self.lab.daemon(config)
        # LinuxCNC runs as user nobody: only its group lets it report.
        with self.daemon.config.open("a") as config:
            config.write('bridge_group = "nogroup"\n')
        self.cnc = LinuxCnc(self.folder / "cnc", way, "/mnt/run/status.sock", unit_mm)

    def close(self):
        try:
            if self.cnc.process is not None and self.cnc.process.poll() is None:
                with contextlib.suppress(OSError, AssertionError):
                    self.cnc.quit()
        finally:
            if self.cnc.process is not None and self.cnc.process.poll() is None:
                self.cnc.process.kill()
                self.cnc.process.wait()
            self.lab.end()
            shutil.rmtree(self.folder, ignore_errors=True)

    def drives_mm(self):
        drives = self.cnc.pins(*(f"drive-{a}.out" for a in AXES))
        return {a: self.cnc.unit_mm * at for a, at in zip(AXES, drives)}

    def settled(self, tolerance_um=0.2):
        """The status of the axes if the daemon compensates and LinuxCNC applies the wanted offsets,
        else nothing."""
        status = self.daemon.status()
        axes = {axis["name"]: axis for axis in status["axes"]}
        good = status["mode"] == "compensating" and all(
            axis["driven"] and None not in (axis["applied"], axis["target"]) and
            abs(axis["applied"] - axis["target"]) <= tolerance_um for axis in axes.values())
        return axes if good else None

    def in_step(self):
        return eventually(self.settled, "LinuxCNC applies what the daemon wants")

    def errors_um(self, **target_mm):
        """Moves to an absolute position: drive less command less wanted offset per axis, and the
        axes' status."""
        self.cnc.mdi("G21 G53 G0 " + " ".join(f"{a.upper()}{mm}" for a, mm in target_mm.items()))
        return self.errors_here_um(**target_mm)

    def errors_here_um(self, **target_mm):
        def look():
            # Drives and daemon are queried in turn: the offsets must not change meanwhile.
            before = self.settled()
            time.sleep(0.15)  # longer than the daemon's report and the bridge's exchange
            drives = self.drives_mm()
            time.sleep(0.15)
            after = self.settled()
            if not before or not after:
                return None
            if any(abs(before[a]["offset"] - after[a]["offset"]) > 0.05 for a in AXES):
                return None
            return ({a: 1000.0 * (drives[a] - mm) - after[a]["offset"]
                     for a, mm in target_mm.items()}, after)
        return eventually(look, "everything stands still")


def largest(errors_um):
    return max(abs(error) for error in errors_um.values())
