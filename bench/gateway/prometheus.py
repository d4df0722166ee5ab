#!/usr/bin/python3
"""See prometheus.sh."""
import argparse
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/integration/gateway"), str(ROOT / "tests/integration/daemon")]

from gateway_lab import Gateway  # noqa: E402
from lab import Lab, eventually, free_port  # noqa: E402
from plain_devices import Machine  # noqa: E402

RULES = ROOT / "gateway/monitoring/thermocomp_alerts.yml"
SCRAPE_S = 5
# Time of a rule's `for` (at most two minutes) and some scrapes.
ALERT_PATIENCE_S = 200
WITHOUT_MODULE = ("ThermocompBusAway", "ThermocompSensorLost", "ThermocompNotCompensating")
WITHOUT_DAEMON = ("ThermocompDaemonAway",)


def promtool(*arguments, text=None):
    """Its output; empty if all is well, except for the count of rules."""
    done = subprocess.run(["promtool", *map(str, arguments)], input=text, text=True,
                          capture_output=True)
    if done.returncode != 0:
        raise SystemExit(f"promtool {arguments}: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


class Prometheus:
    def __init__(self, folder, target):
        self.port = free_port()
        self.log = folder / "prometheus.log"
        config = folder / "prometheus.yml"
        config.write_text(
            f"global: {{scrape_interval: {SCRAPE_S}s, evaluation_interval: {SCRAPE_S}s}}\n"
            f"rule_files: [{RULES}]\n"
            f"scrape_configs: [{{job_name: thermocomp, static_configs: [{{targets: [{target}]}}]}}]\n")
        promtool("check", "config", config)
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                ["prometheus", f"--config.file={config}", f"--storage.tsdb.path={folder / 'tsdb'}",
                 f"--web.listen-address=127.0.0.1:{self.port}"],
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=folder)
        eventually(self.is_ready, "prometheus is ready", 60)

    def is_ready(self):
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/-/ready", timeout=5) as answer:
                return answer.status == 200
        except OSError:
            return False

    def ask(self, path, **parameters):
        address = f"http://127.0.0.1:{self.port}/api/v1/{path}?{urllib.parse.urlencode(parameters)}"
        with urllib.request.urlopen(address, timeout=20) as answer:
            return json.load(answer)["data"]

    def figure(self, expression):
        result = self.ask("query", query=expression)["result"]
        return float(result[0]["value"][1]) if result else float("nan")

    def firing(self):
        return {alert["labels"]["alertname"] for alert in self.ask("alerts")["alerts"]
                if alert["state"] == "firing"}

    def complaints(self):
        """Lines of its log about samples out of order or doubled, or failed rules."""
        return re.findall(r".*level=(?:warn|error).*", self.log.read_text())


def wait_for_alerts(prometheus, wanted, what):
    begun_s = time.monotonic()
    eventually(lambda: time.sleep(0.5) or prometheus.firing() == set(wanted), what, ALERT_PATIENCE_S)
    return time.monotonic() - begun_s


def run(lab, seconds):
    machine = Machine(lab)
    machine.start()
    gateway = lab.also_end(Gateway(lab, machine.daemon)).start()
    warnings = ""
    rules = promtool("check", "rules", RULES)
    prometheus = lab.also_end(Prometheus(lab.folder, f"127.0.0.1:{gateway.port}"))
    begun_s = time.monotonic()

    def check_metrics(state):
        nonlocal warnings
        findings = promtool("check", "metrics", text=gateway.text("/metrics"))
        warnings += findings
        print(f"{time.monotonic() - begun_s:.0f} s: {state}; promtool: {findings or 'nothing'}",
              file=sys.stderr, flush=True)

    eventually(lambda: prometheus.figure("thermocomp_compensating") == 1.0, "it is scraped")
    time.sleep(6 * SCRAPE_S)
    assert prometheus.firing() == set(), prometheus.firing()
    check_metrics("compensating, no alert")
    machine.module.stop()
    fired_s = wait_for_alerts(prometheus, WITHOUT_MODULE, "bus and sensors are missed")
    check_metrics("without the module, " + ", ".join(WITHOUT_MODULE) + " fire")
    machine.module.start()
    machine.module.show(20.0, 20.0)
    ended_s = wait_for_alerts(prometheus, (), "bus and sensors are back")
    check_metrics("with the module, no alert")
    machine.daemon.kill()
    away_s = wait_for_alerts(prometheus, WITHOUT_DAEMON, "the daemon is missed")
    check_metrics("without the daemon, ThermocompDaemonAway fires")
    machine.daemon.start()
    back_s = wait_for_alerts(prometheus, (), "the daemon is back")
    check_metrics("with the daemon, no alert")
    time.sleep(max(0.0, seconds - (time.monotonic() - begun_s)))
    assert prometheus.firing() == set(), prometheus.firing()
    check_metrics("end, no alert")

    took_s = time.monotonic() - begun_s
    over = f"[{int(took_s)}s]"
    up = 'up{job="thermocomp"}'
    for complaint in prometheus.complaints():
        print("prometheus: " + complaint, file=sys.stderr)
    print(f"gateway.scraped_for {took_s:.0f} s")
    scrapes = prometheus.figure(f"count_over_time({up}{over})")
    print(f"gateway.scrapes {scrapes:.0f} scrapes")
    print(f"gateway.scrapes_failed {scrapes - prometheus.figure(f'sum_over_time({up}{over})'):.0f} scrapes")
    print("gateway.scrape_worst "
          f"{1e3 * prometheus.figure(f'max_over_time(scrape_duration_seconds{over})'):.1f} ms")
    print(f"gateway.samples_a_scrape {prometheus.figure('scrape_samples_scraped'):.0f} samples")
    print(f"gateway.promtool_warnings {len(warnings.splitlines())} lines")
    print(f"gateway.prometheus_complaints {len(prometheus.complaints())} lines")
    print(f"gateway.alert_rules {re.search('([0-9]+) rules found', rules).group(1)} rules")
    print(f"gateway.alerts_without_module {fired_s:.0f} s")
    print(f"gateway.alerts_ended_with_module {ended_s:.0f} s")
    print(f"gateway.alert_without_daemon {away_s:.0f} s")
    print(f"gateway.alert_ended_with_daemon {back_s:.0f} s")


def main():
    parser = argparse.ArgumentParser(description="A real Prometheus beside the gateway.")
    parser.add_argument("--seconds", type=float, default=600.0)
    options = parser.parse_args()
    if not (shutil.which("prometheus") and shutil.which("promtool")):
        raise SystemExit("prometheus is not installed")
    lab = Lab(pathlib.Path(tempfile.mkdtemp(prefix="prometheus")))
    try:
        run(lab, options.seconds)
    finally:
        lab.end()
        shutil.rmtree(lab.folder, ignore_errors=True)


if __name__ == "__main__":
    main()
