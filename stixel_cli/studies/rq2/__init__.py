"""RQ2: how accurate is the tracker on stixels, compared with lidar?"""
