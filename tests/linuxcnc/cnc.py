"""A headless LinuxCNC with a simulated mill and the bridge, next to the daemon."""

import contextlib
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess

from lab import BIN, PATIENCE_S, SOURCE, eventually

HERE = pathlib.Path(__file__).resolve().parent
AXES = "xyz"
EXAMPLE = SOURCE / "linuxcnc" / "example"


def sampler_file():
    """All channels except positions in um: the recorder writes six decimals."""
    lines = ["loadrt sampler depth=60000 cfg=ffffffffffffbs",
             "loadrt sum2 names=" + ",".join(f"rec-{n}-{a}" for n in ("asked", "added", "applied")
                                             for a in AXES)]
    for i, a in enumerate(AXES):
        lines.append(f"net tc-position-{a} => sampler.0.pin.{i}")
        for k, name in enumerate(("asked", "added", "applied")):
            part = f"rec-{name}-{a}"
            lines += [f"addf {part} servo-thread", f"setp {part}.gain0 1000",
                      f"setp {part}.gain1 -1000",
                      f"net {part} {part}.out => sampler.0.pin.{3 + 3 * k + i}"]
        lines += [f"net tc-asked-{a} => rec-asked-{a}.in0",
                  f"net tc-applied-{a} => rec-applied-{a}.in0",
                  # Difference between drive command and LinuxCNC's displayed position.
                  f"net {a}-cmd => rec-added-{a}.in0",
                  f"net tc-position-{a} => rec-added-{a}.in1"]
    lines += ["net tc-enabled motion.motion-enabled => sampler.0.pin.12",
              "net tc-motion-type => sampler.0.pin.13", "addf sampler.0 servo-thread",
              "setp sampler.0.enable 0"]
    return "\n".join(lines) + "\n"


def hal_file(way, *options):
    drives = [f"--signal=tc.offset-{a}.{pin}={a}-{signal}" for a in AXES
              for pin, signal in (("out", "cmd"), ("fb-in", "fb"))] if way == "joint" else []
    done = subprocess.run([str(BIN / "thermocomp-linuxcnc"), "hal", "--way", way, "--axes",
                           "x=0,y=1,z=2", "--halui", "--command",
                           str(BIN / "thermocomp-linuxcnc"), *drives, *options],
                          capture_output=True, text=True, check=True)
    return done.stdout


def in_unit(ini, unit_mm):
    """The mill's ini file for a machine in inches, or as it is."""
    if unit_mm == 1.0:
        return ini
    lengths = "LIMIT|VELOCITY|ACCELERATION|SEARCH_VEL|LATCH_VEL|FERROR"
    return re.sub(rf"^(\w*(?:{lengths}) = )(-?[\d.]+)$",
                  lambda m: f"{m[1]}{float(m[2]) / unit_mm:.6f}",
                  ini.replace("LINEAR_UNITS = mm", "LINEAR_UNITS = inch"), flags=re.MULTILINE)


class LinuxCnc:
    """One run of LinuxCNC; methods of its operator are available on this object."""

    def __init__(self, folder, way, daemon_socket, unit_mm=1.0):
        self.folder = folder
        self.way = way
        self.unit_mm = unit_mm
        # 1 s: long enough to show that the warning comes, and that it does not come at once.
        self.bridge_arguments = f"--socket {daemon_socket} --mismatch-after-s 1.0"
        self.process = None

    def prepare(self):
        shutil.copytree(EXAMPLE, self.folder, dirs_exist_ok=True)
        (self.folder / "home").mkdir(exist_ok=True)
        ini = (EXAMPLE / f"{self.way}.ini").read_text()
        ini = ini.replace("DISPLAY = axis", "DISPLAY = ./machine_operator.py")
        ini = ini.replace("HALFILE = thermal.hal", "HALFILE = thermal.hal\nHALFILE = sampler.hal")
        (self.folder / f"{self.way}.ini").write_text(in_unit(ini, self.unit_mm))
        (self.folder / "thermal.hal").write_text(
            hal_file(self.way, f"--arguments={self.bridge_arguments}",
                     *(["--units", "inch"] if self.unit_mm != 1.0 else [])))
        (self.folder / "sampler.hal").write_text(sampler_file())
        shutil.copy(HERE / "machine_operator.py", self.folder)
        for path in (self.folder, *self.folder.rglob("*")):
            os.chown(path, 65534, 65534)

    def start(self):
        self.prepare()
        link = self.folder / "operator.sock"
        link.unlink(missing_ok=True)
        with socket.socket(socket.AF_UNIX) as door:
            door.bind(str(link))
            os.chown(link, 65534, 65534)
            door.listen(1)
            door.settimeout(0.2)
            with (self.folder / "linuxcnc.log").open("a") as log:
                self.process = subprocess.Popen(
                    [str(HERE / "in_private_namespaces.sh"), str(self.folder), f"{self.way}.ini",
                     str(BIN)],
                    stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            self.link = eventually(lambda: self.accepted(door), "LinuxCNC shows its screen")
        self.link.settimeout(4 * PATIENCE_S)
        self.lines = self.link.makefile("rw")
        assert self.answer() == "ready"
        return self

    def accepted(self, door):
        assert self.process.poll() is None, "LinuxCNC ended:\n" + self.log_text()[-3000:]
        with contextlib.suppress(TimeoutError):
            return door.accept()[0]
        return None

    def answer(self):
        line = self.lines.readline()
        assert line, "LinuxCNC ended:\n" + self.log_text()[-3000:]
        good, result = json.loads(line)
        assert good, f"{result}\n{self.log_text()[-3000:]}"
        return result

    def log_text(self):
        return (self.folder / "linuxcnc.log").read_text(errors="replace")

    def __getattr__(self, method):
        def call(*arguments):
            self.lines.write(json.dumps([method, *arguments]) + "\n")
            self.lines.flush()
            return self.answer()
        return call

    def quit(self):
        """Closes it as an operator would; LinuxCNC then ends."""
        self.lines.write('["quit"]\n')
        self.lines.flush()
        self.process.wait(PATIENCE_S)
        self.link.close()
