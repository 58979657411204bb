"""Rate of frames in a drag in the editor: `python test/drag_rate.py [SCENE [JOINT]]`.

A joint goes round a small circle for three seconds, by a move of the mouse every 8 ms. Frames are
those that the page has drawn; CPU is that of the server's process and of the page's main thread.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from browsing import OPTIONS, program
from playwright.sync_api import sync_playwright
from running import command

from mechanism_sim import process_exit

SPAN = 3.0  # [s]
EVERY = 0.008  # [s]
RADIUS = 12.0  # [pixels]


def cpu_of(process: int) -> float:
    """CPU time [s] of a process so far."""
    fields = Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def measure(scene: str = 'four_bar_clearance', joint: str = '') -> None:
    """Drag a joint of a scene and print what it takes."""
    server = process_exit.start(
        command('edit', scene, '--port', '0', '--json'), text=True, stdout=subprocess.PIPE,
        cwd=tempfile.gettempdir(),
    )  # fmt: skip
    assert server.stdout is not None
    text = ''
    while '}' not in text:
        text += server.stdout.readline()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program(), args=list(OPTIONS))
        page = browser.new_page(viewport={'width': 1440, 'height': 900})
        page.goto(json.loads(text)['address'])
        page.wait_for_selector('html[data-run]:not([data-run=""])', state='attached')
        knobs = page.locator('.knob.joint')
        names = [knob.get_attribute('data-handle') for knob in knobs.all()]
        name = joint or names[len(names) // 2]
        box = page.locator(f'[data-handle="{name}"]').bounding_box()
        x, y = box['x'] + 0.5 * box['width'], box['y'] + 0.5 * box['height']
        session = page.context.new_cdp_session(page)
        session.send('Performance.enable')

        def now() -> tuple[float, float, float, int]:
            told = session.send('Performance.getMetrics')['metrics']
            busy = next(m['value'] for m in told if m['name'] == 'TaskDuration')
            frames = int(page.evaluate('document.documentElement.dataset.frames ?? 0'))
            return time.monotonic(), cpu_of(server.pid), busy, frames

        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + RADIUS, y, steps=20)
        before = now()
        k = 0
        while time.monotonic() < before[0] + SPAN:
            k += 1
            turn = 2.0 * math.pi * k * EVERY
            page.mouse.move(x + RADIUS * math.cos(turn), y + RADIUS * math.sin(turn))
            time.sleep(max(0.0, before[0] + k * EVERY - time.monotonic()))
        span, own, busy, frames = (a - b for a, b in zip(now(), before, strict=True))
        arrows = page.locator('#stage .forces path[d^="M"]').count()
        page.mouse.up()
        browser.close()
    server.kill()
    print(
        f'{scene}, {name}: {frames / span:.0f} frames a second; CPU of a frame: server '
        f'{1e3 * own / frames:.1f} ms, page {1e3 * busy / frames:.1f} ms; {arrows} forces drawn'
    )


if __name__ == '__main__':
    measure(*sys.argv[1:])
