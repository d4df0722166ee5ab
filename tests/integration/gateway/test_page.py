"""The page in a real browser: no error in its console, and it follows the machine."""

import importlib.util
import os
import shutil
import time

import pytest

from chromium import headless
from gateway_lab import Broker, Gateway
from lab import eventually

pytestmark = [
    pytest.mark.skipif(not importlib.util.find_spec("selenium"), reason="python3-selenium is not installed"),
    pytest.mark.skipif(not shutil.which("chromedriver"), reason="chromium-driver is not installed")]

PHONE, WALL = (390, 844), (1920, 1080)


@pytest.fixture
def browser(lab):
    with headless(lab.folder) as driver:
        yield driver


def resize(browser, size):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size == PHONE})


def text(browser, place):
    return browser.find_element("id", place).text


def console(browser, but=()):
    return [entry["message"] for entry in browser.get_log("browser")
            if entry["level"] in ("SEVERE", "WARNING") and
            not any(known in entry["message"] for known in but)]


def picture(browser, name):
    """For people: where GATEWAY_PICTURES names a folder."""
    if folder := os.environ.get("GATEWAY_PICTURES"):
        browser.save_screenshot(os.path.join(folder, name + ".png"))


def within_s(check, what):
    """How long it took; that is the claim of the document, not of this test."""
    begun = time.monotonic()
    eventually(check, what)
    return time.monotonic() - begun


def show(browser, gateway, size, query=""):
    resize(browser, size)
    browser.get(f"http://localhost:{gateway.port}/{query}")
    eventually(lambda: text(browser, "answer") == "yes", "it says that it compensates")


def no_wider_than_the_screen(browser):
    return browser.execute_script(
        "return document.documentElement.scrollWidth <= window.innerWidth")


@pytest.mark.parametrize("size, query", [(PHONE, ""), (WALL, ""), (WALL, "?wall")])
def test_it_loads_without_an_error_and_fits_the_screen(machine, gateway, browser, size, query):
    show(browser, gateway, size, query)
    machine.warm_by(9.0)
    machine.daemon.wait_for_offset(9.0)
    took_s = within_s(lambda: "+9.0" in text(browser, "axes"), "the offset")
    print(f"the page shows the daemon's offset after {took_s:.2f} s")
    eventually(lambda: browser.execute_script(
        "return document.querySelectorAll('.axis canvas').length") > 0, "a chart")
    assert no_wider_than_the_screen(browser)
    assert console(browser) == []
    assert browser.find_element("id", "sensors").is_displayed() == (query == "")
    if query == "":
        assert "column" in text(browser, "sensors") and "cabinet" in text(browser, "buses")
        assert "never, with measured displacement" in text(browser, "model")
        assert text(browser, "events")
    weight = browser.execute_script(
        "return performance.getEntriesByType('resource').filter(e => !e.name.includes('/api/'))"
        ".concat(performance.getEntriesByType('navigation'))"
        ".reduce((sum, e) => sum + e.transferSize, 0)")
    assert weight <= 250000
    elsewhere = browser.execute_script(
        "return performance.getEntriesByType('resource').map(e => e.name)"
        ".filter(name => !name.startsWith(location.origin))")
    assert elsewhere == []


def test_it_says_what_is_wrong_and_recovers(machine, gateway, browser):
    show(browser, gateway, PHONE)
    machine.module.stop()
    took = {"sensors lost": within_s(lambda: text(browser, "answer") == "no", "it says no")}
    eventually(lambda: "no good sensor left" in text(browser, "problem-list"), "and why")
    assert "mend the sensor or its bus" in text(browser, "problem-list")
    picture(browser, "holding")
    machine.module.start()
    machine.module.show(20.0, 20.0)
    eventually(lambda: text(browser, "answer") == "yes", "it says yes again")
    machine.daemon.kill()
    took["daemon gone"] = within_s(lambda: "daemon does not answer" in text(browser, "detail"),
                                   "the daemon is away")
    machine.daemon.start()
    eventually(lambda: text(browser, "answer") == "yes", "the daemon is back")
    gateway.end()
    took["gateway gone"] = within_s(lambda: "gateway does not answer" in text(browser, "detail"),
                                    "the gateway is away")
    gateway.config.write_text(gateway.config.read_text().replace("port = 0",
                                                                 f"port = {gateway.port}"))
    gateway.start()
    took["gateway back"] = within_s(lambda: text(browser, "answer") == "yes", "it is back")
    print("the page said so after", {name: f"{s:.1f} s" for name, s in took.items()})
    refused = ("ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED", "ERR_EMPTY_RESPONSE",
               "503", "ERR_CONNECTION_RESET")
    assert console(browser, but=refused) == []


def test_a_broker_that_is_gone_is_told_and_found_again(lab, machine, browser):
    broker = lab.also_end(Broker(lab.folder)).start()
    gateway = lab.also_end(Gateway(lab, machine.daemon, "", f'[mqtt]\nhost = "localhost"\n'
                                   f'port = {broker.port}')).start()
    show(browser, gateway, PHONE)
    eventually(lambda: text(browser, "problem-list") == "", "nothing is wrong")
    broker.stop()
    took = {"gone": within_s(lambda: "MQTT broker" in text(browser, "problem-list"), "it is told")}
    assert "start the broker" in text(browser, "problem-list")
    assert text(browser, "answer") == "yes"
    picture(browser, "broker")
    broker.start()
    took["back"] = within_s(lambda: text(browser, "problem-list") == "", "it is found again")
    print("the page said so after", {name: f"{s:.1f} s" for name, s in took.items()})


def test_a_clock_that_is_wrong_is_told(machine, gateway, browser):
    resize(browser, PHONE)
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {
        "source": "const now = Date.now; Date.now = () => now() - 7230000;"})
    browser.get(f"http://localhost:{gateway.port}/")
    took_s = within_s(lambda: "2 h 0 min ahead of" in text(browser, "problem-list"),
                      "the clocks differ")
    print(f"the page said so after {took_s:.1f} s")


def test_names_cannot_become_a_part_of_the_page(machine, gateway, browser):
    show(browser, gateway, PHONE)
    planted = browser.execute_script(
        "const evil = JSON.parse(JSON.stringify(state));"
        "evil.machine = evil.sensors[0].name = evil.axes[0].name = '<img src=x onerror=alert(1)>';"
        "evil.problems = [{what: evil.machine, remedy: evil.machine}]; show(evil); drawAll();"
        "return document.querySelectorAll('img').length")
    assert planted == 0
