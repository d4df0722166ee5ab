"""The attacked thermocompd: process, files, socket."""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import time

from lab import PATIENCE_S, Refused, call

WATCHDOG_S = 5.0  # WatchdogSec of thermocompd.service


def eventually(check, patience_s=PATIENCE_S):
    """Polls check() until it is true; returns its last value."""
    end = time.monotonic() + patience_s
    while True:
        value = check()
        if value or time.monotonic() > end:
            return value
        time.sleep(0.02)


class Daemon:
    """A thermocompd process with its files in `folder`."""

    def __init__(self, rig, folder, socket, unit=1, **other):
        self.rig = rig
        self.folder = folder
        folder.mkdir(exist_ok=True)
        self.socket = socket
        self.config = folder / "thermocompd.toml"
        self.history = folder / "history.db"
        self.state = folder / "state.json"
        self.log = folder / "thermocompd.log"
        self.unit = unit
        self.other = other
        self.process = None
        self.ends_expected = False
        self.running = []  # [from, until or None]: the watchdog must be fed
        self.environment = {}
        self.write_config()

    def write_config(self, **other):
        self.other |= other
        text = self.rig.machine.config(self.folder, self.socket, unit=self.unit, **self.other)
        model = self.folder / "model.toml"
        if not model.exists():
            shutil.copy(self.rig.machine.folder / "model.toml", model)
        self.config.write_text(text)
        return text

    def start(self, may_refuse=False):
        """Starts it and waits until it is ready; False if it ends first."""
        self.rig.manager.ready.clear()
        environment = os.environ | {"NOTIFY_SOCKET": str(self.rig.manager.path),
                                    "WATCHDOG_USEC": str(int(1e6 * WATCHDOG_S))}
        environment |= self.environment
        command = [str(self.rig.bin / "thermocompd"), str(self.config)]
        self.ends_expected = may_refuse
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log,
                                            stderr=log, cwd=self.folder, env=environment)
        ready = eventually(lambda: self.rig.manager.ready.is_set() or not self.alive())
        if not (ready and self.alive()):
            if not self.alive() and self.process.returncode not in (1, 2):
                self.ends_expected = False
            return False
        self.ends_expected = False
        self.running.append([time.monotonic(), None])
        return True

    def alive(self):
        return self.process is not None and self.process.poll() is None

    def call(self, method, **params):
        return call(self.socket, method, **params)

    def status(self):
        """Status; empty if the daemon does not answer."""
        with contextlib.suppress(OSError, ValueError, Refused):
            return self.call("status")
        return {"mode": "", "reasons": [], "axes": [{"driven": False}], "enabled": None,
                "inputs": [], "warnings": []}

    def axis(self):
        return self.status()["axes"][0]

    def wait_for(self, mode, patience_s=PATIENCE_S):
        return eventually(lambda: self.status()["mode"] == mode or not self.alive(), patience_s) \
            and self.alive()

    def operate(self, method, **params):
        """Sends an operator's command and notes it; True if answered "done". References are forced,
        since these machines warm in seconds."""
        if method == "reference":
            params["force"] = True
        try:
            done = self.call(method, **params).get("done", False)
        except (OSError, ValueError, Refused):
            return False
        if done and method in ("enable", "disable"):
            self.rig.told_enabled = method == "enable"
        if done and method == "reference":
            self.rig.told_reference = self.references()
        return done

    def references(self):
        return [each["reference_degC"] for each in self.status()["inputs"]]

    def hang_up(self):
        self.process.send_signal(signal.SIGHUP)

    def stop_for(self, seconds):
        """Like a stall of the whole machine."""
        self.pause_watch()
        self.process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self.process.send_signal(signal.SIGCONT)
        self.running.append([time.monotonic(), None])

    def pause_watch(self):
        if self.running and self.running[-1][1] is None:
            self.running[-1][1] = time.monotonic()

    def kill(self):
        self.pause_watch()
        self.ends_expected = True
        self.process.kill()
        self.process.wait()
        self.rig.machine.axis.begin_anew(self.unit)

    def end(self):
        """Ends it as systemd would. False: no exit with status 0 in time."""
        self.pause_watch()
        if not self.alive():
            return False
        self.ends_expected = True
        self.process.send_signal(signal.SIGTERM)
        try:
            good = self.process.wait(PATIENCE_S) == 0
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            good = False
        self.rig.machine.axis.begin_anew(self.unit)
        return good

    def cpu_s(self):
        """Consumed processor time."""
        fields = pathlib.Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2]
        return sum(map(int, fields.split()[11:13])) / os.sysconf("SC_CLK_TCK")

    def log_text(self):
        return self.log.read_text(errors="replace") if self.log.exists() else ""
