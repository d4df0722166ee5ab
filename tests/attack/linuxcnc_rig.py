"""The real LinuxCNC with daemon, bridge and a simulated mill (tests/linuxcnc), and what was seen in
every servo period: what the bridge asks for, and what the drives are told."""

import contextlib
import os
import pathlib
import random
import sys
import time

TESTS = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS / "linuxcnc"), str(TESTS / "integration" / "daemon")]
RATE_UM_PER_S = 40.0
BOUND_UM = 100.0
# The samples have servo periods for a clock, and LinuxCNC here has no real-time kernel: so much
# longer may a time have been than its samples say. At 40 um/s that is 8 um; a doubled or lost
# offset is 30 um.
CLOCK_S = 0.2
# Of a drive in a servo period: 1 mm/s, with which the offset goes to zero before homing.
DRIVE_STEP_UM = 1.01


class LinuxCncRig:
    """As a Rig (rig.py), to an attack and to the table."""

    def __init__(self, programs, _link, seed, way):
        os.environ["THERMOCOMP_BIN"] = str(programs)
        from warm_mill import STEADY, WarmMill
        self.random = random.Random(seed)
        self.way = way
        self.mill = WarmMill(way, STEADY, 4000, RATE_UM_PER_S, 1.0)
        self.folder = self.mill.folder
        self.broken = []
        self.tries = 0
        self.ended = 0
        self.recordings = []

    def broke(self, what):
        if what not in self.broken:
            self.broken.append(what)

    def ready(self):
        """Warm, on, homed, in step."""
        from lab import eventually
        self.mill.daemon.start()
        eventually(lambda: (self.mill.daemon.axis("x")["displacement"] or 0.0) < -29.9,
                   "a warm machine")
        self.mill.cnc.start()
        self.mill.cnc.on()
        self.mill.cnc.home()
        self.in_step()

    def in_step(self):
        """What is applied is what the machine's temperature asks for: neither missing nor twice."""
        from warm_mill import AXES, expected_um
        axes = self.mill.in_step()
        doubled = max(abs(axes[a]["applied"] - expected_um(a)) for a in AXES)
        if doubled > 1.0:
            self.broke(f"an axis applies {doubled:.1f} um more or less than it should")

    @contextlib.contextmanager
    def recording(self):
        from recording import recording
        with recording(self.mill.cnc) as made:
            yield
        self.recordings += made

    def rejoin(self, name, old):
        from cnc import hal_file
        (self.mill.cnc.folder / "rejoin.hal").write_text(
            hal_file(self.way, f"--arguments={self.mill.cnc.bridge_arguments}", "--name", old,
                     "--rejoin", name))
        status, said = self.mill.cnc.halcmd("-f", "/mnt/rejoin.hal")
        if status != 0:
            self.broke("another bridge does not take over: " + said[:100])

    def rogue_reports(self, seconds):
        import watch
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            with contextlib.suppress(OSError, ValueError, watch.Refused):
                watch.call(self.mill.daemon.socket, "controller_state",
                           session=self.random.choice((7, 8)), taking=True, signals={
                               name: 0 for name in ("x_mm", "y_mm", "z_mm", "spindle_rpm",
                                                    "coolant_on", "cutting_on", "enabled_on",
                                                    "homed_on")},
                           applied_um={a: self.random.uniform(-90, 90) for a in "xyz"})
            time.sleep(0.02)

    def judge(self):
        """The asked-for offset may begin anew from what is applied; else it keeps slew and time."""
        largest = {"step_um": 0.0, "allowed_um": 1e3, "beyond": 0, "value_um": 0.0, "writes": 0}
        for recording in self.recordings:
            for axis in range(recording.asked_um.shape[1]):
                judge_axis(recording.asked_um[:, axis], recording.applied_um[:, axis], largest)
            if recording.largest_step_um() > DRIVE_STEP_UM:
                self.broke(f"a drive steps by {recording.largest_step_um():.3f} um in 1 ms")
        if not self.recordings:
            self.broke("nothing was recorded")
        if largest["beyond"]:
            self.broke(f"{largest['beyond']} offsets leap, by {largest['step_um']:.1f} um")
        if largest["value_um"] > BOUND_UM:
            self.broke(f"beyond the bound: {largest['value_um']:.1f} um")
        if self.mill.daemon.process is None or self.mill.daemon.process.poll() is not None:
            self.ended += 1
            self.broke("the daemon has ended")
        else:
            self.mill.daemon.end()
        return largest | {"tries": max(1, self.tries), "bound_um": BOUND_UM, "ended": self.ended,
                          "rows": 0, "rows_lost": 0, "commands_lost": 0, "unfed_s": 0.0,
                          "wait_s": 0.0, "broken": self.broken}

    def close(self, _keep=False):
        self.mill.close()


def judge_axis(asked, applied, largest):
    import numpy as np
    changes = np.flatnonzero(np.diff(asked) != 0) + 1
    largest["value_um"] = max(largest["value_um"], float(np.max(np.abs(asked), initial=0.0)))
    for before, at in zip(changes, changes[1:]):
        if 0.0 in (asked[at], asked[at - 1]):
            continue  # the gate in HAL, which is shut while the machine is off or not homed
        step = min(abs(asked[at] - asked[at - 1]), abs(asked[at] - applied[at]))
        allowed = RATE_UM_PER_S * (0.001 * (at - before) + CLOCK_S)
        largest["writes"] += 1
        largest["beyond"] += int(step > allowed)
        if step - allowed > largest["step_um"] - largest["allowed_um"]:
            largest["step_um"], largest["allowed_um"] = float(step), float(allowed)
