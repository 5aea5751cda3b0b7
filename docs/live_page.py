"""Draw docs/live.png: the live page while an arm follows a movement as it was drawn.

python docs/live_page.py arm.agent virtual:seed=7
"""

import io
import math
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from live.browser import opened_browser  # noqa: E402
from live.serving import served  # noqa: E402
from pneumarm.live.live_arm import LiveArm  # noqa: E402
from pneumarm.run import RunSettings  # noqa: E402

_COLORS = 256
_GOALS = (25, -20, 10)  # degrees
_PLACE = """(degrees) => {
  const turned = degrees * Math.PI / 180, point = new DOMPoint(210 * Math.sin(turned), 210 * Math.cos(turned));
  const at = point.matrixTransform(document.getElementById("arm").getScreenCTM());
  return [at.x, at.y];
}"""


def draw(agent: str, arm: str) -> None:
    """Move ``arm`` by ``agent`` on the page, and draw that."""
    with served(LiveArm(RunSettings(arm=arm), [agent], None)) as server, opened_browser() as browser:
        page = browser.new_page(viewport={"width": 1240, "height": 800}, color_scheme="light")
        page.goto(server.url)
        page.locator("body[data-role=writer]").wait_for()
        for degrees in _GOALS:
            page.mouse.click(*page.evaluate(_PLACE, degrees))
            page.wait_for_timeout(2300)
        box = page.locator("#paper").bounding_box()
        assert box is not None
        for k in range(61):
            share = k / 60
            up = 0.5 + 0.3 * math.sin(9 * share) * math.exp(-0.6 * share)
            page.mouse.move(box["x"] + 4 + share * (box["width"] - 8), box["y"] + box["height"] * (1 - up))
            if k == 0:
                page.mouse.down()
        page.mouse.up()
        page.wait_for_timeout(3600)
        shot = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    shot.quantize(_COLORS, dither=Image.Dither.NONE).save(ROOT / "docs" / "live.png", optimize=True)


if __name__ == "__main__":
    draw(*sys.argv[1:])
