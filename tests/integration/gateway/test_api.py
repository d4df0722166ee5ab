"""Answers of the gateway equal those of the daemon's socket and history."""

import contextlib
import csv
import gzip
import json
import subprocess
import time

import pytest

from gateway_lab import Gateway, make_certificate, password_line
from lab import eventually, run_tool


def without_times(value):
    """Removes numbers that change constantly, so that two answers can be compared."""
    changing = {"age_s", "uptime_s", "mode_since_s", "compensating_s", "cycle", "socket", "last_commit_age_s",
                "size_MB", "round_trip_ms", "requests", "answers", "writes", "reads", "state_s",
                "rate_K_per_h", "ended", "outside_share_24h", "last_confirmed_s"}
    if isinstance(value, dict):
        return {k: without_times(v) for k, v in value.items() if k not in changing}
    if isinstance(value, list):
        return [without_times(each) for each in value]
    return value


def test_status_and_sensors_are_the_sockets_answers(machine, gateway):
    machine.warm_by(12.0)
    machine.daemon.wait_for_offset(12.0)
    for path, method in (("/api/status", "status"), ("/api/sensors", "sensors")):
        eventually(lambda: without_times(gateway.json(path)) ==
                   without_times(machine.daemon.call(method)), path)
    assert gateway.json("/api/sensors")["sensors"][0]["blocks"] == ["column"]


def test_a_browser_that_takes_gzip_gets_the_same_bytes_in_fewer(gateway):
    gateway.wait_for(lambda s: s["here"], "a state")
    for path in ("/", "/page.js", "/metrics"):
        _, headers, short = gateway.ask(path, headers={"Accept-Encoding": "gzip"})
        assert headers["Content-Encoding"] == "gzip", path
        _, plain_headers, plain = gateway.ask(path)
        assert "Content-Encoding" not in plain_headers and len(short) < 0.6 * len(plain), path
        if path != "/metrics":  # counters increase
            assert gzip.decompress(short) == plain
    assert "Content-Encoding" not in gateway.ask("/api/commands", headers={"Accept-Encoding": "gzip"})[1]


def test_the_stream_follows_the_machine_with_advice(machine, gateway):
    first = gateway.wait_for(lambda s: s["here"], "a state")
    assert first["machine"] == "mill_3"
    assert first["verdict"]["compensating"] and first["verdict"]["level"] == "good", first["problems"]
    machine.warm_by(9.0)
    gateway.wait_for(lambda s: abs(s["axes"][0]["offset"] - 9.0) < 0.05, "the offset is shown")
    machine.module.stop()
    held = gateway.wait_for(lambda s: s["here"] and s["mode"] == "holding", "holding is reported")
    assert held["verdict"]["level"] == "bad"
    output = machine.daemon.cli("status")[1]
    for problem in held["problems"][:2]:
        assert problem["what"] in output  # same text as `thermocomp status`
    assert held["problems"][0]["remedy"] in output
    machine.module.start()
    machine.warm_by(9.0)
    again = gateway.wait_for(lambda s: s["verdict"]["level"] == "good", "it is good again")
    assert any("lasted" in event["text"] for event in again["events"])


def test_a_lost_daemon_is_reported_and_reconnected(machine, gateway):
    gateway.wait_for(lambda s: s["here"], "a state")
    with gateway.events() as next_state:
        next_state()
        machine.daemon.kill()
        gone_s = time.monotonic()
        while next_state()["here"]:
            pass
        assert time.monotonic() - gone_s < 30.0
    status, _, body = gateway.ask("/api/status")
    assert status == 503 and "daemon" in json.loads(body)["error"]
    assert "thermocomp_up 0\n" in gateway.text("/metrics")
    assert "thermocomp_axis_offset" not in gateway.text("/metrics")
    machine.daemon.start()
    gateway.wait_for(lambda s: s["here"], "the daemon is found again")


@pytest.mark.parametrize("end, text", [("end", "daemon stopped"), ("kill", "daemon killed, or the power failed")])
def test_a_restart_keeps_what_happened_and_names_the_time_without_a_daemon(machine, gateway, end, text):
    machine.module.stop()
    gateway.wait_for(lambda s: s["here"] and s["mode"] == "holding", "it holds")
    machine.module.start()
    machine.module.show(20.0, 20.0)
    gateway.wait_for(lambda s: any("lasted" in event["text"] for event in s["events"]), "it is over")
    eventually(lambda: "lasted" in run_tool("events", machine.daemon.history)[1], "it is committed")
    began_s = time.time()
    getattr(machine.daemon, end)()
    ended_s = time.time()
    machine.daemon.start()

    def restarts(state):
        return [event for event in state["events"] if event["text"] == text and "from_s" in event]

    entry, = restarts(gateway.wait_for(lambda s: s["here"] and restarts(s), "the restart"))
    assert began_s - 10.0 < entry["from_s"] <= ended_s <= entry["wall_s"]
    # "over, lasted 3 s"; "2 times, 3 s in all" if the module is slow to answer the new run as well.
    gateway.wait_for(lambda s: s["here"] and any("lasted" in event["text"] or " in all" in event["text"]
                                                 for event in s["events"]), "what happened before the restart")
    machine.daemon.committed()  # the new run's first rows: only they end the time without a daemon

    def with_absence():
        result = gateway.json("/api/history?from=-600")
        return any(mode["mode"] == "no_daemon" for mode in result["modes"]) and result

    result = eventually(with_absence, "the time without a daemon is in the history")
    absent, = [mode for mode in result["modes"] if mode["mode"] == "no_daemon"]
    assert (absent["from_s"], absent["to_s"]) == pytest.approx((entry["from_s"], entry["wall_s"]), abs=0.01)
    assert result["recorded_since_s"] == result["from_s"]
    assert gateway.json("/api/history?from=-0.5")["recorded_since_s"] == result["recorded_since_s"]


def test_history_is_that_of_the_export(machine, gateway, lab):
    machine.warm_by(6.0)
    machine.daemon.wait_for_offset(6.0)

    def settled():
        result = gateway.json("/api/history?from=-60&points=120")
        known = [v for v in result["columns"]["z_offset_um"] if v is not None]
        return known and abs(known[-1] - 6.0) < 0.1 and result

    result = eventually(settled, "the newest mean is that of the offset")
    columns = result["columns"]
    assert result["chunks"] == result["chunks_read"] > 0 and result["damage"] == []
    assert all(len(values) == 120 for values in columns.values())
    assert {"time_s", "column_degC", "spindle_degC", "z_offset_um"} <= set(columns)
    offsets = [v for v in columns["z_offset_um"] if v is not None]
    # Every mean is within the range of the export in its half second.
    assert run_tool("export", machine.daemon.history, "-o", lab.folder / "run.csv")[0] == 0
    with (lab.folder / "run.csv").open() as text:
        rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    exported = [float(row["z_offset_um"]) for row in rows if row["z_offset_um"]]
    assert min(exported) - 1e-6 <= min(offsets) and max(offsets) <= max(exported) + 1e-6


def test_history_has_probings_and_when_nothing_was_compensated(machine, gateway):
    machine.warm_by(6.0)
    machine.daemon.wait_for_offset(6.0)
    machine.daemon.call("measured", axis="z", value_um=1.5, confirm=True)
    settled = eventually(lambda: next((t for t in [gateway.json("/api/history?from=-60&points=5000")]
                                       if t["probings"] and t["probings"][0]["needed_um"]), None),
                         "it is committed, with the offset of its time")
    assert abs(settled["probings"][0]["needed_um"] - 4.5) < 0.2  # 6 um left 1.5 um
    machine.daemon.call("disable")
    result = eventually(lambda: next((t for t in [gateway.json("/api/history?from=-60&points=60")]
                                      if t["modes"] and t["modes"][-1]["mode"] == "disabled"), None),
                        "the mode is committed")
    probing, = result["probings"]
    assert probing["axis"] == "z" and probing["left_um"] == 1.5
    assert any(event["text"].startswith("measured z 1.5 um") for event in result["events"])


def test_a_page_of_a_machine_at_rest_uses_little_cpu(machine, gateway):
    gateway.wait_for(lambda s: s["verdict"]["level"] == "good", "a state")
    with contextlib.closing(gateway.connect()) as link:
        link.request("GET", "/api/events")
        answer = link.getresponse()
        lines = [answer.readline() for _ in range(3 * 40)]
    whole = [line for line in lines if line == b"event: state\n"]
    later = sum(map(len, lines[3:])) / 39
    print(f"a state {len(lines[1])} B, a change {later:.0f} B: {later * 7200 / 1e6:.2f} MB an hour")
    assert len(whole) == 1 and later * 7200 < 2e6


def test_open_pages_leave_a_connection_to_the_metrics(lab, machine):
    gateway = lab.also_end(Gateway(lab, machine.daemon, "connections_max = 4")).start()
    with contextlib.ExitStack() as pages:
        for _ in range(3):
            pages.enter_context(gateway.events())
        status, _, body = gateway.ask("/api/events")
        assert status == 503 and b"connections_max" in body
        assert "thermocomp_up 1" in gateway.text("/metrics")


def test_metrics_are_clean_and_have_every_sensor_axis_and_bus(machine, gateway):
    gateway.wait_for(lambda s: s["verdict"]["level"] == "good", "nothing is wrong")
    text = gateway.text("/metrics")
    checked = subprocess.run(["promtool", "check", "metrics"], input=text, text=True,
                             capture_output=True)
    assert (checked.returncode, checked.stdout + checked.stderr) == (0, "")
    for line in ('thermocomp_up 1', 'thermocomp_compensating 1',
                 'thermocomp_sensor_good{sensor="column",block="column"} 1',
                 'thermocomp_axis_driven{axis="z"} 1',
                 'thermocomp_bus_connected{bus="cabinet",kind="modbus_tcp"} 1'):
        assert line + "\n" in text, line
    machine.warm_by(20.0)
    machine.daemon.wait_for_offset(20.0)

    def offset_m():
        line = next(line for line in gateway.text("/metrics").splitlines()
                    if line.startswith('thermocomp_axis_offset_meters{axis="z"}'))
        return float(line.split()[-1])

    eventually(lambda: abs(offset_m() - 20e-6) < 0.1e-6, "the offset in meters")


def test_check_knows_the_configuration(lab, machine, gateway):
    status, out, _ = run_tool("check", gateway.config)
    assert status == 0 and "gateway of machine mill_3" in out and out.endswith(": OK\n")
    cases = {"port = 0": ("port = 70000", "http.port = 70000: must be"),
             "[http]": ("[http]\ncolour = 1", "http.colour = 1: "),
             'machine = "mill_3"': ('machine = "mill/3"', 'machine = "mill/3": must be'),
             "port = 0\n": ('port = 0\naddress = "0.0.0.0"\n',
                            'http.address = "0.0.0.0": other computers reach')}
    text = gateway.config.read_text()
    for old, (new, output) in cases.items():
        wrong = lab.folder / "wrong.toml"
        wrong.write_text(text.replace(old, new, 1))
        status, _, err = run_tool("check", wrong)
        assert status == 2 and output in err and f"{wrong}:" in err, (new, err)
        started = subprocess.run([str(gateway.process.args[0]), str(wrong)], capture_output=True,
                                 text=True, timeout=60)
        assert started.returncode == 2 and output in started.stderr


def test_check_refuses_the_files_that_the_start_refuses(lab, machine, gateway):
    certificate, key = make_certificate(lab.folder)
    _, other_key = make_certificate(lab.folder, "other")
    passwords, empty, words = (lab.folder / name for name in ("passwords", "empty", "words"))
    passwords.write_text(password_line("maria", "long and secret"))
    empty.write_text("# nobody yet\n")
    words.write_text("maria:secret\n")
    right = {"certificate": certificate, "key": key, "passwords": passwords}
    text = gateway.config.read_text()

    def answers(files, more=""):
        changed = lab.folder / "changed.toml"
        changed.write_text(text.replace("[http]\n", "[http]\n" + "".join(
            f'{name} = "{file}"\n' for name, file in files.items()), 1) + more)
        return run_tool("check", changed), changed

    assert answers(right)[0][0] == 0
    for wrong, output in (({"passwords": empty}, f"{empty}: must have at least one line user:hash"),
                          ({"passwords": words}, f"{words}:1: maria: must be user:hash"),
                          ({"certificate": words}, f"{words}: must be a certificate in PEM"),
                          ({"key": certificate}, f"{certificate}: must be a private key in PEM"),
                          ({"key": other_key}, "must be the key of the certificate")):
        (status, _, err), changed = answers(right | wrong)
        assert status == 2 and output in err and f"http.{next(iter(wrong))} = " in err, (wrong, err)
        started = subprocess.run([str(gateway.process.args[0]), str(changed)], capture_output=True,
                                 text=True, timeout=60)
        assert started.returncode == 2 and output in started.stderr, (wrong, started.stderr)
    (status, _, err), _ = answers(right, f'[mqtt]\nhost = "broker"\nauthority = "{words}"\n')
    assert status == 2 and f"{words}: must be a certificate in PEM" in err, err


def test_the_example_is_complete_and_right(lab):
    from lab import SOURCE
    status, out, err = run_tool("check", SOURCE / "config/examples/gateway.toml")
    assert status == 0, err
    assert "127.0.0.1 port 8420" in out


def test_a_port_in_use_is_reported(lab, machine, gateway):
    other = Gateway(lab, machine.daemon)
    other.config.write_text(other.config.read_text().replace("port = 0",
                                                             f"port = {gateway.port}"))
    done = subprocess.run([str(gateway.process.args[0]), str(other.config)], capture_output=True,
                          text=True, timeout=60)
    assert done.returncode == 1 and str(gateway.port) in done.stderr
