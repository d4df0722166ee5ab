"""Tries operations in the service's sandbox; writes the results to its state folder."""

import ctypes
import json
import mmap
import os
import socket
import time

results = {}


def attempt(name, action):
    """Notes the error; an empty text: the operation succeeded."""
    try:
        action()
        results[name] = ""
    except Exception as error:  # noqa: BLE001  what kind does not matter, that there is one does
        results[name] = str(error) or type(error).__name__


def touch(path):
    with open(path, "a"):
        pass


def libc(function, *arguments):
    library = ctypes.CDLL(None, use_errno=True)
    if getattr(library, function)(*arguments) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def open_and_close(path, flags):
    os.close(os.open(path, flags))


def see_others():
    if not [name for name in os.listdir("/proc") if name == "1"]:
        raise OSError("/proc/1 is hidden")


attempt("write state", lambda: touch("/var/lib/thermocomp/probe"))
attempt("read configuration", lambda: open("/etc/thermocomp/thermocompd.toml").read())
attempt("write configuration", lambda: touch("/etc/thermocomp/probe"))
attempt("write /usr", lambda: touch("/usr/probe"))
attempt("read /root", lambda: os.listdir("/root"))
attempt("tcp socket", lambda: socket.socket(socket.AF_INET).close())
attempt("unix socket", lambda: socket.socket(socket.AF_UNIX).close())
attempt("can socket", lambda: socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close())
attempt("packet socket", lambda: socket.socket(socket.AF_PACKET, socket.SOCK_RAW).close())
attempt("netlink socket", lambda: socket.socket(socket.AF_NETLINK, socket.SOCK_RAW).close())
attempt("serial port", lambda: open_and_close("/dev/ttyS0", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK))
attempt("foreign device", lambda: open_and_close("/dev/service-test", os.O_RDONLY | os.O_NONBLOCK))
attempt("kernel log", lambda: open_and_close("/dev/kmsg", os.O_RDWR))
attempt("new namespace", lambda: libc("unshare", 0x40000000))
attempt("set the clock", lambda: time.clock_settime(time.CLOCK_REALTIME, time.time()))
attempt("writable and executable memory",
        lambda: mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC))
attempt("change owner", lambda: os.chown("/var/lib/thermocomp/probe", 0, 0))
attempt("see other processes", see_others)
attempt("lock memory", lambda: libc("mlockall", 1))
attempt("fifo", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60)))

os.unlink("/var/lib/thermocomp/probe")
with open("/var/lib/thermocomp/probe.json", "w") as out:
    json.dump(results, out)
