"""PageFiles dropped on the page in a real browser, and what was recorded got back from it."""

import pytest

from ros_visualise.ui import ViewOptions
from ros_visualise.ui.file_chooser import FileChooser
from ros_visualise.ui.page import Page

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
def chooser(tmp_path):
    return FileChooser(tmp_path, tmp_path)


@pytest.fixture
def page(port, runtime, chooser, tmp_path):
    shown = Page(ViewOptions(port=port, record_dir=tmp_path, chooser=chooser))
    shown.open(runtime)
    yield shown
    shown.close()


def test_drop_record_and_download(browse, chooser, tmp_path):
    tab = browse("?layout={~panel~:~files~}", images=False)
    tab.get_by_role("button", name="● Record").wait_for(timeout=60_000)
    tab.set_default_timeout(90_000)
    tab.evaluate(DROP, SIZE)
    asked = None
    while asked is None:
        tab.wait_for_timeout(50)
        asked = chooser.take()
    assert asked == (tmp_path / "a.mp4", False)
    assert asked.what.read_bytes() == bytes([7]) * SIZE
    assert (tmp_path / "a.srt").read_bytes() == b"12:00"

    tab.get_by_role("button", name="● Record").click()
    tab.get_by_role("button", name="■ Stop recording").click()
    with tab.expect_download() as download:
        tab.click("[data-download]")
    name = download.value.suggested_filename
    download.value.save_as(tmp_path / "got")
    assert (tmp_path / "got").read_bytes() == (tmp_path / name).read_bytes() != b""
