"""What a browser may have recorded: new files in one folder, by their names."""

from pathlib import Path

import pytest
from page_client import Client
from rosbags.highlevel import AnyReader

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.sinks.names import record_folder
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    for path in (tmp_path / "none", tmp_path / "a\0b", tmp_path / ("x" * 300)):
        with pytest.raises(UsageError):
            record_folder(path)
    with pytest.raises(OpenError, match="no such folder to record to; create it first"):
        record_folder(Path(__file__))


def test_a_browser_stays_in_the_folder(port, runtime, tmp_path: Path) -> None:
    (folder := tmp_path / "run@" / "day1").mkdir(parents=True)
    (folder / "link.mcap").symlink_to(tmp_path / "outside.mcap")
    (folder / "link").symlink_to(tmp_path, target_is_directory=True)
    (folder / "old.mcap").write_text("precious")
    before = {path: path.lstat().st_mtime_ns for path in tmp_path.rglob("*")}
    page = Page(ViewOptions(port=port, record_dir=folder))
    page.open(runtime)
    client = Client(port)
    client.read_until(lambda: "File" in client.values)
    refused = {
        str(tmp_path / "away.mcap"): "give a plain name",
        "../away.mcap": "give a plain name",
        ".hidden.mcap": "give a plain name",
        "a\0b.mcap": "contains control characters",
        "x" * 250 + ".mcap": "give one of at most 200",
        "r.txt": "ends in .mcap, .bag or .mp4",
        "link.mcap": "leaves the folder",
        "link": "leaves the folder",
        "old.mcap": "exists",
        "r.mcap@/../../x": "give a plain name",
        "a@/../../x.bag": "give a plain name",
        "edges.mp4@/edges": "give a plain name",
    }
    for name, said in refused.items():
        client.html.clear()
        client.set("File", name)
        client.set("● Record", True)
        client.read_until(lambda said=said: any(said in html for html in client.html))
    assert {path: path.lstat().st_mtime_ns for path in tmp_path.rglob("*")} == before

    for topic in ("/image_raw", "/controlled_stream", "/processed_image"):
        client.set(topic, False)
    client.set("File", "fine.mcap")
    client.set("● Record", True)
    client.read_until(lambda: any(f"{folder}/fine.mcap:" in html for html in client.html))
    client.read_until(lambda: any(" MB, about " in html for html in client.html))
    assert any(f" of space left in {folder}" in html for html in client.html)
    client.set("● Record", True)
    client.read_until(lambda: client.values["File"].startswith("record-"))
    with AnyReader([folder / "fine.mcap"]) as reader:
        assert set(reader.topics) == {"/edges", "/parameter_events"}
    client.close()
    page.close()


def test_a_split_that_is_none_is_refused(port, runtime, tmp_path: Path) -> None:
    (folder := tmp_path / "here").mkdir()
    (folder / "old_2.mcap").write_text("precious")
    (folder / "link_0.mcap").symlink_to(tmp_path / "outside.mcap")
    page = Page(ViewOptions(port=port, record_dir=folder))
    page.open(runtime)
    client = Client(port)
    client.read_until(lambda: "Split" in client.values)
    assert client.values["Split"] == ""
    refused = {
        ("r.mcap", "5"): "split 5: give bytes as 1G or 500M",
        ("r.bag", "10M30s"): "split 10M30s: give bytes as 1G or 500M",
        ("r", "0s"): "split 0s: give bytes as 1G or 500M",
        ("r.mcap", "<b>"): "split &lt;b&gt;: give bytes as 1G or 500M",
        ("v.mp4", "1G"): "a video is not split",
        ("old.mcap", "1G"): "old_2.mcap exists",
        ("link.mcap", "1G"): "link_0.mcap exists",
        ("../away.mcap", "1G"): "give a plain name",
    }
    for (name, split), said in refused.items():
        client.html.clear()
        client.set("File", name)
        client.set("Split", split)
        client.set("● Record", True)
        client.read_until(lambda said=said: any(said in html for html in client.html))
    assert sorted(path.name for path in tmp_path.rglob("*")) == [
        "here",
        "link_0.mcap",
        "old_2.mcap",
    ]
    client.close()
    page.close()


def test_a_browser_saves_all_parameters(port, runtime, tmp_path: Path) -> None:
    runtime.parameters["filters"].update({"blur": "median"})
    (tmp_path / "old.yaml").write_text("precious")
    page = Page(ViewOptions(port=port, record_dir=tmp_path))
    page.open(runtime)
    client = Client(port)
    client.read_until(lambda: "Save parameters" in client.values)
    refused = {
        "../away.yaml": "give a plain name",
        "p.mcap": "give a name that ends in .yaml",
        "p.yaml@/edges": "give a plain name",
        "a@/../../p.yaml": "give a plain name",
        "old.yaml": "exists",
    }
    for name, said in refused.items():
        client.html.clear()
        client.set("Parameters", name)
        client.set("Save parameters", True)
        client.read_until(lambda said=said: any(said in html for html in client.html))
    assert [path.name for path in tmp_path.iterdir()] == ["old.yaml"]

    client.set("Parameters", "mine.yaml")
    client.set("Save parameters", True)
    client.read_until(lambda: client.values["Parameters"].startswith("parameters-"))
    saved = load_yaml(tmp_path / "mine.yaml")
    assert saved["filters"]["blur"] == "median"
    assert set(saved) == {member.name for member in runtime.graph.members}
    client.close()
    page.close()
