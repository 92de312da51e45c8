"""`python -m docs.site.look`: the built site in a browser without a network, as a reader sees it.

Every page at the width of a laptop: nothing is cut off, every picture is there, no formula is left as it was
written, nothing is fetched from elsewhere. And the search finds something. Without Chromium it says so.
"""

import sys
from pathlib import Path

from tests.browser import CHROMIUM, Browser

SITE = Path(__file__).resolve().parents[2] / "out" / "docs"
WIDTH, HEIGHT = 1366, 768
#: what is wrong with a page, in words; "" if nothing
LOOK = r"""(() => {
  const wide = document.documentElement.scrollWidth - innerWidth
  if (wide > 0) return `wider than the window by ${wide} px`
  const text = document.querySelector("article").cloneNode(true)
  text.querySelectorAll("code, pre, math").forEach(e => e.remove())
  const formula = text.innerText.match(/\\\(|\\\[|\$\$|\\[a-z]+\{/)
  if (formula) return `a formula is not drawn: ${formula[0]}`
  const images = [...document.images].filter(i => !i.complete || !i.naturalWidth)
  if (images.length) return `no picture ${images[0].src}`
  const far = [...document.querySelectorAll("script[src], link[rel=stylesheet], img")]
    .map(e => e.src || e.href).filter(u => !u.startsWith("file:") && !u.startsWith("data:"))
  return far.length ? `from elsewhere: ${far[0]}` : ""
})()"""
LOADED = "document.readyState == 'complete' && !!document.querySelector('article')"
FOUND = "document.querySelectorAll('.md-search-result__link').length"


def look(browser: Browser) -> list[str]:
    """What is wrong with the pages of the site, a line each."""
    wrong = []
    for page in sorted(SITE.glob("*.html")):
        if page.stem == "404":
            continue  # of servers
        browser.open(page)
        browser.wait_for(f"location.pathname.endsWith('/{page.name}') && {LOADED}")
        if fault := browser.evaluate(LOOK):
            wrong.append(f"{page.name}: {fault}")
    return wrong


def search(browser: Browser, words: str) -> int:
    """How many results the search of the start page shows; it is typed as on a keyboard."""
    browser.open(SITE / "index.html")
    browser.wait_for(f"location.pathname.endsWith('/index.html') && {LOADED}")
    browser.evaluate("document.querySelector('input[name=query]').focus()")
    browser.call("Input.insertText", text=words[:-1])
    browser.call("Input.dispatchKeyEvent", type="keyDown", key=words[-1], text=words[-1])
    browser.call("Input.dispatchKeyEvent", type="keyUp", key=words[-1])
    browser.wait_for(FOUND)
    return browser.evaluate(FOUND)


def main() -> int:
    if not CHROMIUM:
        print("the site is not looked at: Chromium is not here")
        return 0
    with Browser() as browser:
        view = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
        browser.call("Emulation.setDeviceMetricsOverride", **view)
        wrong = look(browser)
        found = search(browser, "limit point")
        print(f"{len(list(SITE.glob('*.html'))) - 1} pages looked at; the search gives {found} places")
    print(*wrong, sep="\n", file=sys.stderr)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
