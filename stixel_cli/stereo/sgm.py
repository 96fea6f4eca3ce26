"""Semi-global matching, Hirschmüller 2008, in OpenCV's modes."""

from stixel_cli.geometry.rig import Rig
from stixel_cli.scene.frames import StereoPairs
from stixel_cli.stereo.disparities import Disparities
from stixel_cli.stereo.matching import disparity_count, match_pairs
from stixel_cli.stereo.parameters import SgmParameters


def match(pairs: StereoPairs, stereo: SgmParameters, rig: Rig, frames: range) -> Disparities:
    """Disparities of the left views of `frames`, 1/16 px, by semi-global matching on one thread.

    The left border keeps its disparities as far as the right image reaches: what is so near in
    column u that its disparity exceeds u is not in the right image, and invalid.
    """
    import cv2

    modes = {
        "sgbm": cv2.STEREO_SGBM_MODE_SGBM,
        "hh": cv2.STEREO_SGBM_MODE_HH,
        "3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        "hh4": cv2.STEREO_SGBM_MODE_HH4,
    }
    count = disparity_count(stereo, rig)
    matcher = cv2.StereoSGBM_create(
        minDisparity=stereo.minimum_disparity,
        numDisparities=count,
        blockSize=stereo.block_size,
        P1=stereo.p1,
        P2=stereo.p2,
        disp12MaxDiff=stereo.left_right_difference,
        preFilterCap=stereo.pre_filter_cap,
        uniquenessRatio=stereo.uniqueness_ratio,
        speckleWindowSize=stereo.speckle_window,
        speckleRange=stereo.speckle_range,
        mode=modes[stereo.mode],
    )
    return match_pairs(pairs, frames, matcher, stereo, count, margin=0)
