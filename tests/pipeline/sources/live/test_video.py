"""Which camera a path leads to."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.sources.live.reader import DeviceLost
from pipeline.sources.live.video import device_number


def test_a_number_is_itself() -> None:
    assert device_number(3) == 3


def test_a_link_leads_to_the_number_that_the_camera_has_now(tmp_path: Path) -> None:
    link = tmp_path / "usb-046d_C920-video-index0"
    for number in (62, 7):
        link.unlink(missing_ok=True)
        link.symlink_to(f"/dev/video{number}")
        assert device_number(str(link)) == number


@pytest.mark.parametrize("device", ["/dev/v4l/by-id/not-there", "/dev/null", "/dev/video"])
def test_what_leads_to_no_camera_is_said(device: str) -> None:
    with pytest.raises(DeviceLost, match=f"camera {device}: not plugged in"):
        device_number(device)
