"""Common parts of the daemon's benchmarks: a machine on Modbus TCP and a daemon reading it."""

import json
import os
import pathlib
import socket
import subprocess
import time

SENSORS = 16


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def machine_toml(port):
    nodes = "".join(
        f'[[node]]\nname = "n{i}"\ncapacity_J_per_K = 1e4\nroom_W_per_K = 5.0\n'
        f'[[thermocouple]]\nname = "t{i}"\nnode = "n{i}"\nnoise_K = 0.05\n'
        for i in range(SENSORS))
    channels = "".join(
        f'[[channel]]\nname = "t{i}"\ndevice = "module"\ncolumn = "t{i}_degC"\naddress = {2 * i}\n'
        'table = "input"\nencoding = "float32"\n' for i in range(SENSORS))
    return ('format = 1\nseed = 1\n[plant]\n' + nodes +
            f'[[bus]]\nname = "cabinet"\nkind = "modbus_tcp"\nhost = "127.0.0.1"\nport = {port}\n'
            '[[device]]\nname = "module"\nbus = "cabinet"\nunit = 1\n' + channels)


def daemon_toml(port, rate_hz, history):
    sensors = "".join(f'[[sensor]]\nname = "t{i}"\ndevice = "module"\naddress = {2 * i}\n'
                      for i in range(SENSORS))
    blocks = "".join(f'[[block]]\nname = "b{i}"\ninput = "t{i}_degC"\nsensors = ["t{i}"]\n'
                     for i in range(SENSORS))
    axes = "".join(f'[[axis]]\nname = "{a}"\noutput = "{a}_um"\noffset_um_max = 50.0\n'
                   'rate_um_per_s_max = 1.0\n' for a in "xyz")
    return ('format = 1\nstate_file = "state.json"\n'
            f'[loop]\nrate_hz = {rate_hz}\npriority = 60\nreal_time = "require"\n'
            '[model]\nfile = "model.toml"\n'
            f'[[bus]]\nname = "cabinet"\nkind = "modbus_tcp"\nhost = "127.0.0.1"\nport = {port}\n'
            '[[device]]\nname = "module"\nbus = "cabinet"\nunit = 1\nperiod_s = 1.0\n'
            'table = "input"\nencoding = "float32"\n' + sensors + blocks +
            '[controller]\nname = "none"\nkind = "dry_run"\n' + axes +
            '[compensation]\nenabled_at_first_start = true\n'
            f'[history]\nenabled = {str(history).lower()}\nfile = "history.db"\n'
            '[socket]\npath = "status.sock"\n')


def model_toml():
    inputs = ", ".join(f'"t{i}_degC"' for i in range(SENSORS))
    rows = ",\n".join("  [" + ", ".join("1.0" for _ in range(SENSORS)) + "]" for _ in "xyz")
    return (f'format = 1\ninputs = [{inputs}]\noutputs = ["x_um", "y_um", "z_um"]\n'
            f'reference = "first_sample"\nmatrix_um_per_K = [\n{rows}\n]\n')


class Machine:
    """A simulated machine with 16 thermocouples on one Modbus TCP unit."""

    def __init__(self, programs, folder):
        self.port = free_port()
        path = pathlib.Path(folder) / "machine.toml"
        path.write_text(machine_toml(self.port))
        self.process = subprocess.Popen([programs / "thermocomp-sim", path],
                                        stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        if '"ready":true' not in line.replace(" ", ""):
            raise SystemExit("the simulated machine did not start")

    def stop(self):
        self.process.terminate()
        self.process.wait(10)


class Daemon:
    def __init__(self, programs, folder, port, rate_hz, history=True):
        self.folder = pathlib.Path(folder)
        (self.folder / "model.toml").write_text(model_toml())
        (self.folder / "daemon.toml").write_text(daemon_toml(port, rate_hz, history))
        self.process = subprocess.Popen([programs / "thermocompd", "daemon.toml"], cwd=self.folder,
                                        stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 20
        while self.call("status").get("mode") != "dry_run":  # the mode of its controller
            if time.monotonic() > deadline or self.process.poll() is not None:
                raise SystemExit("the daemon does not compensate")
            time.sleep(0.1)

    def call(self, method):
        path = os.path.relpath(self.folder / "status.sock")
        try:
            with socket.socket(socket.AF_UNIX) as client:
                client.settimeout(5)
                client.connect(path)
                client.sendall(json.dumps({"jsonrpc": "2.0", "id": 1, "method": method}).encode() +
                               b"\n")
                answer = client.makefile().readline()
            return json.loads(answer).get("result", {})
        except (OSError, ValueError):
            return {}

    def stop(self):
        self.process.terminate()
        self.process.wait(10)
