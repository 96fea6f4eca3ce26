"""Frames, poses, angles and the stereo rig."""
