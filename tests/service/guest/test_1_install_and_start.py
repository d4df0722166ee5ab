"""From a bare system to a ready service."""

import grp
import pathlib
import pwd
import stat
import time

import service
from lab import eventually
from service import CONFIG, STATE, UNIT, run, show

WATCHED = ("/etc", "/usr", "/lib", "/var/lib", "/run/thermocomp", "/opt")
before = {}


def test_installing_makes_users_and_folders_and_starts_nothing():
    before["tree"] = service.tree(*WATCHED)
    run("dpkg", "-i", service.package("thermocomp"))
    assert pwd.getpwnam("thermocomp").pw_shell == "/usr/sbin/nologin"
    for group in ("thermocomp", "thermocomp-operator", "thermocomp-bridge"):
        grp.getgrnam(group)
    state = STATE.stat()
    assert stat.S_IMODE(state.st_mode) == 0o750
    assert state.st_uid == pwd.getpwnam("thermocomp").pw_uid
    assert CONFIG.parent.stat().st_uid == 0
    assert not CONFIG.exists()
    assert show("ActiveState") == "inactive"
    assert run("systemctl", "is-enabled", UNIT).stdout.strip() == "enabled"


def test_without_a_configuration_a_start_is_no_start():
    run("systemctl", "start", UNIT)
    values = show("ActiveState", "ConditionResult", "MainPID")
    assert values == {"ActiveState": "inactive", "ConditionResult": "no", "MainPID": "0"}


def test_the_example_beside_it_is_valid_and_the_manual_is_there():
    output = run("thermocomp", "check", "/etc/thermocomp/thermocompd.toml.example").stdout
    assert output.rstrip().endswith("OK")
    for page in ("man1/thermocomp.1.gz", "man5/thermocompd.toml.5.gz", "man8/thermocompd.8.gz"):
        assert pathlib.Path("/usr/share/man", page).exists()
    for program in ("thermocomp", "thermocompd"):
        assert pathlib.Path("/usr/share/bash-completion/completions", program).exists()


def test_a_wrong_configuration_fails_once_with_its_reason():
    CONFIG.write_text("format = 1\nno_such_key = 2\n")
    started = run("systemctl", "start", UNIT, check=False)
    assert started.returncode != 0
    eventually(lambda: show("ActiveState") == "failed", "failed for good")
    time.sleep(2.5)  # longer than RestartSec
    values = show("ActiveState", "ExecMainStatus", "NRestarts")
    assert values == {"ActiveState": "failed", "ExecMainStatus": "2", "NRestarts": "0"}
    assert "no_such_key" in service.journal()
    run("systemctl", "reset-failed", UNIT)


def test_ready_is_sent_only_when_cycles_run(machine):
    service.write_config(machine.config())
    service.drop_in("planted", "[Service]\nEnvironment=LD_PRELOAD=/opt/service-test/planted_hang.so\n")
    hold_back = STATE / "plant-slow-start"
    hold_back.touch()
    run("systemctl", "start", "--no-block", UNIT)
    eventually(lambda: service.main_pid() and
               service.process_fact(service.main_pid(), "Threads") != "1", "its threads")
    # The program runs, but its cycle does not.
    until = time.monotonic() + 2.0
    while time.monotonic() < until:
        assert show("ActiveState") == "activating"
        time.sleep(0.1)
    hold_back.unlink()
    eventually(service.active, "active")
    service.wait_for_mode("compensating")
    assert service.restarts() == 0


def test_a_cycle_that_never_runs_is_never_ready():
    run("systemctl", "stop", UNIT)
    hold_back = STATE / "plant-slow-start"
    hold_back.touch()
    run("systemctl", "start", "--no-block", UNIT)
    seen = set()

    def given_up():
        seen.add(show("ActiveState"))
        return service.restarts() >= 1

    eventually(given_up, "it gives up and is started again", 40.0)
    assert "active" not in seen
    hold_back.unlink()
    eventually(service.active, "active")


def test_the_cycle_is_real_time_inside_the_sandbox(running):
    pid = service.main_pid()
    threads = service.thread_facts(pid)
    assert threads["cycle"] == (1, 60), threads
    assert all(policy == 0 for name, (policy, _) in threads.items() if name != "cycle")
    assert int(service.process_fact(pid, "VmLck").split()[0]) > 0
    assert service.process_fact(pid, "NoNewPrivs") == "1"
    assert service.process_fact(pid, "Seccomp") == "2"
    # Only CAP_IPC_LOCK (14) and CAP_SYS_NICE (23).
    assert int(service.process_fact(pid, "CapEff"), 16) == 1 << 14 | 1 << 23
    assert service.status()["mode"] == "compensating"


def test_the_socket_asks_who_calls(running):
    def as_member(group, *command):
        return run("setpriv", "--reuid", "nobody", "--regid", "nogroup",
                   *(("--groups", group) if group else ("--clear-groups",)),
                   "thermocomp", *command, check=False).returncode

    assert run("thermocomp", "status").returncode == 0
    assert as_member("thermocomp", "status") == 0
    assert as_member("thermocomp", "cycle-end") == 2
    assert as_member("thermocomp-operator", "cycle-end") == 0
    assert as_member("", "status") == 2
