"""Plays a recording back as the car's sensors would send it, at true timing, so that the live path is tested for real:
VLP-16 packets over UDP, MJPEG over HTTP, NMEA over UDP or TCP, CAN frames."""
