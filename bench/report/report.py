#!/usr/bin/python3
"""See report.sh."""
import argparse
import contextlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
BIN = pathlib.Path(os.environ.get("THERMOCOMP_BIN", HERE.parents[1] / "build/release/bin")).resolve()
PHONE_PX, SCREEN_PX = 390, 1000
sys.path.insert(0, str(HERE.parents[1] / "tests/integration/gateway"))

from chromium import headless  # noqa: E402


def tool(*arguments, cwd):
    begun_s = time.monotonic()
    done = subprocess.run([str(BIN / arguments[0]), *map(str, arguments[1:])], cwd=cwd,
                          capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, arguments))}: {done.returncode}\n{done.stderr}")
    return time.monotonic() - begun_s


def write_week(folder):
    """history.db: a week of the machine, with the model that its first days would have given."""
    for name in ("week_machine.toml", "week_daemon.toml"):
        shutil.copy(HERE / name, folder / name)
    tool("thermocomp", "simulate", "week_machine.toml", "--seed", 8, "-o", "before.csv", cwd=folder)
    tool("thermocomp", "covariance", "--model", HERE / "week_model.toml", "before.csv", "-o",
         "model.toml", cwd=folder)
    tool("thermocomp", "simulate", "week_machine.toml", "--seed", 9, "-o", "week.csv", cwd=folder)
    return tool("bench_recorded_week", "week_daemon.toml", "week.csv", "history.db", cwd=folder)


def test_run(folder, name, share, signals, hours, outputs="x1 x2 z"):
    """A run of six probes' kind: displacement that follows two lumps, times a share."""
    machine = f"format = 1\nduration_h = {hours}\npitch_s = 15.0\n[plant]\nstep_s = 5.0\n{signals}" + (
        "[room]\nmean_degC = 21.0\ndaily_swing_K = 2.5\nwarmest_h = 15.0\nstart_h = 7.0\n"
        "wander_K = 0.2\nwander_tau_s = 3600.0\n")
    gains = {"x1": (0.5, -0.9), "x2": (0.3, -0.5), "y1": (0.1, 0.7), "y2": (0.1, 0.4),
             "z": (1.8, 2.6)}
    for output in outputs.split():
        machine += f'[[output]]\nname = "{output}_um"\nnoise_um = 0.25\n'
    for i, (node, capacity) in enumerate((("spindle", 15e3), ("column", 150e3))):
        terms = ", ".join(f"{output}_um = {share * gains[output][i]:.3f}"
                          for output in outputs.split())
        machine += (f'[[node]]\nname = "{node}"\ncapacity_J_per_K = {capacity}\nroom_W_per_K = 8.0\n'
                    f"displacement_um_per_K = {{ {terms} }}\n"
                    f'[[thermocouple]]\nname = "{node}"\nnode = "{node}"\nnoise_K = 0.05\n')
    machine += ('[[thermocouple]]\nname = "room"\nnode = "room"\nnoise_K = 0.05\n'
                '[[link]]\nbetween = ["spindle", "column"]\nconductance_W_per_K = 10.0\n')
    if signals:
        quantity, at = re.search(r'name = "(\w+)".*values = \[0, (\d+)', signals, re.S).groups()
        machine += (f'[[source]]\nnode = "spindle"\nsignal = "{quantity}"\nheat_W = 300.0\n'
                    f"at = {at}.0\n")
    (folder / f"{name}.toml").write_text(machine)
    tool("thermocomp", "simulate", f"{name}.toml", "--seed", 4 if share == 1.0 else 5, "-o",
         f"{name}.csv", cwd=folder)


def steps(name, value, hours):
    return (f'[[signal]]\nname = "{name}"\nkind = "steps"\n'
            f"times_s = [0, 900, {900 + 3600 * hours}]\nvalues = [0, {value}, 0]\n")


def thermal_tests(folder):
    """Names of the pages."""
    def report(page, *arguments):
        tool("thermocomp", "thermal-test", "report", *arguments, "-o", f"{page}.html", cwd=folder)
        return page

    test_run(folder, "spindle_off", 1.0, steps("spindle_rpm", 6000, 4), 6.5, "x1 x2 y1 y2 z")
    test_run(folder, "spindle_on", 0.2, steps("spindle_rpm", 6000, 4), 6.5, "x1 x2 y1 y2 z")
    test_run(folder, "surroundings", 1.0, "", 24.0, "x1 y1 z")
    test_run(folder, "moving", 1.0, steps("feed_mm_per_min", 12000, 4), 6.5, "x1 x2")
    live = f"{49.5 * 3600:.0f}:{110 * 3600}"
    return [
        report("spindle", "spindle_off.csv", "spindle_on.csv", "--test", "spindle",
               "--distance-mm", "100"),
        report("environment", "surroundings.csv", "--test", "environment"),
        report("axis", "moving.csv", "--test", "axis"),
        report("probings", "history.db@:172800", f"history.db@{live}", "--test", "environment",
               "--noise-um", "0.3"),
    ]


@contextlib.contextmanager
def browser(folder):
    """None where there is none."""
    if not (shutil.which("chromedriver") and shutil.which("chromium")):
        yield None
        return
    with headless(folder) as driver:
        yield driver


def picture(driver, folder, page, width_px):
    """The whole length of a page: (errors and warnings, whether it fits the width)."""
    def measure(height_px):
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
            "width": width_px, "height": height_px, "deviceScaleFactor": 1, "mobile": False})

    measure(800)
    driver.get((folder / f"{page}.html").as_uri())
    measure(driver.execute_script("return document.documentElement.scrollHeight"))
    driver.save_screenshot(str(folder / f"{page}_{width_px}.png"))
    said = [entry for entry in driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
    return len(said), driver.execute_script(
        "return document.documentElement.scrollWidth <= window.innerWidth")


def main():
    parser = argparse.ArgumentParser(description="The pages for a machine's owner; see report.sh.")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for pages and pictures")
    options = parser.parse_args()
    # Sixty thousand commits wait for no disk there.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    folder = pathlib.Path(tempfile.mkdtemp(prefix="report", dir=memory))
    try:
        recorded_s = write_week(folder)
        print(f"a week recorded in {recorded_s:.0f} s, "
              f"{(folder / 'history.db').stat().st_size / 1e6:.0f} MB", file=sys.stderr)
        week_s = tool("thermocomp", "report", "history.db", "-o", "week.html", cwd=folder)
        pages = ["week", *thermal_tests(folder)]
        faults = wide = drawn = 0
        with browser(folder) as driver:
            for page in pages if driver else ():
                for width_px in (SCREEN_PX, PHONE_PX):
                    errors, fits = picture(driver, folder, page, width_px)
                    faults, wide, drawn = faults + errors, wide + (not fits), drawn + 1
        if options.keep:
            options.keep.mkdir(parents=True, exist_ok=True)
            for file in (*folder.glob("*.html"), *folder.glob("*.png")):
                shutil.copy(file, options.keep)
        print(f"report.week_time {week_s:.2f} s")
        for page in pages:
            print(f"report.{page}_page {(folder / (page + '.html')).stat().st_size / 1000:.0f} kB")
        print(f"report.pictures {drawn} pictures")
        print(f"report.pictures_with_errors {faults} errors")
        print(f"report.pictures_wider_than_the_screen {wide} pictures")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
