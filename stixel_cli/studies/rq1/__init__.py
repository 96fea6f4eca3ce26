"""RQ1: are these stixels like those of The Stixel World?"""
