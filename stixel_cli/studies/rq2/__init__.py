"""RQ2: how does the tracker do on stixels against lidar?"""
