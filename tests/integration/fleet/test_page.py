"""The page of 200 machines in a real browser: three clicks from a hall to the curve of a sensor."""

import http.client
import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

from fill_store import MACHINES, ODD, fill
from fleet_lab import BIN

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "daemon"))
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "gateway"))

from chromium import accessibility_problems, headless  # noqa: E402
from lab import eventually  # noqa: E402

PHONE, DESKTOP = (390, 844), (1400, 1000)
os.environ.setdefault("no_proxy", "127.0.0.1,localhost")


class Page:
    """A running thermocomp-fleet-page with a read-only role."""

    def __init__(self, store, folder):
        store.add_person("page", "fleet_page")
        config = folder / "page.toml"
        config.write_text(f'format = 1\nstore = "{store.local.replace("user=postgres", "user=person_page")}"\n'
                          '[http]\nport = 0\n')
        self.log = (folder / "page.log").open("w")
        self.process = subprocess.Popen([str(BIN / "thermocomp-fleet-page"), str(config)], stdin=subprocess.DEVNULL,
                                        stdout=subprocess.PIPE, stderr=self.log, text=True)
        self.port = json.loads(self.process.stdout.readline())["http"]

    def ask(self, path, method="GET"):
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        link.request(method, path)
        answer = link.getresponse()
        body = answer.read()
        link.close()
        return answer.status, body

    def json(self, path):
        status, body = self.ask(path)
        assert status == 200, body
        return json.loads(body)

    def end(self):
        self.process.terminate()
        assert self.process.wait(30) == 0


def test_keys_of_the_gateways_page_are_refused(tmp_path):
    config = tmp_path / "page.toml"
    for key in ('body = "page.toml"', 'report = "week.html"', "enabled = false"):
        config.write_text(f"format = 1\n[http]\nport = 0\n{key}\n")
        done = subprocess.run([str(BIN / "thermocomp-fleet-page"), str(config)], capture_output=True, text=True, timeout=60)
        assert done.returncode == 2 and f"{config}:4: http.{key.split()[0]}" in done.stderr, done.stderr


@pytest.fixture(scope="module")
def page(server, tmp_path_factory):
    from fleet_lab import Store
    folder = tmp_path_factory.mktemp("page")
    store = Store(server, folder, "page")
    fill(store.ask)
    running = Page(store, folder)
    running.store = store
    yield running
    running.end()


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if not importlib.util.find_spec("selenium") or not shutil.which("chromedriver"):
        pytest.skip("python3-selenium or chromium-driver is not installed")
    with headless(tmp_path_factory.mktemp("browser")) as driver:
        yield driver


def open_page(browser, page, size, path=""):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size == PHONE})
    browser.get("about:blank")
    browser.get(f"http://localhost:{page.port}/{path}")


def all_of(browser, selector):
    return browser.find_elements("css selector", selector)


def texts(browser, selector):
    return browser.execute_script("return [...document.querySelectorAll(arguments[0])].map(e => e.innerText)", selector)


def click(browser, selector, text):
    """Found and clicked at once, since the page may redraw in between."""
    eventually(lambda: browser.execute_script(
        "const e = [...document.querySelectorAll(arguments[0])].find(e => e.innerText.startsWith(arguments[1]));"
        "if (e) e.click(); return Boolean(e)", selector, text), text)


def errors(browser):
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


def fits(browser, size):
    return browser.execute_script("return document.documentElement.scrollWidth") <= size[0]


def picture(browser, name):
    """Screenshot for people, if FLEET_PICTURES names a folder."""
    if folder := os.environ.get("FLEET_PICTURES"):
        browser.save_screenshot(os.path.join(folder, name + ".png"))


@pytest.mark.parametrize("size", [PHONE, DESKTOP], ids=["phone", "desktop"])
def test_three_clicks_from_a_hall_to_the_curve_of_a_sensor(page, browser, size):
    name = f"{'phone' if size == PHONE else 'desktop'}"
    open_page(browser, page, size)
    eventually(lambda: len(all_of(browser, "#machines tbody tr")) == MACHINES, "all machines")
    assert "200 machines, 1 depart" in browser.find_element("id", "summary").text
    assert ODD in texts(browser, "#machines tbody tr")[0]  # problems first
    assert fits(browser, size)
    assert accessibility_problems(browser) == []
    picture(browser, name + "_machines")
    click(browser, "nav button", "hall 2")
    rows = eventually(lambda: 0 < len(texts(browser, "#machines tbody tr")) < MACHINES and
                      texts(browser, "#machines tbody tr"), "the hall's machines")
    assert len(rows) == 40 and "departs from its sisters" in rows[0]
    click(browser, "#machines tbody th a", ODD)
    eventually(lambda: all_of(browser, ".places a"), "the machine's places")
    assert fits(browser, size)
    assert not any("undefined" in text or "NaN" in text for text in texts(browser, "section"))
    assert len(texts(browser, "main table tr")) >= 13  # months
    assert "departs from its sisters in z: head_degC 80 % (9.1 \u00b5m)" in texts(browser, "section")[0]
    assert accessibility_problems(browser) == []
    picture(browser, name + "_machine")
    click(browser, ".places a", "head")
    eventually(lambda: len(all_of(browser, "svg path")) == 21, "its curve and those of twenty sisters")
    assert len(all_of(browser, "svg path.own")) == 1 and fits(browser, size)
    assert accessibility_problems(browser) == []
    picture(browser, name + "_place")
    click(browser, "nav button", "8 h")
    eventually(lambda: texts(browser, "nav button[aria-pressed=true]") == ["8 h"], "the other span")
    browser.execute_script(
        "const svg = document.querySelector('svg'), box = svg.getBoundingClientRect();"
        "svg.dispatchEvent(new PointerEvent('pointermove', {clientX: box.left + box.width / 2, clientY: box.top + 50}))")
    assert "median" in browser.find_element("id", "cursor").text
    assert errors(browser) == []


def test_a_release_shows_the_newest_score_of_its_candidate(page, browser):
    name = page.store.value("SELECT name FROM fleet.machine JOIN fleet.release ON machine = machine.id LIMIT 1")
    open_page(browser, page, DESKTOP)
    browser.execute_script("location.hash = '#/' + arguments[0]", name)
    steps = eventually(lambda: texts(browser, "li li"), "its release")
    assert [step for step in steps if "candidate" in step] == [steps[2]] and steps[2].endswith("over 4 probings"), steps
    assert len(steps) == 4 and "promoted" in steps[-1]


def test_a_machine_is_compared_with_its_sisters(page):
    machines = {machine["name"]: machine for machine in page.json("/api/machines")}
    assert len(machines) == MACHINES
    odd = machines[ODD]
    assert (odd["verdict"], odd["level"]) == ("departs from its sisters", "bad")
    assert (odd["rank"], odd["ranked"]) == (50, 50)  # the largest remainder of its type
    assert odd["remainder_um"] > 3 * odd["claimed_um"]
    assert sum(machine["verdict"] == "silent" for machine in machines.values()) == 5
    months = page.json("/api/machine?name=" + ODD)["months"]
    assert 12 <= len(months) <= 13 and sum(month["departing"] for month in months) in (9, 10)
    result = page.json(f"/api/curves?name={ODD}&column=head_degC&seconds=86400")
    curves = {curve["name"]: curve for curve in result["curves"]}
    assert len(curves) == 21 and result["curves"][-1]["name"] == ODD
    apart = [own - curves["mill_003"]["mean"][curves["mill_003"]["at"].index(point)]
             for point, own in zip(curves[ODD]["at"], curves[ODD]["mean"]) if point in curves["mill_003"]["at"]]
    assert len(apart) > 300 and all(4.0 < each < 6.0 for each in apart)


def test_each_output_is_judged_that_of_a_model_without_a_claimed_error_too(page):
    page.store.ask(
        "INSERT INTO fleet.probing (machine, at, output, displacement_um, measured_um, modelled_um)"
        " SELECT id, now() - interval '2 hours', 'x_um', 90, 90, -0.1 FROM fleet.machine WHERE name = 'mill_011'")
    machine = {each["name"]: each for each in page.json("/api/machines")}["mill_011"]
    assert (machine["verdict"], machine["level"]) == ("the model gives less than half of what was probed", "warning")
    assert (machine["output"], round(machine["remainder_um"], 1), machine["claimed_um"]) == ("x_um", 90.1, None)


def test_missing_objects_are_refused(page):
    for path, status in (("/api/machine?name=nobody", 404), ("/api/machine", 404), ("/api/other", 404),
                         ("/api/curves?name=nobody&column=head_degC&seconds=86400", 404),
                         (f"/api/curves?name={ODD}&column=head_degC&seconds=nan", 400),
                         (f"/api/curves?name={ODD}&column=head_degC&seconds=1e9", 400),
                         ("/../schema/001_store.sql", 404)):
        assert page.ask(path)[0] == status, path
    assert page.ask("/api/machines", "POST")[0] == 405
    assert page.json(f"/api/curves?name={ODD}&column=nothing&seconds=3600")["curves"] == []
    assert page.json("/api/curves?name=" + ODD + "&column=';DROP%20TABLE%20fleet.minute;--&seconds=60")["curves"] == []


def test_it_may_only_read_and_finds_the_store_again(page, server):
    store = page.store
    assert "permission denied" in store.as_person("page", "DELETE FROM fleet.event")[2]
    store.add_person("stranger", "fleet_release")
    assert store.as_person("stranger", "SELECT fleet.page_machines()")[0] != 0
    server.stop("immediate")
    assert page.ask("/api/machines")[0] == 503
    server.start()
    eventually(lambda: page.ask("/api/machines")[0] == 200, "the store is asked again")
