# Copyright 2026 the drive_can_bridge authors. Licensed under the Apache License, Version 2.0.
"""A browser that is looked at and clicked in."""

import base64
from collections.abc import Callable
from functools import cache
import json
from pathlib import Path
import re
import shutil
from typing import Any

from waiting import wait_for

#: columns and lines
DESKTOP, PHONE = (1280, 1020), (390, 844)
_CHART = 'getElement(document.querySelector(".chart").id.slice(1)).chart.getOption()'


@cache
def browser_missing() -> str:
    """Say what is missing; '' if there is a browser."""
    missing = [name for name in ('chromium', 'chromedriver') if shutil.which(name) is None]
    return f'no {" and no ".join(missing)}: .ci/browser installs them' if missing else ''


class Browser:
    """
    A browser with one page.

    :param directory: a place of its own.
    :param phone: as large as a phone, and touched.
    """

    def __init__(self, directory: Path, *, phone: bool = False) -> None:
        # imported late: whoever finds it missing can say so
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service
        options = webdriver.ChromeOptions()
        options.binary_location = str(shutil.which('chromium'))
        for argument in (
                # as root, as CI may be, it does not run in its own sandbox
                '--headless=new', '--no-sandbox', '--disable-dev-shm-usage', '--disable-gpu',
                '--disable-background-networking', '--disable-component-update', '--no-first-run',
                f'--user-data-dir={directory / ("phone" if phone else "desktop")}',
                f'--window-size={DESKTOP[0]},{DESKTOP[1]}'):
            options.add_argument(argument)
        if phone:
            options.add_experimental_option('mobileEmulation', {'deviceMetrics': {
                'width': PHONE[0], 'height': PHONE[1], 'pixelRatio': 2.0, 'touch': True}})
        options.set_capability('goog:loggingPrefs', {'browser': 'ALL', 'performance': 'ALL'})
        self._driver = webdriver.Chrome(
            options=options, service=Service(str(shutil.which('chromedriver'))))
        self._requests: list[str] = []
        self.complaints: list[str] = []
        #: complaint that belongs to the test
        self.expected = ''

    def open(self, address: str) -> None:
        """Open a page."""
        self._driver.get(address)

    def refresh(self) -> None:
        """Load the page again."""
        self._driver.refresh()

    @property
    def address(self) -> str:
        """What stands in the address line."""
        return str(self._driver.current_url)

    @property
    def text(self) -> str:
        """All that can be read."""
        return str(self.run('return document.body.innerText'))

    def shows(self, pattern: str) -> None:
        """Wait until something can be read."""
        expression = re.compile(pattern, re.DOTALL)
        try:
            wait_for(lambda: expression.search(self.text), pattern)
        except AssertionError as error:
            raise AssertionError(f'{error}; there is: {self.text}') from error

    def gone(self, pattern: str) -> None:
        """Wait until something cannot be read any more."""
        wait_for(lambda: not re.search(pattern, self.text, re.DOTALL), f'the end of {pattern}')

    def run(self, script: str) -> Any:
        """Run a script in the page."""
        return self._driver.execute_script(script)

    def find_all(self, selector: str) -> list[Any]:
        """Find elements."""
        found: list[Any] = self._driver.find_elements('css selector', selector)
        return found

    def click(self, selector: str, text: str) -> None:
        """Click what has a text, as soon as it is there."""
        def clicked() -> bool:
            for element in self.find_all(selector):
                if text in element.text:
                    element.click()
                    return True
            return False
        self._done(clicked, f'{text} to be clicked')

    def _done(self, action: Callable[[], bool], what: str) -> None:
        """Wait until it could be done, with elements that may be drawn, or move, meanwhile."""
        from selenium.common import exceptions

        def done() -> bool:
            try:
                return action()
            except (exceptions.StaleElementReferenceException,
                    exceptions.ElementNotInteractableException,
                    exceptions.ElementClickInterceptedException):
                return False
        wait_for(done, what)

    def _keys(self, selector: str, *texts: str) -> None:
        def typed() -> bool:
            for field in self.find_all(selector)[:1]:
                for text in texts:
                    field.send_keys(text)
                return True
            return False
        self._done(typed, f'{selector} to be typed into')

    def value(self, drive: str, name: str) -> str:
        """Return a value of a drive's card."""
        return str(self.run(
            f'const names = [...document.querySelectorAll(\'[data-drive="{drive}"] .what\')];'
            f'const found = names.find((each) => each.textContent == "{name}");'
            'return found ? found.nextElementSibling.textContent : ""'))

    # -- parameters -------------------------------------------------------------------------------

    def search(self, words: str) -> None:
        """Search in the parameters."""
        self._keys('.search input', words)

    def field(self, name: str) -> str | None:
        """Return what stands in the field of a parameter."""
        found: str | None = self.run(
            f'const field = document.querySelector(\'[data-parameter="{name}"] input\');'
            'return field && field.value')
        return found

    def type(self, name: str, text: str) -> None:
        """Type a value."""
        from selenium.webdriver.common.keys import Keys
        self._keys(f'[data-parameter="{name}"] input', Keys.CONTROL + 'a', text)

    def write(self, name: str, text: str) -> None:
        """Type a value and press Enter."""
        from selenium.webdriver.common.keys import Keys
        self.type(name, f'{text}{Keys.ENTER}')

    # -- charts -----------------------------------------------------------------------------------

    def points(self) -> int:
        """Return how many points the first line has."""
        return int(self.run(f'const series = {_CHART}.series; '
                            'return series.length ? series[0].data.length : 0'))

    def axis_end(self) -> float:
        """Return the newest time in the chart, in ms."""
        return float(self.run(f'return {_CHART}.xAxis[0].max'))

    def zooms(self, start: float, end: float) -> None:
        """See a part, in percent, as the wheel would."""
        self.run('getElement(document.querySelector(".chart").id.slice(1)).chart.dispatchAction('
                 f'{{type: "dataZoom", start: {start}, end: {end}}})')

    def zoom(self) -> list[float]:
        """Return the part that is seen, in percent."""
        return list(self.run(f'const zoom = {_CHART}.dataZoom[0]; return [zoom.start, zoom.end]'))

    # -- what one does not see --------------------------------------------------------------------

    @property
    def fits(self) -> bool:
        """Nothing is wider than the window."""
        return bool(self.run(
            'return document.documentElement.scrollWidth <= window.innerWidth'))

    def requests(self) -> list[str]:
        """Return the addresses of all requests and WebSockets so far."""
        for entry in self._driver.get_log('performance'):
            message = json.loads(entry['message'])['message']
            if message['method'] == 'Network.requestWillBeSent':
                self._requests.append(message['params']['request']['url'])
            elif message['method'] == 'Network.webSocketCreated':
                self._requests.append(message['params']['url'])
        return self._requests

    def picture(self, path: Path) -> None:
        """Save what is seen, down to where the page ends, in the format of the suffix."""
        width, seen, end = self.run(
            'return [innerWidth, innerHeight, Math.max(...[...document.querySelectorAll('
            '".page, .page *")].map(each => each.getBoundingClientRect().bottom)) + 12]')
        taken = self._driver.execute_cdp_cmd('Page.captureScreenshot', {
            'clip': {'x': 0, 'y': 0, 'width': width, 'height': min(seen, end), 'scale': 1},
            'format': path.suffix[1:], **({'quality': 80} if path.suffix == '.webp' else {})})
        path.write_bytes(base64.b64decode(taken['data']))

    def close(self) -> None:
        """Close it, and keep what it has complained of."""
        self.complaints += [entry['message'] for entry in self._driver.get_log('browser')
                            if entry['level'] == 'SEVERE'
                            and not (self.expected and self.expected in entry['message'])]
        self._driver.quit()
