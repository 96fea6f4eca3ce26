"""Frames, poses and the stereo rig: what every domain room measures with."""
