"""What tests of sources have in common."""

import pytest


@pytest.fixture(autouse=True)
def close_recordings(request, monkeypatch):
    """Recordings that a test opens by itself are closed at its end."""
    open_recording = getattr(request.module, "open_recording", None)
    opened = []

    def open_and_note(path):
        opened.append(open_recording(path))
        return opened[-1]

    if open_recording is not None:
        monkeypatch.setattr(request.module, "open_recording", open_and_note)
    yield
    for recording in opened:
        recording.close()
