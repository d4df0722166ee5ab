"""Failures at run time, as seen by systemd and the controller."""

import os
import signal
import time

import pytest

import service
from lab import eventually
from service import STATE, UNIT, run, show


def wait_for_restart(count):
    eventually(lambda: service.restarts() > count and service.active(), "started again", 60.0)
    service.wait_for_mode("compensating")


def stayed_at(orders, offset_um):
    assert orders, "no order since"
    return max(abs(order - offset_um) for _, order in orders) < 0.01


def hang_the_process(_):
    os.kill(service.main_pid(), signal.SIGSTOP)


def plant(name):
    return lambda _: (STATE / name).touch()


@pytest.mark.parametrize("what, hang", [
    ("the cycle blocks", plant("plant-cycle-blocks")),
    ("the cycle spins at its real-time priority", plant("plant-cycle-spins")),
    ("the main thread blocks", plant("plant-main-blocks")),
    ("the whole process is stopped", hang_the_process),
])
def test_the_watchdog_ends_a_hang_and_the_offset_stays(running, what, hang):
    restarts, orders, began = service.restarts(), running.count(), time.monotonic()
    hang(running)
    wait_for_restart(restarts)
    took_s = time.monotonic() - began
    assert service.restarts() == restarts + 1
    eventually(lambda: running.orders_since(orders), "orders")
    time.sleep(0.5)
    print(f"{what}: compensating again after {took_s:.1f} s, "
          f"largest step {service.largest_step_um(running.orders_since(orders - 1)):.3f} um")
    assert stayed_at(running.orders_since(orders), 9.0)
    assert "Watchdog timeout" in service.journal()


def test_a_restart_is_bumpless(running):
    pid, orders = service.main_pid(), running.count()
    record = service.SOCKET.with_name("status.sock.sent")
    written = record.stat().st_ino
    run("systemctl", "restart", UNIT)
    assert service.main_pid() != pid
    assert record.stat().st_ino == written  # the last-sent record survives the service
    service.wait_for_mode("compensating")
    eventually(lambda: len(running.orders_since(orders)) > 20, "orders")
    assert stayed_at(running.orders_since(orders), 9.0)


def test_kill_9_leaves_the_operators_switch_as_it_was(running):
    run("thermocomp", "disable")
    os.kill(service.main_pid(), signal.SIGKILL)
    restarts = service.restarts()
    eventually(lambda: service.restarts() > restarts and service.active(), "started again")
    service.wait_for_mode("disabled")
    run("thermocomp", "enable")
    running.settled_at(9.0)


def test_a_stop_ramps_to_zero_where_that_is_configured(running):
    # Longer than TimeoutStopSec: the daemon requests the time it needs.
    service.write_config(running.config('on_stop = "ramp_to_zero"\n'))
    run("systemctl", "reload", UNIT)
    running.settled_at(36.0)
    orders, began = running.count(), time.monotonic()
    run("systemctl", "stop", UNIT)
    took_s = time.monotonic() - began
    assert show("Result") == "success"
    assert running.controller.applied_um() == 0.0
    service.assert_slewed(running.orders_since(orders))
    print(f"36 um to zero in {took_s:.1f} s, TimeoutStopSec {show('TimeoutStopUSec')}")
    assert took_s > 15.0
    service.write_config(running.config())


def test_the_simulated_machine_over_a_serial_line_is_served(running):
    service.stop_and_forget()
    run("dpkg", "-i", service.package("thermocomp-simulator"))
    try:
        with service.simulated_line() as line:
            service.write_config(service.serial_config(line))
            now = service.start("dry_run")
            assert [each["temp_degC"] for each in now["inputs"]] == [21.0, 22.0]
    finally:
        # The reference belonged to that machine.
        service.stop_and_forget()
        service.write_config(running.config())
        running.warm_by(0.0)
        run("dpkg", "-P", "thermocomp-simulator")
        service.start()
