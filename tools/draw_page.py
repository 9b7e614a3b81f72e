"""Draw docs/images/page.jpg and page_phone.jpg: the page before a simulated head that is asked to look at the cube."""

import asyncio
import tempfile
from pathlib import Path

from vergence_bringup.page_address import page_address
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup, config_dir
from vergence_bringup.ros.simulated_head import simulated_head
from vergence_common.domains import own_domain  # noqa: TID251 - it runs nodes
from vergence_rig.rig_file import load_rig, write_rig
from vergence_sim.heads import HeadParameters
from vergence_sim.heads import simulated_head as simulated_rig
from vergence_web.testing.chromium import Tab, chromium, find_chromium

IMAGES = Path(__file__).resolve().parent.parent / "docs" / "images"
STARTED_S, VERGED_S, HISTORY_S = 120.0, 120.0, 25.0


async def draw(browser: str, url: str) -> None:
    """Draw both pictures of the page at `url`."""
    async with chromium(browser) as running:
        tab = await running.tab(1440, 1040)
        await tab.open(url)
        await tab.wait_for("window.vergence?.images.left > 2 && vergence.samples > 2", STARTED_S)
        await tab.wait_for("document.querySelector('[data-detected=cube]') !== null", STARTED_S)
        await asyncio.sleep(HISTORY_S / 2)
        await tab.click("[data-detected=cube]")
        await tab.wait_for("document.getElementById('goal').dataset.result", VERGED_S)
        await asyncio.sleep(HISTORY_S / 2)
        await _top(tab)
        await tab.screenshot(IMAGES / "page.jpg")
        phone = await running.tab()
        await phone.set_size(390, 844, 2.0, phone=True)
        await phone.open(url)
        await phone.wait_for("window.vergence?.images.left > 2 && vergence.samples > 2", STARTED_S)
        await phone.click("[data-mode=anaglyph]")
        await asyncio.sleep(2.0)
        await _top(phone)
        await phone.screenshot(IMAGES / "page_phone.jpg")


async def _top(tab: Tab) -> None:
    await tab.value("scrollTo(0, 0)")
    await asyncio.sleep(1.0)


def main() -> None:
    """Run the head, described as it is, in simulated time, and draw."""
    browser = find_chromium()
    if browser is None:
        raise SystemExit("no Chromium is installed here")
    with tempfile.TemporaryDirectory() as folder, own_domain() as domain:
        rig = Path(folder) / "rig.yaml"
        write_rig(rig, simulated_rig(HeadParameters(), load_rig(config_dir() / "rig.yaml")))
        commands = simulated_head(rig, simulated_time=True, **{"clock.stepped": False})
        page = {"rig": str(rig), "use_sim_time": True, "port": 0}
        commands["web_node"] = NodeCommand.of("web_node", page)
        with ProcessGroup(Path(folder) / "log", {"ROS_DOMAIN_ID": str(domain)}) as nodes:
            for name, command in commands.items():
                nodes.start(name, command)
            url = page_address(Path(folder) / "log" / "web_node.log", nodes.check)
            asyncio.run(draw(browser, url))


if __name__ == "__main__":
    main()
