"""How accurate are the trackers?"""
