"""RQ3: how do simulated and fabricated measurements differ?"""
