"""A headless Chromium, for the tests of the pages and the benchmarks that draw them."""

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


CONTRAST = """
const parse = text => (text.match(/[\\d.]+/g) || []).map(Number);
const light = rgb => rgb.slice(0, 3).map(c => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
  .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
const under = e => { for (; e; e = e.parentElement) {
  const c = parse(getComputedStyle(e).backgroundColor); if (c.length === 3 || c[3] === 1) return c; } return [255, 255, 255]; };
return [...document.querySelectorAll('body *')].filter(e => e.offsetParent &&
    [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim() && n.textContent !== '\u25cf'))
  .map(e => { const a = light(parse(getComputedStyle(e).color)), b = light(under(e));
    return [(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), e.textContent.slice(0, 40)]; })
  .filter(([ratio]) => ratio < 4.5).map(([ratio, text]) => `contrast ${ratio.toFixed(2)}: ${text}`);
"""
STRUCTURE = """
const ids = [...document.querySelectorAll('[id]')].map(e => e.id);
const levels = [...document.querySelectorAll('h1, h2, h3, h4')].filter(e => e.offsetParent).map(e => +e.tagName[1]);
return [...new Set(ids.filter((id, i) => ids.indexOf(id) !== i))].map(id => 'id twice: ' + id)
  .concat(levels.some((level, i) => level > (levels[i - 1] || 0) + 1) ? ['headings leave out a level: ' + levels] : [])
  .concat(document.documentElement.lang && document.title ? [] : ['no language or title']);
"""
CONTROLS = {"button", "link", "textbox", "combobox", "checkbox", "radio", "slider", "image", "img", "dialog", "meter",
            "progressbar"}


def accessibility_problems(driver):
    """What keeps somebody out who sees little, or uses no mouse: too little contrast (WCAG 2.1, 4.5), a control or
    picture without a name in the browser's own accessibility tree, an id that stands twice, headings out of order."""
    nodes = driver.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    nameless = [node["role"]["value"] for node in nodes
                if not node.get("ignored") and node.get("role", {}).get("value") in CONTROLS
                and not node.get("name", {}).get("value", "").strip()]
    return (driver.execute_script(CONTRAST) + driver.execute_script(STRUCTURE)
            + [f"a {role} without a name" for role in nameless])
