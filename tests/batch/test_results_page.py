"""``batch view`` shows the results on a page, and opens a recording at a moment."""

import http.client
import re
import socket
from contextlib import closing
from urllib.parse import urlsplit

import pytest
from made_flights import ask

from ros_visualise.batch.page import ResultsPage
from ros_visualise.batch.results import Results
from ros_visualise.core.errors import OpenError
from ros_visualise.ui.server.access import access_rules

HOST = "127.0.0.1"


def get(port: int, path: str) -> tuple[http.client.HTTPResponse, str]:
    with closing(http.client.HTTPConnection(HOST, port, timeout=60)) as connection:
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer, answer.read().decode()


@pytest.fixture
def page(once):
    """The port and the tokens of the page of some results."""
    with socket.socket() as free:
        free.bind((HOST, 0))
        port = free.getsockname()[1]
    rules = access_rules(HOST)
    with closing(ResultsPage(Results(once / "out"), HOST, port, rules)):
        yield port, rules


def test_recordings_and_moments_are_listed(page, once):
    port, rules = page
    assert get(port, "/")[0].status == 403
    answer, text = get(port, f"/{rules.token}")
    assert answer.status == 200
    names = ask(once / "out", "SELECT recording FROM '{}/recordings.parquet'")
    assert all(name in text for (name,) in names)
    assert text.count("<svg") == 4
    links = re.findall(r'href="(/[^"]*/open[^"]*)"', text)
    assert len(links) >= 10 + 20
    assert get(port, f"/{rules.token}/open?recording=other")[0].status == 404
    assert get(port, f"/{rules.view_token}/open?recording=film_00.mkv")[0].status == 403


def test_a_click_opens_a_recording_at_a_moment(page):
    port, rules = page
    answer, _ = get(port, f"/{rules.token}/open?recording=film_03.mkv&t_ns=200000000")
    assert answer.status == 303
    address = urlsplit(answer.headers["Location"])
    assert get(address.port, address.path)[0].status == 200


def test_a_folder_without_results_is_rejected(tmp_path):
    with pytest.raises(OpenError):
        ResultsPage(Results(tmp_path), HOST, 8080, access_rules(HOST))
