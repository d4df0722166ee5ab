"""The page in a real browser: it follows the machine without errors in the console."""

import importlib.util
import os
import re
import shutil
import time

import pytest

from chromium import accessibility_problems, fresh_tab, headless
from gateway_lab import Broker, Gateway, guarded_gateway, stretch_history
from lab import eventually, run_tool


class Keys:  # of selenium, which may be missing
    ARROW_LEFT = "\ue012"


pytestmark = [
    pytest.mark.skipif(not importlib.util.find_spec("selenium"), reason="python3-selenium is not installed"),
    pytest.mark.skipif(not shutil.which("chromedriver"), reason="chromium-driver is not installed")]

PHONE, WALL = (390, 844), (1920, 1080)


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    # Of all tests, only the guarded gateway has a certificate.
    with headless(tmp_path_factory.mktemp("chromium"), "ignore-certificate-errors") as driver:
        yield driver


@pytest.fixture
def browser(chromium):
    with fresh_tab(chromium):
        yield chromium


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
    """Saves a screenshot if GATEWAY_PICTURES names a folder."""
    if folder := os.environ.get("GATEWAY_PICTURES"):
        browser.save_screenshot(os.path.join(folder, name + ".png"))


def within_s(check, what):
    """Elapsed time, for the documents; not a criterion of this test."""
    begun = time.monotonic()
    eventually(check, what)
    return time.monotonic() - begun


def show(browser, gateway, size, query=""):
    resize(browser, size)
    browser.get(f"http://localhost:{gateway.port}/{query}")
    eventually(lambda: text(browser, "answer") == "yes", "it says that it compensates")


def is_on_first_screen(browser, selector):
    return browser.execute_script(
        "const box = document.querySelector(arguments[0]).getBoundingClientRect();"
        "return box.top >= 0 && box.bottom <= window.innerHeight", selector)


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
    # A history of seconds must be more than one point of an eight-hour chart.
    has_curve(browser)
    assert no_wider_than_the_screen(browser)
    assert accessibility_problems(browser) == []
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


def test_it_reports_problems_and_recovers(machine, gateway, browser):
    show(browser, gateway, PHONE)
    machine.module.stop()
    took = {"sensors lost": within_s(lambda: text(browser, "answer") == "no", "it says no")}
    eventually(lambda: "bus cabinet is not connected" in text(browser, "problem-list"), "and why")
    entry, = browser.find_elements("css selector", "#problem-list li")  # one, not four
    assert "2 sensors, inputs column, spindle" in entry.text
    assert not re.search("thermocomp |systemctl", entry.text), "a command on the page"
    assert "the correction is frozen and the tool may drift from here; do not finish a precise cut" in text(browser, "detail")
    assert re.search(r"held since \d\d:\d\d:\d\d at 0.0 of at most 60", text(browser, "axes"))
    assert is_on_first_screen(browser, "#problem-list li")
    entry.find_element("css selector", "a").click()
    assert browser.execute_script("return document.querySelector('.row:target .name').textContent"
                                  ) == "cabinet (modbus_tcp)"
    picture(browser, "holding")
    machine.module.start()
    machine.module.show(20.0, 20.0)
    eventually(lambda: text(browser, "answer") == "yes", "it says yes again")
    machine.daemon.kill()
    took["daemon gone"] = within_s(lambda: "daemon does not answer" in text(browser, "detail"),
                                   "the daemon is away")
    assert "the controller keeps the last offsets: z " in text(browser, "problem-list")
    assert "systemctl" not in text(browser, "problem-list")
    assert "last known: 0.0 of" in text(browser, "axes")
    assert "grayscale" in browser.execute_script(
        "return getComputedStyle(document.getElementById('axes-section')).filter")
    machine.daemon.start()
    eventually(lambda: text(browser, "answer") == "yes", "the daemon is back")
    gateway.end()
    took["gateway gone"] = within_s(lambda: "gateway does not answer" in text(browser, "detail"),
                                    "the gateway is away")
    assert browser.title == "mill_3: not known"
    gateway.config.write_text(gateway.config.read_text().replace("port = 0",
                                                                 f"port = {gateway.port}"))
    gateway.start()
    took["gateway back"] = within_s(lambda: text(browser, "answer") == "yes", "it is back")
    print("the page showed it after", {name: f"{s:.1f} s" for name, s in took.items()})
    refused = ("ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED", "ERR_EMPTY_RESPONSE",
               "503", "ERR_CONNECTION_RESET")
    assert console(browser, but=refused) == []


def drawn(browser):
    eventually(lambda: browser.execute_script(
        "return document.querySelectorAll('.axis canvas').length") > 0, "a chart")


def has_curve(browser):
    eventually(lambda: browser.execute_script(
        "return table.filter(row => isNumber(row[columns.indexOf('z_offset_um')])).length") > 5, "a curve")


def test_the_axis_card_shows_offset_and_last_remainder(machine, gateway, browser):
    machine.warm_by(9.0)
    machine.daemon.wait_for_offset(9.0)
    show(browser, gateway, PHONE)
    eventually(lambda: "taken out 9.0 of at most 60 µm" in text(browser, "axes"), "what is taken out")
    eventually(lambda: re.search(r"not probed since the start of the history, \d\d:\d\d", text(browser, "axes")),
               "the history is read")
    assert "never compared with a measurement" in text(browser, "axes")
    assert browser.execute_script(
        "return document.querySelector('.meter').getAttribute('aria-valuenow')") == "15"
    machine.daemon.call("measured", axis="z", value_um=1.2, confirm=True)
    machine.warm_by(75.0)  # the page asks for the probing 12 s after it
    eventually(lambda: "1.2 µm left at the last probing, " in text(browser, "axes"), "what was left")
    assert "never compared" not in text(browser, "axes")
    eventually(lambda: "axis z at its bound: 15.0 of 75.0 µm remain" in text(browser, "problem-list"),
               "the bound, with what remains")
    assert "at its bound" in text(browser, "axes")
    picture(browser, "bound")


def test_a_candidate_shows_its_score(machine, gateway, browser, lab):
    new = lab.folder / "new.toml"
    new.write_text(machine.model.read_text().replace("[[3.0, -1.5]]", "[[2.0, -1.5]]"))
    assert machine.daemon.cli("candidate", new)[0] == 0
    machine.warm_by(12.0)  # 4 K colder: model -12 um, candidate -8 um
    machine.daemon.wait_for_offset(12.0, 0.05)
    machine.daemon.call("measured", axis="z", value_um=4.0, confirm=True)
    show(browser, gateway, WALL)
    eventually(lambda: "new.toml: z leaves 0.0 of 4.0 µm, 1 probing, better with " in text(browser, "model"),
               "the score")
    picture(browser, "candidate")


def test_one_cursor_and_one_zoom_for_all_charts(machine, gateway, browser):
    show(browser, gateway, WALL)
    machine.warm_by(9.0)
    machine.daemon.wait_for_offset(9.0)
    browser.execute_script("chooseRange(ranges[0])")
    drawn(browser)
    # Zoom stops at 4 s.
    eventually(lambda: browser.execute_script(
        "const [from, to] = wholeWindow(); return table.length > 10 && to - from > 9000"), "some rows")
    chart = browser.find_element("css selector", ".axis .chart")
    chart.send_keys(Keys.ARROW_LEFT)
    chart.send_keys(Keys.ARROW_LEFT)
    assert re.match(r"at \d\d:\d\d:\d\d", text(browser, "cursor"))
    assert "then" in text(browser, "axes")
    # A row has no temperature if a reading was late.
    eventually(lambda: "°C" in text(browser, "temperature-legend") or chart.send_keys(Keys.ARROW_LEFT),
               "a row with temperatures")
    lines = "return [...document.querySelectorAll('.cursor-line')].filter(e => !e.hidden).length"
    assert browser.execute_script(lines) == 2  # axis and temperatures
    before = browser.execute_script("return timeWindow()")
    assert not browser.find_element("id", "zoom-back").is_displayed()
    chart.send_keys("+")
    windows = browser.execute_script("return [...charts.values()].map(each => each.graph.xAxisRange())")
    assert windows[0] == windows[1] and windows[0][1] - windows[0][0] < before[1] - before[0]
    picture(browser, "zoomed")
    browser.find_element("id", "zoom-back").click()
    assert not browser.find_element("id", "zoom-back").is_displayed()
    assert browser.execute_script("return zoomed") is None
    first = browser.find_element("css selector", "#temperature-legend button")
    first.click()
    assert first.get_attribute("aria-pressed") == "false"
    assert browser.execute_script(
        "return charts.get('temperatures').graph.visibility()") == [False, True]
    labels = browser.execute_script(
        "return [...document.querySelectorAll('.dygraph-axis-label-y')].map(e => e.textContent)")
    assert any("µm" in label for label in labels) and any("°C" in label for label in labels)


def test_a_gap_stays_open(machine, gateway, browser):
    show(browser, gateway, PHONE)
    values = browser.execute_script(
        "spacing_s = 10; columns = ['time_s', 'a_degC'];"
        "table = [0, 10, 20, 30, 200, 210].map(s => [new Date(1000 * s), s === 10 ? null : 1]);"
        "table.splice(4, 0, [new Date(100000), null]); return withGaps(1).map(String)")
    assert values == ["1", "null", "1", "1", "NaN", "1", "1"]


def test_the_time_without_a_daemon_parts_the_curve(machine, gateway, browser):
    parted = ("return [modes.filter(each => each.mode === 'no_daemon').length,"
              " withGaps(columns.indexOf('z_offset_um')).filter(Number.isNaN).length]")
    show(browser, gateway, WALL)
    drawn(browser)
    has_curve(browser)  # a page may be faster than the first offset
    machine.daemon.end()
    eventually(lambda: browser.execute_script(parted) == [1, 0], "it is shaded while it lasts")
    machine.daemon.start()
    eventually(lambda: browser.execute_script(parted) == [1, 1], "the curve goes on beyond it")
    eventually(lambda: "daemon stopped, " in text(browser, "events"), "it is what happened")
    show(browser, gateway, WALL)
    eventually(lambda: browser.execute_script(parted) == [1, 1], "the same from the history")
    assert console(browser) == []
    picture(browser, "restarted")


def test_commands_are_offered_while_they_can_be_given(lab, machine, browser):
    gateway = guarded_gateway(lab, machine.daemon, {"maria": "long-and-secret"},
                              'users = ["maria"]\nmethods = ["enable", "disable", "reference", "accept"]')
    buttons = ("return [...document.querySelectorAll('#command-buttons button')]"
               ".map(each => [each.textContent, each.disabled])")
    resize(browser, PHONE)
    browser.get(f"https://maria:long-and-secret@localhost:{gateway.port}/")  # as in a bookmark
    eventually(lambda: text(browser, "history-note"), "an answer about the history")
    assert "recorded since" in text(browser, "history-note")
    machine.warm_by(12.0)
    eventually(lambda: browser.execute_script(buttons) == [
        ["Switch on", False], ["Switch off", False], ["Take the reference", True]], "no reference now")
    # Until the offset follows, the change of the temperature is the reason.
    eventually(lambda: "Take the reference, not now: axis z has an offset of +" in
               text(browser, "command-why"), "the offset is the reason")
    picture(browser, "commands")
    assert browser.execute_script(
        "const jumped = structuredClone(state); jumped.sensors[0].jump = {size_K: 9, since: 0};"
        "showCommands(jumped);" + buttons)[-1] == ["Accept sensor column", False]
    browser.execute_script("document.querySelectorAll('#command-buttons button')[1].click()")
    eventually(lambda: browser.find_element("id", "confirm-yes").is_displayed(), "it is asked back")
    browser.find_element("id", "confirm-yes").click()
    eventually(lambda: "off" in browser.find_element("id", "verdict").get_attribute("class"), "it is off")
    eventually(lambda: re.search("switch off, by .* for maria", text(browser, "events")), "who did it")
    assert text(browser, "command-answer") == "Switch off: done"
    picture(browser, "off")
    machine.daemon.kill()
    eventually(lambda: {off for _, off in browser.execute_script(buttons)} == {True}, "nobody would do it")
    assert text(browser, "command-answer") == ""


def test_a_week_of_history_is_a_curve_of_a_week(lab, machine, browser):
    machine.warm_by(9.0)
    machine.daemon.wait_for_offset(9.0)
    machine.daemon.end()
    stretch_history(machine.daemon.history, days=8)
    machine.daemon.start()
    gateway = lab.also_end(Gateway(lab, machine.daemon)).start()
    show(browser, gateway, PHONE)
    browser.execute_script("[...document.querySelectorAll('#ranges button')].find(e => e.textContent === 'week').click()")
    days = "const [from, to] = wholeWindow(); return (to - from) / 86.4e6"
    eventually(lambda: 6.9 < browser.execute_script(days) < 7.1, "a week")
    assert browser.execute_script("return table.filter(row => isNumber(row[1])).length") > 100
    assert text(browser, "history-note") == ""
    picture(browser, "week_of_history")


@pytest.mark.parametrize("size", [PHONE, WALL])
def test_on_the_wall_a_cause_is_whole_and_the_charts_fill_the_rest(machine, gateway, browser, size):
    show(browser, gateway, size, "?wall")
    drawn(browser)
    assert "spindle 20.0 °C" in text(browser, "hottest")
    machine.module.stop()
    eventually(lambda: "not connected" in text(browser, "problem-list"), "the cause")
    eventually(lambda: "spindle 20.0 °C lost since" in text(browser, "hottest"), "its last value")
    assert browser.find_elements("css selector", "#hottest .old")
    whole = browser.execute_script(
        "const list = document.getElementById('problems');"
        "return list.scrollHeight <= list.clientHeight + 1 && list.getBoundingClientRect().bottom <= innerHeight")
    assert whole
    if size == WALL:
        bottom = browser.execute_script(
            "return document.getElementById('axes-section').getBoundingClientRect().bottom")
        assert 1040 <= bottom <= 1080
        ticks_px = browser.execute_script(
            "return parseFloat(getComputedStyle(document.querySelector('.dygraph-axis-label')).fontSize)")
        assert ticks_px >= 22
        eventually(lambda: browser.execute_script(
            "return [...document.querySelectorAll('.axis .dygraph-axis-label-x')].every(e =>"
            "e.getBoundingClientRect().bottom <="
            " document.getElementById('axes-section').getBoundingClientRect().bottom)"),
            "the times stand inside the card")
    picture(browser, f"wall_{size[0]}")


def test_the_weeks_report_is_one_click_away(lab, machine, browser):
    report = lab.folder / "week.html"
    gateway = lab.also_end(Gateway(lab, machine.daemon, http=f'report = "{report}"')).start()
    assert gateway.ask("/report")[0] == 404  # the weekly timer has not run yet
    machine.warm_by(6.0)
    machine.daemon.wait_for_offset(6.0)
    eventually(lambda: run_tool("report", machine.daemon.history, "--machine", "mill 3", "-o", report)[0] == 0, "rows are committed")
    show(browser, gateway, PHONE)
    link = browser.find_element("id", "report")
    eventually(link.is_displayed, "the page leads to it")
    link.click()
    eventually(lambda: browser.title.startswith("mill 3: "), "the machine's report")
    assert no_wider_than_the_screen(browser)
    assert accessibility_problems(browser) == []
    picture(browser, "week")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everything_can_be_read_and_touched(machine, gateway, browser, scheme):
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {
        "features": [{"name": "prefers-color-scheme", "value": scheme}]})
    show(browser, gateway, PHONE)
    drawn(browser)
    assert accessibility_problems(browser) == []
    small = browser.execute_script(
        "return [...document.querySelectorAll('button')].filter(e => e.offsetParent).map(e =>"
        "[e.textContent, e.getBoundingClientRect()]).filter(([, b]) => b.width < 44 || b.height < 44)"
        ".map(([text]) => text)")
    assert small == []
    assert browser.execute_script(
        "return [...document.querySelectorAll('.chart')].every(e => e.getAttribute('aria-label'))")
    picture(browser, "phone_" + scheme)
    machine.daemon.kill()
    eventually(lambda: "does not answer" in text(browser, "detail"), "the daemon is away")
    assert accessibility_problems(browser) == []
    browser.execute_script("document.body.append(document.createElement('button'), Object.assign("
                           "document.createElement('p'), {textContent: 'faint', style: 'color: #999; background: #aaa'}))")
    assert {each.split(":")[0] for each in accessibility_problems(browser)} == {
        "color-contrast", "button-name", "region"}  # outside main


def test_a_lost_broker_is_reported_and_reconnected(lab, machine, browser):
    broker = lab.also_end(Broker(lab.folder)).start()
    gateway = lab.also_end(Gateway(lab, machine.daemon, "", f'[mqtt]\nhost = "localhost"\n'
                                   f'port = {broker.port}')).start()
    show(browser, gateway, PHONE)
    eventually(lambda: text(browser, "problem-list") == "", "nothing is wrong")
    broker.stop()
    took = {"gone": within_s(lambda: "MQTT broker" in text(browser, "problem-list"), "it is reported")}
    assert "start the broker" in text(browser, "problem-list")
    assert text(browser, "answer") == "yes"
    picture(browser, "broker")
    broker.start()
    took["back"] = within_s(lambda: text(browser, "problem-list") == "", "it is found again")
    print("the page showed it after", {name: f"{s:.1f} s" for name, s in took.items()})


def test_a_wrong_clock_is_reported(machine, gateway, browser):
    resize(browser, PHONE)
    browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {
        "source": "const now = Date.now; Date.now = () => now() - 7230000;"})
    browser.get(f"http://localhost:{gateway.port}/")
    took_s = within_s(lambda: "2 h 0 min ahead of" in text(browser, "problem-list"),
                      "the clocks differ")
    print(f"the page showed it after {took_s:.1f} s")


def test_names_cannot_become_a_part_of_the_page(machine, gateway, browser):
    show(browser, gateway, PHONE)
    planted = browser.execute_script(
        "const evil = JSON.parse(JSON.stringify(state));"
        "evil.machine = evil.sensors[0].name = evil.axes[0].name = '<img src=x onerror=alert(1)>';"
        "evil.problems = [{what: evil.machine, remedy: evil.machine}]; show(evil); drawAll();"
        "return document.querySelectorAll('img').length")
    assert planted == 0
