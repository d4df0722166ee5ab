"""MQTT with a real mosquitto: all messages arrive, and any end of the gateway is published."""

import contextlib
import os
import socket
import subprocess
import time

import pytest

from gateway_lab import Broker, Gateway, Subscriber, make_certificate
from lab import eventually, with_addresses_of_localhost


@pytest.fixture
def broker(lab):
    made = Broker(lab.folder)
    lab.also_end(made)
    return made.start()


def publisher(lab, machine, broker, more="", wrapper=()):
    return lab.also_end(Gateway(lab, machine.daemon, "", f'[mqtt]\nhost = "localhost"\n'
                                f'port = {broker.port}\nperiod_s = 0.5\n{more}\n[alarm]\n'
                                'raise_after_s = 0.5\nclear_after_s = 0.5', wrapper)).start()


def topic(rest):
    return "thermocomp/mill_3/" + rest


def test_values_arrive_retained_and_the_last_will_ends_them(lab, machine, broker):
    gateway = publisher(lab, machine, broker)
    listener = lab.also_end(Subscriber(broker))
    machine.warm_by(9.0)
    listener.wait_for(lambda t, _, p: t == topic("axis/z") and abs(p["offset_um"] - 9.0) < 0.1,
                      "the offset")
    output = listener.wait_for(lambda t, _, p: t == topic("sensor/column"), "the sensor")[2]
    assert output["fault"] == "none" and output["blocks"] == ["column"] and output["time"].endswith("Z")
    assert abs(output["raw_degC"] - 17.0) < 0.05
    status = listener.wait_for(lambda t, _, p: t == topic("status") and p.get("compensating"),
                               "the status")[2]
    assert (status["state"], status["daemon"], status["mode"]) == ("online", "here",
                                                                  "compensating")
    assert listener.wait_for(lambda t, _, p: t == topic("alarm"), "alarms")[2]["active"] == []
    # A later subscriber receives everything at once.
    late = lab.also_end(Subscriber(broker))
    for rest in ("status", "alarm", "axis/z", "sensor/column", "sensor/spindle"):
        late.wait_for(lambda t, retained, _, r=rest: t == topic(r) and retained, rest)
    gateway.process.kill()
    gateway.process.wait()
    listener.wait_for(lambda t, _, p: t == topic("status") and p == {"state": "offline"},
                      "the last will")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a process its own /etc/hosts")
def test_a_broker_at_one_address_of_its_name_is_found(lab, machine, broker):
    publisher(lab, machine, broker,
              wrapper=with_addresses_of_localhost(lab.folder, "::1", "127.0.0.1"))
    listener = lab.also_end(Subscriber(broker))
    listener.wait_for(lambda t, _, p: t == topic("status") and p.get("compensating"), "online")


def test_an_orderly_end_publishes_offline_and_alarms_are_raised_and_cleared(lab, machine, broker):
    gateway = publisher(lab, machine, broker)
    listener = lab.also_end(Subscriber(broker))
    listener.wait_for(lambda t, _, p: t == topic("status") and p.get("compensating"), "online")
    machine.module.stop()
    raised = listener.wait_for(
        lambda t, _, p: t == topic("alarm") and
        {a["name"] for a in p["active"]} >= {"compensation", "bus/cabinet"},
        "alarms")[2]
    assert all(alarm["text"] and alarm["since_s"] > 1e9 for alarm in raised["active"])
    machine.module.start()
    machine.module.show(20.0, 20.0)
    listener.wait_for(lambda t, _, p: t == topic("alarm") and p["active"] == [] and p["changed"] and
                      p["changed"]["state"] == "cleared", "all is clear")
    gateway.end()
    listener.wait_for(lambda t, _, p: t == topic("status") and p == {"state": "offline"}, "offline")


def test_a_broker_that_was_away_gets_missed_events(lab, machine, broker):
    gateway = publisher(lab, machine, broker)
    first = lab.also_end(Subscriber(broker))
    first.wait_for(lambda t, _, p: t == topic("axis/z"), "an axis")
    broker.stop()
    eventually(lambda: "thermocomp_gateway_mqtt_connected 0\n" in gateway.text("/metrics"),
               "the loss is noticed")
    for offset_um in (6.0, 12.0, 3.0):
        machine.warm_by(offset_um)
        machine.daemon.wait_for_offset(offset_um)
        gateway.wait_for(lambda s, o=offset_um: abs(s["axes"][0]["offset"] - o) < 0.1, "shown")
    broker.start()
    second = lab.also_end(Subscriber(broker))
    second.wait_for(lambda t, _, p: t == topic("axis/z") and abs(p["offset_um"] - 3.0) < 0.1,
                    "the newest")
    eventually(lambda: "thermocomp_gateway_mqtt_connected 1\n" in gateway.text("/metrics"), "back")
    assert "thermocomp_gateway_mqtt_dropped_total 0\n" in gateway.text("/metrics")


def test_another_program_with_its_client_id_is_reported(lab, machine, broker):
    gateway = publisher(lab, machine, broker)
    # Each takes the broker from the other.
    other = subprocess.Popen(["mosquitto_sub", "-p", str(broker.port), "-i", "thermocomp-mill_3", "-t", "none"],
                             stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        eventually(lambda: 'does another program use client_id = "thermocomp-mill_3"?' in gateway.log.read_text(),
                   "it is reported", patience_s=60.0)
    finally:
        other.kill()
        other.wait()


def test_user_password_and_certificate_are_required(lab, machine):
    certificate, key = make_certificate(lab.folder, "broker")
    passwords = lab.folder / "broker.passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", str(passwords), "mill", "secret"], check=True,
                   capture_output=True)
    passwords.chmod(0o644)
    lab.folder.chmod(0o755)
    key.chmod(0o644)
    broker = Broker(lab.folder, f"allow_anonymous false\npassword_file {passwords}\nuser root\n",
                    f"certfile {certificate}\nkeyfile {key}\n")
    lab.also_end(broker)
    broker.start()
    (lab.folder / "secret").write_text("secret\n")
    other, _ = make_certificate(lab.folder, "other")

    def connected(gateway):
        return "thermocomp_gateway_mqtt_connected 1\n" in gateway.text("/metrics")

    options = 'user = "mill"\npassword_file = "secret"\nauthority = "{}"'
    wrong = publisher(lab, machine, broker, options.format(other))
    eventually(lambda: "mqtt: " in wrong.log.read_text(), "a wrong certificate is refused")
    assert not connected(wrong)
    wrong.end()
    gateway = publisher(lab, machine, broker, options.format(certificate))
    eventually(lambda: connected(gateway), "connected by TLS with a password")


def test_a_broker_that_takes_no_connection_keeps_it_from_nothing(lab, machine):
    """With a full queue of connections it does not answer, like a firewall that drops packets."""
    with socket.socket() as listener, contextlib.ExitStack() as stack:
        listener.bind(("127.0.0.1", 0))
        listener.listen(0)
        for _ in range(4):
            link = stack.enter_context(socket.socket())
            link.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                link.connect(listener.getsockname())
        gateway = Gateway(lab, machine.daemon, "", f'[mqtt]\nhost = "127.0.0.1"\n'
                          f'port = {listener.getsockname()[1]}').start()
        eventually(lambda: "no answer in time" in gateway.log.read_text(), "it is reported")
        gateway.wait_for(lambda s: any("MQTT" in p["what"] for p in s["problems"]), "shown")
        time.sleep(2.0)  # it retries
        began = time.monotonic()
        gateway.end()
        assert time.monotonic() - began < 3.0
