"""The commented file that `cipv live init` writes: every key and its meaning."""

from __future__ import annotations

TEMPLATE = """\
# The sensors of one car. Delete what the car does not have; `cipv live check FILE` tests each sensor.
# The ego frame is x forward, y left, z up, in metres from the LiDAR; without a LiDAR, the camera's mount defines it.
title: My car

lidar:                      # Velodyne on the network
  model: VLP-16
  data_port: 2368
  position_port: 8308       # PPS and GPS state; null if the sensor does not send it
  interface: 0.0.0.0        # address of the network interface; 0.0.0.0 listens on all
  sender: null              # the sensor's address, e.g. 192.168.1.201; null accepts the first VLP-16 that sends
  multicast_group: null     # for example 239.0.0.1 when the sensor sends to a group
  time_offset_ms: 0         # added to its timestamps
  mount:                    # pose of the sensor; points are levelled with it
    x_m: 0.0
    y_m: 0.0
    z_m: 0.0
    roll_deg: 0.0
    pitch_deg: 0.0          # positive looks down
    yaw_deg: 0.0            # positive looks left

camera:                     # exactly one of device, url, file
  url: http://192.168.1.20:8080/video   # MJPEG or RTSP (rtsp://…); JPEGs are stored unchanged
  # device: 0               # a local camera; its path below /dev/v4l/by-id/ is more stable than a number
  # file: drive.mp4         # a video played in a loop, for testing
  time_offset_ms: 0         # added to its timestamps; for a camera without stamps, minus its latency
  calibration:              # without it, LiDAR and camera are not fused
    fx_px: 907.0
    fy_px: 907.0
    cx_px: 640.0
    cy_px: 360.0
    width_px: 1280
    height_px: 720
    distortion: []          # k1 k2 p1 p2 [k3 [k4 k5 k6]], in OpenCV's order
    mount: {x_m: -1.5, y_m: 0.0, z_m: 0.9, roll_deg: 0.0, pitch_deg: 0.0, yaw_deg: 0.0}

gnss:                       # NMEA (GGA, RMC, optionally GST), preferably at 5 Hz; exactly one of serial, tcp, udp_port
  serial: /dev/ttyACM0
  baud: 115200
  # tcp: 192.168.1.30:9001
  # udp_port: 10110
  # interface: 0.0.0.0      # for udp_port
  # sender: 192.168.1.30    # for udp_port: the only address accepted; by default, the first receiver that sends
  time_offset_ms: 0

ego:                        # ego speed and yaw rate
  source: gnss              # gnss, or can with the lines below
  time_offset_ms: 0
  # can:
  #   interface: socketcan  # any interface of python-can
  #   channel: can0
  #   bitrate: 500000
  #   dbc: car.dbc
  #   speed_mps: {message: WHEEL_SPEEDS, signal: SPEED, factor: 0.27778}        # when the DBC has km/h
  #   yaw_rate_radps: {message: GYRO, signal: YAW_RATE, factor: 0.0174533}      # when the DBC has °/s to the left
"""
