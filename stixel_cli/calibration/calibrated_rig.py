"""The stage that hands the calibrated rig to the later ones."""

from stixel_cli.geometry.rig import Rig
from stixel_cli.geometry.rig_calibration import RigCalibration


def calibrated_rig(calibration: RigCalibration) -> Rig:
    """The rig with the error that its calibration has found."""
    return calibration.rig
