"""Files dropped on the page in a real browser, and what was recorded got back from it."""

import pytest

from ros_visualise.ui.page import Page
from ros_visualise.ui.shelf import Shelf

SIZE = 150_000
DROP = """size => {
    const dropped = new DataTransfer();
    dropped.items.add(new File([new Uint8Array(size).fill(7)], "a.mp4"));
    dropped.items.add(new File(["12:00"], "a.srt"));
    for (const kind of ["dragover", "drop"])
        document.body.dispatchEvent(
            new DragEvent(kind, { dataTransfer: dropped, bubbles: true, cancelable: true }));
}"""


@pytest.fixture
def shelf(tmp_path):
    return Shelf(tmp_path, tmp_path)


@pytest.fixture
def page(port, runtime, shelf, tmp_path):
    shown = Page(port=port, record_dir=tmp_path, shelf=shelf)
    shown.open(runtime)
    yield shown
    shown.close()


def test_drop_record_and_download(browse, shelf, tmp_path):
    tab = browse()
    tab.set_default_timeout(90_000)
    tab.evaluate(DROP, SIZE)
    asked = None
    while asked is None:
        tab.wait_for_timeout(50)
        asked = shelf.take()
    assert asked == tmp_path / "a.mp4"
    assert asked.read_bytes() == bytes([7]) * SIZE
    assert (tmp_path / "a.srt").read_bytes() == b"12:00"

    tab.get_by_role("button", name="● record").click()
    tab.get_by_role("button", name="■ stop recording").click()
    with tab.expect_download() as download:
        tab.click("a[data-download]")
    name = download.value.suggested_filename
    download.value.save_as(tmp_path / "got")
    assert (tmp_path / "got").read_bytes() == (tmp_path / name).read_bytes() != b""
