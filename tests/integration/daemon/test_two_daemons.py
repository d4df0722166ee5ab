"""Two real daemons with a common resource: the second is refused and names the holder."""

import os
import shutil
import subprocess
import sys

import pytest

from lab import assert_replays_exactly, count_rows
from plain_devices import Machine


@pytest.fixture
def other(lab, tmp_path_factory):
    """A second machine that shares only its name with the first."""
    from lab import Lab
    second = Lab(tmp_path_factory.mktemp("other"))
    yield Machine(second)
    second.end()


def assert_refused(daemon, holder, *words):
    daemon.start(wait=False)
    assert daemon.process.wait(30) == 1
    output = [line for line in daemon.log_text().splitlines() if line.startswith("thermocompd: ")]
    assert len(output) == 1, daemon.log_text()
    for word in (f"process {holder.process.pid}", str(holder.config), *words):
        assert word in output[0], output


def change(machine, *replacements):
    text = machine.daemon.config.read_text()
    for before, after in replacements:
        assert str(before) in text
        text = text.replace(str(before), str(after))
    machine.daemon.config.write_text(text)


def test_the_same_history_is_refused(machine, other, lab):
    daemon = machine.start()
    change(other, (other.daemon.history, daemon.history))
    daemon.committed()
    before = count_rows(daemon.history)
    assert_refused(other.daemon, daemon, str(daemon.history))
    assert daemon.status()["mode"] == "compensating"
    daemon.committed()
    assert all(now >= then for then, now in zip(before, count_rows(daemon.history)))
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


def test_the_same_state_file_is_refused(machine, other):
    daemon = machine.start()
    change(other, (other.daemon.state, daemon.state))
    assert_refused(other.daemon, daemon, str(daemon.state))
    assert daemon.status()["mode"] == "compensating"


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_the_same_controller_is_refused(machine, other, host):
    daemon = machine.start()
    change(other, (f"port = {other.controller.port}", f"port = {machine.controller.port}"),
           ("127.0.0.1", host))
    seen = len(machine.controller.orders())
    assert_refused(other.daemon, daemon, "controller", str(machine.controller.port))
    assert len(machine.controller.orders()) >= seen


def test_after_an_end_or_a_kill_the_next_may_have_it(machine, other):
    daemon = machine.start()
    for end in (daemon.kill, daemon.end):
        end()
        daemon.start().wait_for_mode("compensating")
    daemon.kill()
    shutil.copy(daemon.folder / "model.toml", other.daemon.folder)
    change(other, (other.daemon.state, daemon.state), (other.daemon.history, daemon.history),
           (f"port = {other.controller.port}", f"port = {machine.controller.port}"))
    other.daemon.start().wait_for_mode("compensating")
    other.daemon.end()
    assert not list(daemon.folder.glob("*.lock"))


# Takes names as any user may: those that a holder has now or had, and prefixes of them.
SQUATTER = """
import os, socket, sys, time
os.setgid(65534)
os.setuid(65534)
taken = []
for name in sys.argv[1:]:
    for kind in (socket.SOCK_STREAM, socket.SOCK_DGRAM, socket.SOCK_SEQPACKET):
        link = socket.socket(socket.AF_UNIX, kind)
        try:
            link.bind(b"\\0" + name.encode())
            if kind != socket.SOCK_DGRAM:
                link.listen(1)
            taken.append(link)
        except OSError:
            pass
print(len(taken), flush=True)
time.sleep(600)
"""


def abstract_names(word):
    with open("/proc/self/net/unix") as table:
        lines = [line.rstrip("\n") for line in table]
    return sorted({line[line.index("@") + 1:] for line in lines if "@thermoc" in line and
                   word in line})


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be another user")
def test_another_user_cannot_keep_the_daemon_from_starting(machine, other):
    daemon = machine.start()
    names = abstract_names(f":{machine.controller.port} ")
    assert names
    daemon.end()
    names += [name.rpartition("/")[0] for name in names]
    squatter = subprocess.Popen([sys.executable, "-c", SQUATTER, *names], text=True,
                                stdout=subprocess.PIPE)
    try:
        assert int(squatter.stdout.readline()) > 0
        daemon.start().wait_for_mode("compensating")
        # Two daemons of one user still exclude each other.
        change(other, (f"port = {other.controller.port}", f"port = {machine.controller.port}"))
        assert_refused(other.daemon, daemon, "controller")
    finally:
        squatter.kill()
        squatter.wait()
