"""DJI's subtitles, in the styles of several models."""

import datetime
import math

import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.logs.dji import open_srt
from ros_visualise.sources.opening import open_recording

S = 10**9


def read(recording):
    return [entry.message for entry in recording.read()]


@pytest.fixture
def opened(tmp_path):
    """Opens subtitles of one second each, of these texts."""

    def opened(*texts, step_s=1, ending="\n"):
        blocks = []
        for number, text in enumerate(texts):
            begin = str(datetime.timedelta(hours=1, seconds=number * step_s))
            begin = (begin if "." in begin else begin + ".000")[:11].replace(".", ",")
            blocks.append(f"{number + 1}\n0{begin} --> 09:00:00,000\n{text}\n")
        path = tmp_path / "DJI_0001.SRT"
        path.write_bytes("\n".join(blocks).replace("\n", ending).encode())
        return open_recording(path)

    return opened


def test_a_mavic_pro(recordings):
    recording = open_recording(recordings / "trajectory" / "dji_srt" / "mavic_pro.SRT")
    fixes = read(recording)
    assert len(fixes) == recording.topics["/gps/fix"].messages == 468
    assert not recording.loss
    assert recording.format == "DJI SRT (camera's clock)"
    assert recording.notes == ["altitudes are relative to the take-off point"]
    first, last = fixes[0], fixes[-1]
    assert (first.latitude, first.longitude, first.altitude) == (-20.2533, 149.0251, 1.9)
    assert (last.latitude, last.longitude, last.altitude) == (-20.2532, 149.0251, 0.0)
    utc = datetime.timezone.utc
    for fix, time in ((first, (14, 11, 51)), (last, (14, 19, 38))):
        date = datetime.datetime(2017, 8, 5, *time, tzinfo=utc)
        assert fix.header.stamp_ns == date.timestamp() * S


def test_a_mavic_mini(recordings):
    recording = open_recording(recordings / "trajectory" / "dji_srt" / "mavic_mini.SRT")
    fixes = read(recording)
    assert len(fixes) == 117
    assert (recording.start_ns, recording.end_ns) == (0, 116 * S)
    assert (fixes[0].latitude, fixes[0].longitude, fixes[0].altitude) == (48.0771, -121.7458, 200.7)
    assert recording.format == "DJI SRT (time in the video)"


STYLES = {
    "brackets": "[iso: 100] [latitude: 36.27423] [longitude: -41.36214] "
    "[rel_alt: 46.000 abs_alt: 19.621] [ct: 5895]",
    "spaces": "[iso : 100] [latitude : 36.27423] [longtitude : -41.36214] "
    "[rel_alt : 46.000 abs_alt : 19.621]",
    "font": '<font size="36">FrameCnt : 1, DiffTime : 33ms\n2019-09-25 01:22:35,118,697\n'
    "[latitude: 36.27423] [longitude: -41.36214] [rel_alt: 46.000 abs_alt: 19.621] </font>",
    "altitude": "[latitude : 36.27423] [longtitude : -41.36214] [altitude: 19.621000]",
    "gps": "F/2.8, SS 640, GPS (-41.36214, 36.27423, 15), D 24.2m, H 19.621m, H.S 0.0m/s",
    "barometer": "HOME(-41.3,36.2) 2017.08.05 14:11:51\n"
    "GPS(-41.36214,36.27423,16) BAROMETER:19.621",
    "barometer in metres": "HOME(-41.3,36.2) 2017.08.05 14:11:51\n"
    "GPS(-41.36214,36.27423,0.0M) BAROMETER:19.621M",
    "decimal commas": "[latitude: 36,27423] [longitude: -41,36214] "
    "[rel_alt: 46,000 abs_alt: 19,621]",
    "decimal commas in GPS": "GPS (-41,36214, 36,27423, 15), D 24,2m, H 19,621m",
    "capitals": "[Latitude: 36.27423] [Longitude: -41.36214] [Altitude: 19.621]",
}


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_styles(opened, style, ending):
    [fix] = read(opened(STYLES[style], ending=ending))
    assert (fix.latitude, fix.longitude, fix.altitude) == (36.27423, -41.36214, 19.621)
    assert (fix.status, fix.header.frame_id) == (0, "gps")


def test_an_absurd_altitude_is_unknown(opened):
    [fix] = read(opened("[latitude: 36.5] [longitude: -4.5] [rel_alt: 2 abs_alt: 99999999999]"))
    assert math.isnan(fix.altitude) or fix.altitude == 2


def test_a_longitude_that_can_be_no_latitude_tells_the_order(opened):
    [fix] = read(opened("GPS(36.5,-121.75,16)"))
    assert (fix.latitude, fix.longitude) == (36.5, -121.75)


def test_dates_with_parts_of_seconds_are_the_stamps(opened):
    dates = ["2023-08-28 17:26:58.889", "2023-08-28 17:26:58.905", "2023-08-28 17:26:59,001,5"]
    texts = [f"{date}\n[latitude: 1.5] [longitude: 2.5]" for date in dates]
    begin = datetime.datetime(2023, 8, 28, 17, 26, 58, tzinfo=datetime.timezone.utc).timestamp()
    stamps = [fix.header.stamp_ns - int(begin) * S for fix in read(opened(*texts))]
    assert stamps == [889_000_000, 905_000_000, 1_001_000_000]


def test_dates_of_whole_seconds_say_when_the_film_began(opened):
    texts = [f"2017.08.05 14:11:5{n // 2}\nGPS(2.5,1.5,16)" for n in range(1, 6)]
    stamps = [fix.header.stamp_ns for fix in read(opened(*texts, step_s=0.5))]
    assert [stamp - stamps[0] for stamp in stamps] == [n * S // 2 for n in range(5)]


def test_what_is_missing_is_no_fix(opened):
    whole = "GPS(2.5,1.5,16) BAROMETER:1.0"
    texts = [whole, "GPS(n/a,n/a,0)", "GPS(0.0000,0.0000,0)", "GPS(2.5,1.5,16)", whole]
    fixes = read(opened(*texts))
    assert [fix.status for fix in fixes] == [0, -1, -1, 0, 0]
    assert math.isnan(fixes[1].latitude)
    assert math.isnan(fixes[3].altitude)


@pytest.mark.parametrize("name", ["mavic_mini.SRT", "mavic_pro.SRT"])
def test_a_cut_anywhere_within_a_subtitle_is_said(recordings, tmp_path, name):
    data = (recordings / "trajectory" / "dji_srt" / name).read_bytes()
    start = data.index(b"\n20\n") + 1
    end = data.index(b"\n\n21\n")
    cut = tmp_path / "cut.SRT"
    for kept in range(start + 3, end - 2, 3):
        cut.write_bytes(data[:kept])
        recording = open_recording(cut)
        assert recording.loss.notes == ["cut off within the last subtitle"], data[start:kept]
    cut.write_bytes(data[:end])
    assert not open_recording(cut).loss
    for rest in (bytes(500), b"\n\n" + bytes(9), b"\xff\xfe\xfd"):
        cut.write_bytes(data[:end] + rest)
        assert open_recording(cut).loss.notes == ["cut off within the last subtitle"]


def test_a_file_that_is_cut_is_read_to_there(recordings, tmp_path):
    data = (recordings / "trajectory" / "dji_srt" / "mavic_pro.SRT").read_bytes()
    cut = tmp_path / "cut.SRT"
    end = data.index(b"GPS", 30_000) + 8
    cut.write_bytes(data[:end])
    recording = open_recording(cut)
    fixes = read(recording)
    assert len(fixes) == data[:end].count(b"-->")
    assert [fix.status for fix in fixes[-2:]] == [0, -1]
    assert recording.loss.notes == ["cut off within the last subtitle"]


def test_subtitles_that_are_missing_are_counted(recordings, tmp_path):
    data = (recordings / "trajectory" / "dji_srt" / "mavic_pro.SRT").read_bytes()
    damaged = tmp_path / "damaged.SRT"
    damaged.write_bytes(data[:5000] + b"\xff\x00\xfe" * 50 + data[6000:])
    recording = open_recording(damaged)
    assert recording.loss.messages == 468 - len(read(recording))
    assert 3 < recording.loss.messages < 12
    assert recording.loss.notes == [f"{recording.loss.messages} subtitles are missing or damaged"]


def test_a_films_ordinary_subtitles_are_refused(opened):
    with pytest.raises(OpenError, match="no GPS positions"):
        opened("Good evening.", "Is that a drone?")


def test_an_empty_file_is_refused(tmp_path):
    (tmp_path / "a.SRT").touch()
    with pytest.raises(OpenError, match="no GPS positions"):
        open_srt(tmp_path / "a.SRT")


def test_a_clock_that_goes_back_is_said_and_the_film_goes_on(opened):
    seconds = ["10.000", "11.000", "06.000", "07.000", "08.000"]
    texts = [
        f"2023-08-28 17:26:{second}\n[latitude: {number}.5] [longitude: 2.5]"
        for number, second in enumerate(seconds)
    ]
    recording = opened(*texts)
    fixes = read(recording)
    assert [fix.latitude for fix in fixes] == [0.5, 1.5, 2.5, 3.5, 4.5]
    begin = datetime.datetime(2023, 8, 28, 17, 26, 10, tzinfo=datetime.timezone.utc).timestamp()
    assert [fix.header.stamp_ns - int(begin) * S for fix in fixes] == [n * S for n in range(5)]
    assert recording.format == "DJI SRT (camera's clock)"
    assert recording.notes[0] == (
        "the camera's clock jumps back once, so stamps follow the time in the video"
    )


def test_subtitles_out_of_order_are_said(tmp_path):
    blocks = [
        f"{number}\n00:00:0{second},000 --> 00:00:09,000\nGPS(2.5,1.5,16)\n"
        for number, second in enumerate([3, 5, 1], 1)
    ]
    (tmp_path / "a.SRT").write_text("\n".join(blocks))
    recording = open_recording(tmp_path / "a.SRT")
    assert [fix.header.stamp_ns for fix in read(recording)] == [S, 3 * S, 5 * S]
    note = "the time in the video jumps back once, so fixes are sorted by that time"
    assert note in recording.notes


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_a_file_with_a_byte_order_mark_is_read(recordings, tmp_path, encoding):
    original = recordings / "trajectory" / "dji_srt" / "mavic_pro.SRT"
    mark = "" if encoding in ("utf-16", "utf-8-sig") else "\ufeff"
    copy = tmp_path / "a.SRT"
    copy.write_bytes((mark + original.read_text()).encode(encoding))
    fixes, expected = read(open_recording(copy)), read(open_recording(original))
    assert [fix.latitude for fix in fixes] == [fix.latitude for fix in expected]
    assert [fix.header for fix in fixes] == [fix.header for fix in expected]
