"""Questions of the tests to a page in the browser, and a clock for paced playing."""

import time

import numpy as np


class Clock:
    """Time that passes when somebody sleeps or computes."""

    now = 1000.0

    def monotonic(self):
        return self.now

    def sleep(self, duration):
        assert duration >= 0.0
        self.now += duration


def opened(browser, url):
    browser.get("about:blank")
    browser.get_log("browser"), browser.get_log("performance")
    browser.get(url)
    until(lambda: browser.execute_script("return Boolean(window.fingerPlayer)"))
    browser.execute_script("fingerPlayer.pause()")
    return browser


def seek(page, t):
    page.execute_script("fingerPlayer.pause(); fingerPlayer.seek(arguments[0]);", t)


def until(condition, patience=120.0):
    """Wait for the browser, which renders in software here."""
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline, "the page did not react"
        time.sleep(0.02)


def painted(page):
    """Wait until the browser has painted what was changed, in the second of two frames, however long they take."""
    page.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")


def console_errors(page):
    # What the software renderer says about its own speed is no error of the page.
    return [line for line in page.get_log("browser") if line["source"] != "rendering"]


def ring_centres(page, tendon):
    """Centre line of a tendon's tube in the base frame, shape (P, 3), m."""
    script = """
    const { tube } = fingerPlayer.scene.tendons.find((t, i) => fingerPlayer.config.tendons[i].name === arguments[0]);
    return Array.from(tube.geometry.attributes.position.array);"""
    vertices = np.reshape(page.execute_script(script, tendon), (-1, 10, 3))
    return vertices.mean(axis=1)


def tendon_colour(page, tendon, ring=0):
    script = """
    const { tube } = fingerPlayer.scene.tendons.find((t, i) => fingerPlayer.config.tendons[i].name === arguments[0]);
    return Array.from(tube.geometry.attributes.color.array.slice(30 * arguments[1], 30 * arguments[1] + 3));"""
    return page.execute_script(script, tendon, ring)
