"""Calls for cameras of your own: the stixels of one pair, of one frame, of a stream."""
