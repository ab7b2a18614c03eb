"""What a browser has loaded."""

import json

import pytest


@pytest.fixture
def loaded(browser):
    """A function that returns what pages have loaded since it was asked last, but for the browser's own pages."""

    def urls():
        events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
        requests = [
            each["params"]["request"]["url"] for each in events if each["method"] == "Network.requestWillBeSent"
        ]
        return [url for url in requests if not url.startswith(("data:", "about:", "blob:", "chrome"))]

    return urls
