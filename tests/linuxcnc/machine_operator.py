#!/usr/bin/python3
"""Replaces LinuxCNC's screen: executes a test's commands from a Unix socket, one JSON list [method,
arguments...] per line, and answers [true, result] or [false, error]."""

import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

import hal
import linuxcnc

PATIENCE_S = float(os.environ.get("THERMOCOMP_PATIENCE_S", "60"))


class Operator:
    def __init__(self):
        self.command = linuxcnc.command()
        self.status = linuxcnc.stat()
        self.errors = linuxcnc.error_channel()
        self.component = hal.component("operator")
        self.component.ready()

    def wait(self, holds, what):
        end = time.monotonic() + PATIENCE_S
        while True:
            self.status.poll()
            if holds(self.status):
                return True
            if time.monotonic() > end:
                raise TimeoutError(what)
            time.sleep(0.01)

    def mode(self, mode):
        self.command.mode(mode)
        self.wait(lambda s: s.task_mode == mode, "another mode")

    def on(self):
        self.command.state(linuxcnc.STATE_ESTOP_RESET)
        self.wait(lambda s: s.task_state >= linuxcnc.STATE_ESTOP_RESET, "out of estop")
        self.command.state(linuxcnc.STATE_ON)
        return self.wait(lambda s: s.task_state == linuxcnc.STATE_ON and s.enabled, "machine on")

    def off(self):
        self.command.state(linuxcnc.STATE_OFF)
        return self.wait(lambda s: not s.enabled, "machine off")

    def estop(self):
        self.command.state(linuxcnc.STATE_ESTOP)
        return self.wait(lambda s: s.task_state == linuxcnc.STATE_ESTOP and not s.enabled, "estop")

    def homed(self):
        self.status.poll()
        return all(self.status.homed[:self.status.joints])

    def unhome(self):
        self.mode(linuxcnc.MODE_MANUAL)
        self.command.teleop_enable(0)
        self.wait(lambda s: s.motion_mode == linuxcnc.TRAJ_MODE_FREE, "joint mode")
        self.command.unhome(-1)
        return self.wait(lambda s: not any(s.homed[:s.joints]), "un-homed")

    def home(self):
        self.mode(linuxcnc.MODE_MANUAL)
        self.command.teleop_enable(0)
        self.wait(lambda s: s.motion_mode == linuxcnc.TRAJ_MODE_FREE, "joint mode")
        self.command.home(-1)
        return self.wait(lambda s: all(s.homed[:s.joints]) and
                         s.exec_state == linuxcnc.EXEC_DONE and
                         s.inpos, "homed")

    def is_idle(self, status):
        return (status.interp_state == linuxcnc.INTERP_IDLE and status.inpos and
                status.exec_state == linuxcnc.EXEC_DONE and status.queue == 0)

    def mdi(self, *lines):
        """Executes each line to its end."""
        self.mode(linuxcnc.MODE_MDI)
        for line in lines:
            self.command.mdi(line)
            if self.command.wait_complete(PATIENCE_S) == linuxcnc.RCS_ERROR:
                raise RuntimeError(f"{line}: refused: {self.messages()}")
            self.wait(self.is_idle, line)
        return True

    def run(self, program):
        self.mode(linuxcnc.MODE_AUTO)
        self.command.program_open(program)
        self.wait(lambda s: s.file.endswith(program), "the program is loaded")
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        return self.wait(lambda s: s.interp_state != linuxcnc.INTERP_IDLE, "the program runs")

    def running(self):
        self.status.poll()
        return not self.is_idle(self.status)

    def finish(self):
        return self.wait(self.is_idle, "the program ends")

    def abort(self):
        self.command.abort()
        return self.wait(self.is_idle, "abort")

    def jog(self, axis, distance_mm):
        self.mode(linuxcnc.MODE_MANUAL)
        self.command.teleop_enable(1)
        self.wait(lambda s: s.motion_mode == linuxcnc.TRAJ_MODE_TELEOP, "world mode")
        self.command.jog(linuxcnc.JOG_INCREMENT, False, axis, 50.0, distance_mm)
        time.sleep(0.05)
        return self.wait(lambda s: s.inpos, "jog")

    def messages(self):
        """Messages of LinuxCNC since the last call."""
        output = []
        while True:
            one = self.errors.poll()
            if not one:
                return output
            output.append(str(one[1]))

    def pins(self, *names):
        return [hal.get_value(name) for name in names]

    def halcmd(self, *arguments):
        """[status, output]. Output to a file: processes of loadusr would keep a pipe open."""
        with tempfile.TemporaryFile("w+") as output:
            status = subprocess.run(["halcmd", *arguments], stdout=output, stderr=output,
                                    timeout=PATIENCE_S, check=False).returncode
            output.seek(0)
            return [status, output.read()]

    def end_bridge(self, how, name):
        """Sends a signal to the process of this HAL component, found from within the namespaces."""
        for process in pathlib.Path("/proc").glob("[0-9]*"):
            words = (process / "cmdline").read_bytes().split(b"\0")
            if words[0].endswith(b"thermocomp-linuxcnc") and name.encode() in words:
                os.kill(int(process.name), how)
                return True
        raise RuntimeError("no such process")

    def record(self, file):
        """Records every servo period to a file until recorded()."""
        with open(file, "w", encoding="ascii") as out:
            self.recorder = subprocess.Popen(["halsampler"], stdout=out)
        return self.halcmd("setp", "sampler.0.enable", "1")

    def recorded(self):
        self.halcmd("setp", "sampler.0.enable", "0")
        self.wait(lambda _: hal.get_value("sampler.0.curr-depth") == 0, "all samples are read")
        time.sleep(0.1)
        self.recorder.terminate()
        self.recorder.wait(PATIENCE_S)
        return hal.get_value("sampler.0.overruns")


def main():
    operator = Operator()
    with socket.socket(socket.AF_UNIX) as link:
        link.connect("operator.sock")
        with link.makefile("rw") as lines:
            lines.write(json.dumps([True, "ready"]) + "\n")
            lines.flush()
            for line in lines:
                method, *arguments = json.loads(line)
                if method == "quit":
                    return
                try:
                    answer = [True, getattr(operator, method)(*arguments)]
                except Exception as error:  # whatever it is, the test gets it
                    answer = [False, f"{method}{arguments}: {error!r}"]
                lines.write(json.dumps(answer) + "\n")
                lines.flush()


if __name__ == "__main__":
    sys.exit(main())
