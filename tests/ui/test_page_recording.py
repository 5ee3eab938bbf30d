"""What a browser may have recorded: new files in one folder, by their names."""

from pathlib import Path

import pytest
from page_client import Live
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
    with pytest.raises(OpenError, match="no such folder for recordings; create it first"):
        record_folder(Path(__file__))


def test_a_browser_stays_in_the_folder(port, runtime, tmp_path: Path) -> None:
    (folder := tmp_path / "run@" / "day1").mkdir(parents=True)
    (folder / "link.mcap").symlink_to(tmp_path / "outside.mcap")
    (folder / "link").symlink_to(tmp_path, target_is_directory=True)
    (folder / "old.mcap").write_text("precious")
    before = {path: path.lstat().st_mtime_ns for path in tmp_path.rglob("*")}
    page = Page(ViewOptions(port=port, record_dir=folder))
    page.open(runtime)
    client = Live(port, "/live/files")
    notices = Live(port, "/live/nodes")
    client.read_until(lambda: client.state.get("topics"))
    refused = {
        str(tmp_path / "away.mcap"): "give a plain name",
        "../away.mcap": "give a plain name",
        ".hidden.mcap": "give a plain name",
        "a\0b.mcap": "contains control characters",
        "x" * 250 + ".mcap": "choose one of at most 200",
        "r.avi": "must end in .mcap, .bag, .mp4, .csv, .txt",
        "link.mcap": "outside the folder",
        "link": "outside the folder",
        "old.mcap": "exists",
        "r.mcap@/../../x": "give a plain name",
        "a@/../../x.bag": "give a plain name",
        "edges.mp4@/edges": "give a plain name",
    }
    for name, said in refused.items():
        notices.state.clear()
        client.send("record", name=name)
        notices.read_until(lambda said=said: said in notices.last)
    assert {path: path.lstat().st_mtime_ns for path in tmp_path.rglob("*")} == before

    client.send("record", name="fine.mcap", topics=["/edges"])
    client.read_until(lambda: f"{folder}/fine.mcap:" in client.state["text"])
    client.read_until(lambda: " MB, about " in client.state["text"])
    assert f" of space left in {folder}" in client.state["text"]
    client.send("record", name="second.mcap")
    notices.read_until(lambda: "a recording is running" in notices.last)
    client.send("stop")
    client.read_until(lambda: client.state["links"] == ["fine.mcap"])
    with AnyReader([folder / "fine.mcap"]) as reader:
        assert set(reader.topics) == {"/edges", "/parameter_events"}
    client.__exit__()
    notices.__exit__()
    page.close()


def test_a_split_that_is_none_is_refused(port, runtime, tmp_path: Path) -> None:
    (folder := tmp_path / "here").mkdir()
    (folder / "old_2.mcap").write_text("precious")
    (folder / "link_0.mcap").symlink_to(tmp_path / "outside.mcap")
    page = Page(ViewOptions(port=port, record_dir=folder))
    page.open(runtime)
    client = Live(port, "/live/files")
    notices = Live(port, "/live/nodes")
    refused = {
        ("r.mcap", "5"): "split 5: give a size such as 1G or 500M",
        ("r.bag", "10M30s"): "split 10M30s: give a size such as 1G or 500M",
        ("r", "0s"): "split 0s: give a size such as 1G or 500M",
        ("r.mcap", "<b>"): "split <b>: give a size such as 1G or 500M",
        ("v.mp4", "1G"): ".mp4 files cannot be split",
        ("old.mcap", "1G"): "old_2.mcap exists",
        ("link.mcap", "1G"): "link_0.mcap exists",
        ("../away.mcap", "1G"): "give a plain name",
    }
    for (name, split), said in refused.items():
        notices.state.clear()
        client.send("record", name=name, split=split)
        notices.read_until(lambda said=said: said in notices.last)
    assert sorted(path.name for path in tmp_path.rglob("*")) == [
        "here",
        "link_0.mcap",
        "old_2.mcap",
    ]
    client.__exit__()
    notices.__exit__()
    page.close()


def test_a_browser_saves_all_parameters(port, runtime, tmp_path: Path) -> None:
    runtime.parameters["filters"].update({"blur": "median"})
    (tmp_path / "old.yaml").write_text("precious")
    page = Page(ViewOptions(port=port, record_dir=tmp_path))
    page.open(runtime)
    client = Live(port, "/live/files")
    notices = Live(port, "/live/nodes")
    refused = {
        "../away.yaml": "give a plain name",
        "p.mcap": "give a name that ends in .yaml",
        "p.yaml@/edges": "give a plain name",
        "a@/../../p.yaml": "give a plain name",
        "old.yaml": "exists",
    }
    for name, said in refused.items():
        for what in ("parameters", "layout"):
            notices.state.clear()
            client.send("save", what=what, name=name)
            notices.read_until(lambda said=said: said in notices.last)
    assert [path.name for path in tmp_path.iterdir()] == ["old.yaml"]

    client.send("save", what="parameters", name="mine.yaml")
    client.read_until(lambda: client.state.get("saved") == str(tmp_path / "mine.yaml"))
    saved = load_yaml(tmp_path / "mine.yaml")
    assert saved["filters"]["blur"] == "median"
    assert set(saved) == {member.name for member in runtime.graph.members}
    client.__exit__()
    notices.__exit__()
    page.close()
