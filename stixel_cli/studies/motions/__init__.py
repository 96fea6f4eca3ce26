"""Do the answers of RQ2 and RQ3 hold for real motion?"""
