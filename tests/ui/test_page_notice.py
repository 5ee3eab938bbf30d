"""Lines that are shown for a while."""

from types import SimpleNamespace

from ros_visualise.ui.page.notice import Notice


def test_warnings_of_one_moment_are_all_shown_each_for_its_while(clock):
    element = SimpleNamespace(content="", visible=False)
    notice = Notice(SimpleNamespace(add_html=lambda *_, **__: element), clock)
    notice.say("the disk is nearly full")
    notice.say("a topic <is> gone")
    notice.refresh()
    assert element.visible
    assert "nearly full" in element.content
    assert "a topic &lt;is&gt; gone" in element.content
    clock.now_s = 9
    notice.say("a topic <is> gone")
    clock.now_s = 11
    notice.refresh()
    assert "nearly full" not in element.content, "it was there for ten seconds"
    assert "gone" in element.content, "it was said again"
    for number in range(50):
        notice.say(f"line {number}")
    notice.refresh()
    assert "line 49" in element.content
    assert element.content.count("line") == 4, "the page has room for no more"
    clock.now_s = 60
    notice.refresh()
    assert not element.visible
