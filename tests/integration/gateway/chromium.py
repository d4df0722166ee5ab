"""Headless Chromium for tests and benchmarks of the pages."""

import contextlib
import functools
import re
import shutil
import urllib.request

import pytest


@contextlib.contextmanager
def headless(folder, *arguments):
    """@param folder  receives its profile
    @param arguments  further command line options without dashes"""
    from selenium import webdriver  # optional; callers handle its absence
    options = webdriver.ChromeOptions()
    for argument in ("headless", "no-sandbox", "disable-gpu", "disable-dev-shm-usage",
                     "disable-background-networking", "hide-scrollbars",
                     f"user-data-dir={folder / 'browser'}", *arguments):
        options.add_argument("--" + argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.chrome.service.Service(shutil.which("chromedriver"))
    driver = webdriver.Chrome(options=options, service=service)
    try:
        yield driver
    finally:
        driver.quit()


@contextlib.contextmanager
def fresh_tab(driver):
    """A new tab, which has no overrides of an earlier test, in a browser without its cookies, its cache and its
    messages. Origins differ by their ports."""
    old = driver.current_window_handle
    driver.switch_to.new_window("tab")
    new = driver.current_window_handle
    driver.switch_to.window(old)
    driver.close()
    driver.switch_to.window(new)
    driver.execute_cdp_cmd("Network.clearBrowserCookies", {})
    driver.execute_cdp_cmd("Network.clearBrowserCache", {})
    driver.get_log("browser")
    yield
    driver.get("about:blank")  # nothing of this page is running when its gateway ends


@functools.cache
def axe_core(address):
    """Source of axe-core, which Chromium contains for Lighthouse.
    @param address  of its debugger
    @return a JavaScript literal; "" if this Chromium has none"""
    bundle = f"http://{address}/devtools/third_party/lighthouse/lighthouse-dt-bundle.js"
    with urllib.request.urlopen(bundle) as answer:
        found = re.search(r"`/\*! axe v(?:\\.|[^`\\])*`", answer.read().decode(), re.DOTALL)
    return found[0] if found else ""


def accessibility_problems(driver):
    """Accessibility problems found by axe-core."""
    literal = axe_core(driver.capabilities["goog:chromeOptions"]["debuggerAddress"])
    if not literal:
        pytest.skip("this Chromium carries no axe-core")
    if not driver.execute_script("return window.axe !== undefined"):
        driver.execute_script(driver.execute_script("return " + literal))
    driver.set_script_timeout(60)
    return driver.execute_async_script("""
        const done = arguments[0];
        axe.run(document, {resultTypes: ['violations']}).then(
            found => done(found.violations.flatMap(each => each.nodes.map(node => each.id + ': ' + node.target))),
            error => done([String(error)]));""")
