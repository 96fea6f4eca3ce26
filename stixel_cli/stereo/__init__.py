"""Stereo matching: from a pair of images to the left view's disparity."""
