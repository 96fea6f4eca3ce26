"""Scores of tracks against the truth."""
