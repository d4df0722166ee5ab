"""The page of `structure --page`, standalone and behind the gateway."""

import importlib.util
import json
import pathlib
import re
import shutil
import subprocess

import pytest

from chromium import accessibility_problems, headless
from gateway_lab import BIN, Gateway
from lab import eventually

MODELLING = pathlib.Path(BIN) / "thermocomp-modelling"
LIBRARY = pathlib.Path("/usr/share/javascript/three/three.min.js")

pytestmark = [
    pytest.mark.skipif(not importlib.util.find_spec("selenium"), reason="python3-selenium is not installed"),
    pytest.mark.skipif(not shutil.which("chromedriver"), reason="chromium-driver is not installed"),
    pytest.mark.skipif(not MODELLING.exists(), reason="thermocomp-modelling is not in this build"),
    pytest.mark.skipif(not LIBRARY.exists(), reason="libjs-three is not installed")]

# The blocks are the inputs of the machine's model. The 0.6 m column expands by 6.6 um/K.
STRUCTURE = """format = 1
[[material]]
name = "cast_iron"
youngs_modulus_GPa = 110.0
poisson_ratio = 0.25
expansion_um_per_m_K = 11.0
[[part]]
name = "column"
material = "cast_iron"
size_mm = [200, 200, 200]
[[part.box]]
from_mm = [0, 0, 0]
to_mm = [200, 200, 600]
[[part]]
name = "spindle"
material = "cast_iron"
size_mm = [100, 100, 100]
[[part.box]]
from_mm = [50, 50, 600]
to_mm = [150, 150, 800]
[[joint]]
name = "spindle_on_column"
from = { part = "spindle", z_mm = [600, 600] }
to = { part = "column", z_mm = [600, 600] }
[[spring]]
on = { part = "column", z_mm = [0, 0] }
stiffness_N_per_um = [1000, 1000, 1000]
[[block]]
name = "column_degC"
on = { part = "column" }
[[block]]
name = "spindle_degC"
on = { part = "spindle" }
[[output]]
name = "z_um"
direction = [0, 0, 1]
tool = { part = "spindle", at_mm = [100, 100, 800] }
"""


# In the first two of three hours the column warms by 4 K, the spindle by 10 K; a reading is missing.
COURSE = "time_s,column_degC,spindle_degC\n" + "".join(
    f"{60 * row},{20 + 4 * row / 120},{'' if row == 60 else 20 + 10 * row / 120}\n" for row in range(181))


@pytest.fixture
def page(tmp_path):
    (tmp_path / "small.toml").write_text(STRUCTURE)
    (tmp_path / "monday.csv").write_text(COURSE)
    made = subprocess.run([MODELLING, "structure", "small.toml", "-o", "model.toml", "--page", "body.html",
                           "--run", "monday.csv@0:7201"], cwd=tmp_path, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return tmp_path / "body.html"


@pytest.fixture
def browser(lab):
    with headless(lab.folder, "use-angle=swiftshader", "enable-unsafe-swiftshader") as driver:
        yield driver


def console(browser):
    return [entry["message"] for entry in browser.get_log("browser")
            if entry["level"] == "SEVERE" or "Content Security" in entry["message"]]


def text(browser, place):
    return browser.find_element("id", place).text


def colours_drawn(browser):
    """Number of different colours in the picture."""
    return browser.execute_script("""
        render();
        const gl = renderer.getContext(), pixels = new Uint8Array(4 * gl.drawingBufferWidth * gl.drawingBufferHeight);
        gl.readPixels(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        const found = new Set();
        for (let i = 0; i < pixels.length; i += 4) found.add(pixels[i] << 16 | pixels[i + 1] << 8 | pixels[i + 2]);
        return found.size;""")


def choose(browser, place, value):
    browser.execute_script(
        "place(arguments[0]).value = arguments[1]; place(arguments[0]).dispatchEvent(new Event('change'))",
        place, value)


def test_the_page_needs_nothing_else(page, browser):
    browser.get(page.as_uri())
    assert console(browser) == []
    assert accessibility_problems(browser) == []
    assert "://" not in browser.execute_script(
        "return [...document.querySelectorAll('[src],link')].map(e => e.src || e.href).join()")
    choose(browser, "group", "column_degC 1 K warm")
    choose(browser, "quantity", "z")
    # The 600 mm column expands by 6.6 um and carries the spindle.
    assert 6.0 < float(text(browser, "high").split()[0]) < 7.2, text(browser, "high")
    assert colours_drawn(browser) > 20
    assert "tool, z_um at 100, 100, 800 mm" in text(browser, "points")
    choose(browser, "group", "monday")
    assert text(browser, "when") == "monday after 2.00 h"
    # 600 mm by 4 K and 200 mm by 10 K are 48 um.
    assert 44.0 < float(text(browser, "high").split()[0]) < 51.0, text(browser, "high")
    moved_um = re.match(r"tool against work: z (\S+) µm$", text(browser, "outputs"))
    assert 44.0 < float(moved_um[1]) < 51.0, text(browser, "outputs")
    browser.execute_script("place('time').value = 0; drawChosen()")
    assert text(browser, "when") == "monday after 0.0 min" and "z 0.0 µm" in text(browser, "outputs")
    choose(browser, "quantity", "rise")
    assert text(browser, "high") == "10.0 K"


def test_behind_the_gateway_it_shows_the_machine_as_it_is_now(page, lab, machine, browser):
    gateway = lab.also_end(Gateway(lab, machine.daemon, http=f'body = "{page}"')).start()
    browser.get(f"http://localhost:{gateway.port}/")
    link = browser.find_element("id", "body")
    eventually(link.is_displayed, "the page leads to it")
    machine.warm_by(-9.0)  # the column rises by 3 K
    status = lambda: json.loads(gateway.text("/api/status"))
    eventually(lambda: abs(status()["axes"][0]["offset"]) > 8.9, "the machine is warm")
    column = next(each for each in status()["inputs"] if each["name"] == "column_degC")
    link.click()
    eventually(lambda: text(browser, "when") == "now", "it shows the machine")
    rise_K = column["temp_degC"] - column["reference_degC"]
    eventually(lambda: abs(float(text(browser, "high").split()[0]) - rise_K) < 0.02 * rise_K,
               "its hottest place is as warm as the column")
    assert text(browser, "outputs").startswith("tool against work: z ")
    assert console(browser) == []
    machine.module.stop()
    eventually(lambda: "without" in text(browser, "when"), "the inputs are lost")
    assert text(browser, "outputs") == ""  # undefined with a partial sum
    machine.daemon.end()
    eventually(lambda: "old" in text(browser, "when") or "does not answer" in text(browser, "when"),
               "it says that the machine does not answer")
