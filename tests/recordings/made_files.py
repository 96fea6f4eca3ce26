"""Calibrations as others write them, all of one rig of 160 × 96 px, and PNG files of every kind."""

import struct
import zlib

RIG_FILES = {
    "ours.yaml": "{fx: 150, fy: 151, cx: 78, cy: 40, baseline: 0.5, principal_u_right: 80}",
    "matrix.yaml": "K: [[150, 0, 78], [0, 151, 40], [0, 0, 1]]\nbaseline: 0.5\n"
    "principal_u_right: 80\n",
    "right.yaml": """image_width: 160
image_height: 96
camera_name: stereo/right
camera_matrix: {rows: 3, cols: 3, data: [160.0, 0, 70, 0, 160, 41, 0, 0, 1]}
distortion_model: plumb_bob
projection_matrix:
  rows: 3
  cols: 4
  data: [150., 0., 78., -75., 0., 151., 40., 0., 0., 0., 1., 0.]
""",
    "echo.yml": "height: 96\nwidth: 160\nP: [150, 0, 78, -75, 0, 151, 40, 0, 0, 0, 1, 0]\n---\n",
    "extrinsics.yml": """%YAML:1.0
---
R: !!opencv-matrix
   rows: 1
   cols: 1
   dt: d
   data: [ 1. ]
P1: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [ 1.5000000000000000e+02, 0., 78., 0., 0., 151., 40., 0., 0., 0., 1., 0. ]
P2: !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [ 150., 0., 80., -75., 0., 151., 40., 0., 0., 0., 1., 0. ]
""",
    "calib.txt": "cam0=[150 0 78; 0 151 40; 0 0 1]\ncam1=[150 0 80; 0 151 40; 0 0 1]\n"
    "doffs=2\nbaseline=500\nwidth=160\nheight=96\nndisp=64\n",
}


def png_of(bits, colour, row, more=b""):
    """A PNG of one row of two pixels."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", 2, 1, bits, colour, 0, 0, 0)
    palette = chunk(b"PLTE", more) if more else b""
    image = chunk(b"IDAT", zlib.compress(b"\0" + bytes(row)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + palette + image + chunk(b"IEND", b"")
