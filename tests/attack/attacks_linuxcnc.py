"""The real LinuxCNC: what operators and breakdowns do to it, with thermal offsets in effect."""

import signal
import time

from registry import attack


@attack(links=("linuxcnc",), limit_s=200.0, way="joint")
def off_on_and_home_by_joint(rig):
    """Off, on, estop, un-home and home at random moments while the machine warms and cools."""
    run_operator(rig)


@attack(links=("linuxcnc",), limit_s=200.0, way="external")
def off_on_and_home_by_external(rig):
    """The same with LinuxCNC's external offsets."""
    run_operator(rig)


def run_operator(rig):
    cnc = rig.mill.cnc
    rig.ready()
    with rig.recording():
        for _ in range(6):
            rig.tries += 1
            kind = rig.random.choice(("off", "estop", "home", "home"))
            if kind == "home":
                cnc.mdi("G53 G0 x1 y1 z-1")
                cnc.unhome()
                time.sleep(rig.random.uniform(0.0, 0.6))
                cnc.home()
            else:
                getattr(cnc, kind)()
                time.sleep(rig.random.uniform(0.0, 0.6))
                cnc.on()
            rig.in_step()


@attack(links=("linuxcnc",), limit_s=200.0, way="joint")
def daemon_and_bridge_killed(rig):
    """kill -9 of the daemon twice, then of the bridge, which another takes over."""
    rig.ready()
    with rig.recording():
        for _ in range(2):
            rig.tries += 1
            rig.mill.daemon.kill()
            time.sleep(rig.random.uniform(0.1, 1.5))
            rig.mill.daemon.start()
            rig.in_step()
        rig.tries += 1
        rig.mill.cnc.end_bridge(int(signal.SIGKILL), "thermocomp")
        time.sleep(rig.random.uniform(0.1, 1.5))
        rig.rejoin("thermocomp-2", "thermocomp")
        rig.in_step()


@attack(links=("linuxcnc",), limit_s=200.0, way="joint")
def a_rogue_bridge_beside_it(rig):
    """Another program of the bridge's group reports to the daemon that the axes stand elsewhere."""
    rig.ready()
    with rig.recording():
        rig.rogue_reports(3.0)
        rig.in_step()
