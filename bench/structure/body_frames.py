#!/usr/bin/python3
"""Frames per second of the rotating page of `structure --page` in headless Chromium with software
rendering: the demonstration's machine and a ball of 200,000 triangles.

    body_frames.py BIN
"""
import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/integration/gateway"))

from chromium import headless  # noqa: E402

ROUNDS, FRAMES, TRIANGLES = 5, 20, 200000
BEGIN, END = '<script id="body" type="application/json">', "</script>"


def ball(count):
    """Nodes and triangles of a bumpy ball, counterclockwise seen from outside."""
    rings = math.isqrt(count // 2)
    nodes, triangles = [], []
    for ring in range(rings + 1):
        for step in range(rings):
            polar, angle = math.pi * (0.001 + 0.998 * ring / rings), 2 * math.pi * step / rings
            radius = 500 + 20 * math.sin(9 * polar) * math.cos(7 * angle)
            nodes += [radius * math.sin(polar) * math.cos(angle), radius * math.sin(polar) * math.sin(angle),
                      radius * math.cos(polar)]
    for ring in range(rings):
        for step in range(rings):
            a, b = ring * rings + step, ring * rings + (step + 1) % rings
            triangles += [a, a + rings, b, b, a + rings, b + rings]
    return nodes, triangles


def with_ball(page):
    head, rest = page.split(BEGIN, 1)
    text, tail = rest.split(END, 1)
    body = json.loads(text)
    body["nodes_mm"], body["triangles"] = ball(TRIANGLES)
    state = dict(body["states"][0], rise_K=body["nodes_mm"][2::3], moved_um=body["nodes_mm"])
    body["states"] = [state]
    return head + BEGIN + json.dumps(body) + END + tail


def frames_per_s(browser, page):
    """Reading a pixel waits for the frame."""
    browser.get(page.as_uri())
    turn = f"""const gl = renderer.getContext(), pixel = new Uint8Array(4), begun = performance.now();
        for (let i = 0; i < {FRAMES}; ++i) {{
          camera.position.x += 1;
          render();
          gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        }}
        return 1000 * {FRAMES} / (performance.now() - begun);"""
    browser.execute_script(turn)
    return statistics.median(browser.execute_script(turn) for _ in range(ROUNDS))


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="body"))
    machine, large = folder / "machine.html", folder / "large.html"
    subprocess.run([pathlib.Path(sys.argv[1]) / "thermocomp-modelling", "structure", ROOT / "config/demo/structure.toml",
                    "-o", folder / "model.toml", "--page", machine], check=True, stdout=sys.stderr)
    large.write_text(with_ball(machine.read_text()))
    with headless(folder, "use-angle=swiftshader", "enable-unsafe-swiftshader", "window-size=1280,860") as browser:
        print(f"body.machine {frames_per_s(browser, machine):.1f} frames/s")
        print(f"body.200000_triangles {frames_per_s(browser, large):.1f} frames/s")


main()
