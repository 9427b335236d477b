"""Replays a recording as the car's sensors would send it, in real time, to test the live path end to end: VLP-16
packets over UDP, MJPEG over HTTP, NMEA over UDP or TCP, CAN frames."""
