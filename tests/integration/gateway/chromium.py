"""A headless Chromium, for the tests of the page and the benchmarks that draw pages."""

import contextlib
import shutil


@contextlib.contextmanager
def headless(folder, *arguments):
    """@param folder  gets its profile
    @param arguments  further ones of the command line, without their dashes"""
    from selenium import webdriver  # not everywhere; who calls says what without it
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
