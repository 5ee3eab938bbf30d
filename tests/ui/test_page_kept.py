"""What is arranged on the page is kept in a file."""

import pytest
from page_client import Client

from ros_visualise.errors import OpenError
from ros_visualise.runtime.saving import write_yaml
from ros_visualise.ui.arrangements import read_arrangement
from ros_visualise.ui.page import Page


def test_a_file_arranges_the_page(port, runtime, tmp_path):
    write_yaml({"filters/threshold": 60, "windows/filters": False}, tmp_path / "l.yaml")
    page = Page(port=port, arrangement=read_arrangement(tmp_path / "l.yaml"), record_dir=tmp_path)
    page.open(runtime)
    client = Client(port)
    client.read_until(lambda: runtime.parameters["filters"].current.threshold == 60)
    client.read_until(lambda: client.values["filters"] is False)
    client.set("layout", "mine.yaml")
    client.set("save layout", True)
    client.read_until(lambda: (tmp_path / "mine.yaml").exists())
    client.read_until(lambda: (tmp_path / "mine.yaml").read_text() != "")
    found = read_arrangement(tmp_path / "mine.yaml")
    assert found == {"filters/threshold": 60, "windows/filters": False}
    client.socket.close()
    page.close()


@pytest.mark.parametrize("text", ["[1, 2]", "a: {b: 1}", "1: 2", "a: [1]"])
def test_files_that_are_no_layout(tmp_path, text):
    (tmp_path / "l.yaml").write_text(text)
    with pytest.raises(OpenError, match="must hold PLACE: VALUE"):
        read_arrangement(tmp_path / "l.yaml")
    with pytest.raises(OpenError, match="save layout"):
        read_arrangement(tmp_path / "none.yaml")
