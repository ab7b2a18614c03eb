"""A result as a film."""

import subprocess
import sys

import numpy as np
import pytest
from closed_kinematics import equation_1
from motion import joint_position
from PIL import Image

import finger_pin as fp
from finger_pin.views import write_video
from finger_pin.views.viewer import video


def pictures(path):
    with Image.open(path) as film:
        found = []
        for index in range(film.n_frames):
            film.seek(index)
            found.append(np.asarray(film.convert("RGB"), dtype=float))
        return found, film.info["duration"]


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["ffmpeg", "pillow"])
def test_a_gif_lasts_as_long_as_the_motion_and_traces_the_fingertip(result, tmp_path, monkeypatch, tool):
    if tool == "pillow":
        monkeypatch.setattr(video, "find_ffmpeg", str)
    elif not video.find_ffmpeg():
        pytest.skip("needs ffmpeg")
    part = result.sel(time=slice(0.0, 0.6))
    frames, duration = pictures(write_video(part, tmp_path / "film.gif", rate=10.0))
    assert len(frames) == 7 and duration == 100
    # The trace is pink and bright where it is past, and the fingertip moves up all the time, by equation (1).
    assert np.all(np.diff([equation_1(joint_position(t))[2] for t in np.arange(0.0, 0.65, 0.1)]) > 0.0)
    tops = []
    for frame in frames[3:]:
        red, green, blue = np.moveaxis(frame, -1, 0)
        pink = (red > 180.0) & (red - green > 60.0) & (blue - green > 10.0)
        tops.append(np.flatnonzero(pink.any(axis=1)).min())
    assert np.all(np.diff(tops) < 0)


@pytest.mark.slow
@pytest.mark.skipif(not video.find_ffmpeg(), reason="needs ffmpeg")
def test_an_mp4_in_slow_motion_has_frames_for_all_of_its_time(result, tmp_path):
    path = write_video(result.sel(time=slice(0.0, 0.2)), tmp_path / "film.mp4", speed=0.25, rate=20.0)
    command = [video.find_ffmpeg(), "-i", str(path), "-f", "null", "-"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert "frame=   17" in said and "1200x720" in said


def test_a_video_that_cannot_be_made_is_refused_before_anything_is_written(result, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(fp.exceptions.FingerPinError, match="ffmpeg"):
        write_video(result, tmp_path / "film.mp4")
    with pytest.raises(fp.InputError, match=r"\.mp4 or \.gif"):
        write_video(result, tmp_path / "film.avi")
    with pytest.raises(fp.InputError, match="speed"):
        write_video(result, tmp_path / "film.gif", speed=0.0)
    assert list(tmp_path.iterdir()) == []
