"""Events of a scripted shift: all of them, in order, with their durations."""

import json
import os
import time

from lab import eventually, run_tool
from plain_devices import Machine


def events_of(daemon):
    return daemon.call("events")["events"]


def index_of(events, kind, subject="", what=""):
    """Index of the first such event; a failure shows all events."""
    found = [i for i, event in enumerate(events) if event["kind"] == kind
             and event["subject"].startswith(subject) and event["what"].startswith(what)]
    assert found, (kind, subject, what, events)
    return found[0]


def test_events_of_a_shift_are_in_order_with_durations(lab):
    machine = Machine(lab)
    daemon = machine.start()
    machine.warm_by(3.0)
    daemon.wait_for_offset(3.0)
    assert not [event for event in events_of(daemon) if "never_read" in event["what"]]
    before = len(events_of(daemon))

    machine.module.stop()
    begun = time.monotonic()
    daemon.wait_for_mode("holding")
    seen = time.monotonic()
    # Longer than the reconnection's pauses, so that a wrong duration would be noticed.
    eventually(lambda: time.monotonic() - seen > 3.0, "the outage lasts")
    at_least_s = time.monotonic() - seen
    machine.module.start()
    machine.warm_by(3.0)
    daemon.wait_for_mode("compensating")
    at_most_s = time.monotonic() - begun
    eventually(lambda: any(event["kind"] == "recovery" and event["subject"] == "bus cabinet"
                           for event in events_of(daemon)), "the bus is reported as back")
    daemon.call("disable")
    eventually(lambda: any(event["what"] == "disabled" for event in events_of(daemon)),
               "the mode is reported")
    daemon.call("measured", axis="z", value_um=1.5)
    daemon.call("enable")
    daemon.wait_for_mode("compensating")
    daemon.call("reload")
    eventually(lambda: any(event["what"] == "reload" for event in events_of(daemon)), "reloaded")

    events = events_of(daemon)
    assert [event["number"] for event in events] == list(range(1, len(events) + 1))
    assert events[0]["kind"] == "daemon" and events[0]["what"].startswith("started")
    shift = events[before:]
    order = [index_of(shift, "fault", "sensor column"), index_of(shift, "mode", "compensating"),
             index_of(shift, "recovery", "sensor column"), index_of(shift, "mode", "holding"),
             index_of(shift, "command", what="disable"), index_of(shift, "mode", what="disabled"),
             index_of(shift, "command", what="measured z 1.5 um"),
             index_of(shift, "command", what="enable"), index_of(shift, "command", what="reload")]
    assert order == sorted(order), shift  # causes before effects
    outage = shift[order[2]]
    held = shift[order[3]]
    assert held["what"] == "compensating", held
    # Within a second of the observation from outside.
    for event in (outage, held):
        assert at_least_s - 1.0 < event["duration_s"] < at_most_s + 1.0, event
    for name in ("disable", "enable", "measured", "reload"):
        assert shift[index_of(shift, "command", what=name)]["user"] == os.getuid()
    assert not [event for event in shift if event["what"] == "operator_disabled"], "no fault"

    status, out, _ = daemon.cli("events")
    assert status == 0
    assert "  recovery  sensor column: " in out and ": over, lasted " in out
    assert "  command   measured z 1.5 um, by " in out
    assert json.loads(daemon.cli("events", "--json")[1])["events"][0] == events[0]
    # It is over, but still visible in the status.
    status, out, _ = daemon.cli("status")
    assert status == 0 and "Lately" in out and "Problems        : none" in out


def test_a_first_start_switched_off_reports_no_initial_faults(lab):
    machine = Machine(lab)
    machine.daemon.write_config(machine.config.replace("enabled_at_first_start = true",
                                                       "enabled_at_first_start = false"))
    daemon = machine.daemon.start()
    eventually(lambda: [event for event in events_of(daemon) if event["kind"] == "mode"],
               "the first mode is reported")
    listed = events_of(daemon)
    assert [event["what"] for event in listed if event["kind"] == "mode"] == ["disabled"]
    assert not [event for event in listed if event["kind"] == "fault"
                and event["subject"].startswith(("sensor ", "reason "))], listed


def same_event(kept, output):
    """An event in the history, in whole nanoseconds, equals the one reported by the daemon."""
    words = ("number", "kind", "subject", "what", "user")
    times = [(kept[key], output[key]) for key in ("wall_s", "duration_s")]
    return ([kept[key] for key in words] == [output[key] for key in words] and
            all(a == b if a is None or b is None else abs(a - b) < 2e-6 for a, b in times))


def test_earlier_runs_are_in_the_history(lab):
    machine = Machine(lab)
    daemon = machine.start()
    machine.module.stop()
    daemon.wait_for_mode("holding")
    machine.module.start()
    machine.warm_by(3.0)
    daemon.wait_for_mode("compensating")
    daemon.call("measured", axis="z", value_um=1.5)
    first = events_of(daemon)
    daemon.end()
    daemon.start().wait_for_mode("compensating")
    daemon.kill()  # committed events stay
    status, out, output = run_tool("events", daemon.history, "--json")
    assert status == 0, output
    listed = json.loads(out)["events"]
    earlier = [event for event in listed if event["run"] == 1]
    assert len(earlier) > len(first)
    for kept, live in zip(earlier, first):
        assert same_event(kept, live), (kept, live)
    ended = earlier[-1]
    assert ended["kind"] == "daemon" and ended["what"].startswith("stopping")
    assert {event["run"] for event in listed} <= {1, 2}
    status, out, _ = run_tool("events", daemon.history, "--from", "-1h")
    assert status == 0 and "  recovery  sensor column: " in out and ", by " in out
    status, out, _ = run_tool("events", daemon.history, "--to", "-1h")
    assert status == 0 and out == "no events\n"
    status, _, output = run_tool("events", lab.folder / "none.db")
    assert status == 2 and "none.db" in output


def test_strict_reports_problems_while_compensating(lab):
    machine = Machine(lab)
    daemon = machine.start()
    eventually(lambda: daemon.cli("status", "--strict")[0] == 0, "every unit has answered")
    machine.warm_by(100.0)
    eventually(lambda: daemon.axis()["at_bound"], "the bound")
    assert daemon.cli("status")[0] == 0
    status, out, _ = daemon.cli("status", "--strict", "--json")
    listed = json.loads(out)
    assert (status, listed["exit_status"], listed["why"]) == (
        1, 1, ["at_bound", "axis z is at its bound"])
    assert json.loads(daemon.cli("status", "--json")[1])["why"] == []
