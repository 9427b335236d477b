"""An RTSP camera made by GStreamer: `python3 rtsp_camera.py CODEC PORT`, with the system's Python and its bindings.
Prints ``ready`` once it listens. 640×360 at 30 Hz, grey with a white bar at the left, 100 pixels wide."""

from __future__ import annotations

import sys

import gi

gi.require_version("Gst", "1.0")
gi.require_version("GstRtspServer", "1.0")
from gi.repository import GLib, Gst, GstRtspServer  # noqa: E402  # the version is said first

PAY = {
    "h264": "x264enc tune=zerolatency speed-preset=ultrafast key-int-max=15 ! rtph264pay name=pay0 pt=96",
    "mjpeg": "jpegenc quality=90 ! rtpjpegpay name=pay0 pt=26",
}


def main() -> None:
    codec, port = sys.argv[1:]
    Gst.init(None)
    if any(Gst.ElementFactory.find(element.split()[0]) is None for element in PAY[codec].split(" ! ")):
        sys.exit("an element is missing")
    server, factory = GstRtspServer.RTSPServer(), GstRtspServer.RTSPMediaFactory()
    server.set_address("127.0.0.1")
    server.set_service(port)
    factory.set_launch(
        "( videotestsrc is-live=true pattern=solid-color foreground-color=0xff505050"
        " ! video/x-raw,format=I420,width=540,height=360,framerate=30/1"
        f" ! videobox left=-100 fill=white ! video/x-raw,width=640 ! {PAY[codec]} )"
    )
    factory.set_shared(True)
    server.get_mount_points().add_factory("/front", factory)
    if not server.attach(None):
        sys.exit("the port is taken")
    print("ready", flush=True)
    GLib.MainLoop().run()


main()
