#!/usr/bin/env python3
"""The experiment of the gate machine (Teratani et al. 1995), from real bytes to the simulated tool.

For each oil condition and procedure: a thermocomp-sim (config/gate_machine), a thermocompd, and in
this program the probing: each minute it reads the displacement transducer from the controller's
register and reports it over the daemon's socket. Five hours at 60 times real time; all runs in
parallel. Evaluated is the simulated machine's own record of its tool: as corrected (30 to 60 s
after a cycle end; before, the piezo moves through 0 V) and until the next cycle end, 5 min later.
The publication's figures are of the moments of correction, from the displacement 1 to 2 min before.

    gate_experiment.py BIN_FOLDER CONFIG_FOLDER OUT_FOLDER [CONDITION...]
"""

import csv
import json
import math
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time

TIME_FACTOR = 60
HOURS = 5.0
CYCLE_S = 300.0
MOVING_S = 30.0  # after a cycle end: the piezo moves
CORRECTED_S = 60.0
WARM_S = 900.0   # the first quarter of an hour, also left out in the publication
PROCEDURES = {"published": "piezo", "recursive": "piezo", "continuous": "axis"}
PUBLISHED_RANGE_UM = {1: 52.0, 2: 49.0, 3: 60.0}


class Registers:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=5)
        self.number = 0

    def int32(self, address, count):
        self.number = (self.number + 1) & 0xFFFF
        self.socket.sendall(struct.pack(">HHHBBHH", self.number, 0, 6, 1, 4, address, 2 * count))
        head = self.exactly(9)
        if head[7] != 4:
            raise RuntimeError(f"Modbus exception {head[8]}")
        return struct.unpack(f">{count}i", self.exactly(4 * count))

    def exactly(self, size):
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            if not part:
                raise ConnectionError("the controller closed the connection")
            data += part
        return data


class Run:
    def __init__(self, programs, config, out, condition, procedure):
        self.programs, self.config = programs, config
        self.condition, self.procedure = condition, procedure
        self.name = f"{condition}_{procedure}"
        self.folder = out / self.name
        self.folder.mkdir(parents=True, exist_ok=True)
        self.truth = self.folder / "truth.csv"
        self.sim = self.daemon = None
        self.probings = 0
        self.failure = None

    def text(self, *names):
        return "".join((self.config / name).read_text() + "\n" for name in names)

    def start(self):
        machine = self.text(f"condition_{self.condition}.toml", "machine.toml", "network.toml",
                            f"machine_{PROCEDURES[self.procedure]}.toml")
        (self.folder / "machine.toml").write_text(machine)
        ports = self.folder / "ports.json"
        ports.unlink(missing_ok=True)
        log = open(self.folder / "sim.log", "w")
        self.sim = subprocess.Popen(
            [self.programs / "thermocomp-sim", self.folder / "machine.toml", "--time-factor",
             str(TIME_FACTOR), "--start-on-heartbeat", "--truth", self.truth, "--ports-file", ports],
            stdout=log, stderr=log)
        wait_for(lambda: ports.exists() or self.sim.poll() is not None, 60)
        if self.sim.poll() is not None:
            raise SystemExit(f"gate_experiment: {(self.folder / 'sim.log').read_text()}")
        port_of = json.loads(ports.read_text())["ports"]
        (self.folder / "model.toml").write_text(self.text("model.toml"))
        daemon = self.text("thermocompd.toml", f"procedure_{self.procedure}.toml")
        daemon = daemon.replace("port = 15020", f"port = {port_of['module']}")
        daemon = daemon.replace("port = 15030", f"port = {port_of['amplifier']}")
        (self.folder / "thermocompd.toml").write_text(daemon)
        log = open(self.folder / "thermocompd.log", "w")
        self.daemon = subprocess.Popen(
            [self.programs / "thermocompd", self.folder / "thermocompd.toml"], stdout=log, stderr=log)
        wait_for(self.answers, 60)
        self.registers = Registers(port_of["amplifier"])
        self.thread = threading.Thread(target=self.probe, daemon=True)
        self.thread.start()

    def call(self, method, params=None):
        with socket.socket(socket.AF_UNIX) as client:
            client.settimeout(10)
            # A socket's path must be short: use the folder's descriptor.
            client.connect(f"/proc/self/fd/{self.folder_fd()}/status.sock")
            request = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params or {}}
            client.sendall(json.dumps(request).encode() + b"\n")
            return json.loads(client.makefile().readline())

    def folder_fd(self):
        if not hasattr(self, "fd"):
            self.fd = os.open(self.folder, os.O_RDONLY)
        return self.fd

    def answers(self):
        if self.daemon.poll() is not None:
            raise SystemExit(f"gate_experiment: {(self.folder / 'thermocompd.log').read_text()}")
        try:
            return "result" in self.call("status")
        except OSError:
            return False

    def probe(self):
        """Reports the transducer each minute of the machine's clock."""
        last = 0
        try:
            while self.sim.poll() is None:
                minutes, probed = self.registers.int32(20, 2)
                # Two seconds past the minute, except the one in which the piezo moves: at a cycle
                # end the newest value is then nearly a minute old, as in the publication.
                minute = math.floor(minutes / 1000 - 2 / 60)
                if minute > last:
                    last = minute
                    if minute % 5 == 0:
                        continue
                    answer = self.call("measured", {"axis": "x", "value_um": probed / 100})
                    if "error" in answer:
                        raise RuntimeError(answer["error"])
                    self.probings += 1
                time.sleep(0.02)
        except ConnectionError:
            pass  # the five hours are over
        except Exception as error:  # raised by the thread that waits for this run
            self.failure = error

    def finish(self):
        status = self.sim.wait()
        self.thread.join(10)
        self.daemon.terminate()
        ended = self.daemon.wait(30)
        if self.failure or status or ended:
            raise SystemExit(f"gate_experiment: {self.name}: probing {self.failure}, simulator "
                             f"{status}, daemon {ended}; logs in {self.folder}")

    def course(self):
        """Times, displacement and error while the tool cuts."""
        with open(self.truth) as file:
            rows = [(float(r["time_s"]), float(r["x_um"]), float(r["x_error_um"]))
                    for r in csv.DictReader(file)]
        return [r for r in rows if r[0] % CYCLE_S >= MOVING_S]


def wait_for(condition, seconds):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise SystemExit("gate_experiment: a program does not get ready")
        time.sleep(0.05)


def peak_and_rms(values):
    values = list(values)
    return max(map(abs, values)), math.sqrt(sum(v * v for v in values) / len(values))


def table(runs):
    print("error at the tool after the first 15 min of five hours: least .. greatest, RMS; um\n"
          "published, by its rule, as it is corrected: +-6 to 7; range without: 52, 49, 60\n"
          "  condition  procedure    as it is corrected        until the next correction   probings")
    conditions = sorted({run.condition for run in runs})
    lines, results = [], {}
    for condition in conditions:
        mine = [run for run in runs if run.condition == condition]
        course = mine[0].course()
        moved = [x for _, x, _ in course]
        width = max(moved) - min(moved)
        lines += [f"range_{condition} {width:.1f} um", f"range_of_published_{condition} "
                  f"{width / PUBLISHED_RANGE_UM[condition]:.3f} ratio"]
        for run in [None] + mine:
            name = run.procedure if run else "none"
            errors = [(t, e if run else x) for t, x, e in (run.course() if run else course)
                      if t >= WARM_S]
            text = f"  {condition:9}  {name:10}"
            for until_s in (CORRECTED_S, CYCLE_S):
                part = [e for t, e in errors if t % CYCLE_S <= until_s]
                peak, rms = peak_and_rms(part)
                results.setdefault((name, until_s), []).append((peak, rms))
                text += f"  {min(part):+6.1f} .. {max(part):+5.1f}, {rms:5.2f}"
            print(f"{text}  {run.probings if run else '':>8}")
    for (name, until_s), values in results.items():
        what = "corrected" if until_s == CORRECTED_S else "whole"
        lines += [f"{name}_{what}_peak {max(p for p, _ in values):.2f} um",
                  f"{name}_{what}_rms {max(r for _, r in values):.2f} um"]
    print("\n".join(lines))


def draw(runs, out):
    """One panel per condition: the tool without compensation and with each procedure."""
    conditions = sorted({run.condition for run in runs})
    script = ('set terminal pngcairo size 1100,1200 font "DejaVu Sans,11"\n'
              f'set output "{out / "courses.png"}"\n'
              'set datafile separator ","\nset datafile columnheaders\nset grid\nset xrange [0:5]\n'
              'set yrange [-30:50]\nset key outside right top Left reverse samplen 2\n'
              'set ylabel "tool against work, um"\n'
              f'set multiplot layout {len(conditions)},1\n')
    for condition in conditions:
        mine = [run for run in runs if run.condition == condition]
        curves = [f'"{mine[0].truth}" using (column("time_s")/3600):"x_um" with lines lw 2 '
                  'lc rgb "#999999" title "without"']
        # The time of the piezo's motion is left out.
        curves += [f'"{run.truth}" using (column("time_s")/3600):((int(column("time_s")) % '
                   f'{CYCLE_S:.0f}) < {MOVING_S:.0f} ? NaN : column("x_error_um")) with lines '
                   f'lw 1.3 title "{run.procedure}"' for run in mine]
        script += (f'set title "Condition {condition}"\n'
                   + ('set xlabel "hours"\n' if condition == conditions[-1] else "")
                   + "plot " + ", ".join(curves) + "\n")
    subprocess.run(["gnuplot"], input=script, text=True, check=True)


def main():
    programs, config, out = (pathlib.Path(a).resolve() for a in sys.argv[1:4])
    conditions = [int(a) for a in sys.argv[4:]] or [1, 2, 3]
    runs = [Run(programs, config, out, condition, procedure)
            for condition in conditions for procedure in PROCEDURES]
    try:
        for run in runs:
            run.start()
        for run in runs:
            run.finish()
    finally:
        for process in (p for run in runs for p in (run.sim, run.daemon) if p):
            if process.poll() is None:
                process.kill()
    if shutil.which("gnuplot"):
        draw(runs, out)
    table(runs)


if __name__ == "__main__":
    main()
