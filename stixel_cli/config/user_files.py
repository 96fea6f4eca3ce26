"""The user's recordings, replayed motions and files of scans: opened here, once per command."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stixel_cli.config.schema import Configuration
from stixel_cli.errors import UserError
from stixel_cli.measurements.file import FileParameters
from stixel_cli.scene.ego import Parked
from stixel_cli.scene.parameters import ReplayedPath

if TYPE_CHECKING:
    from stixel_cli.recordings.types import Recording


class UserFiles:
    """Opens what configurations name, each once; a new object opens it anew.

    The configuration takes from an opened recording what it sets, the stages take its frames.

    Attributes:
        notes: what a user may not expect of the opened files, one line each.
    """

    def __init__(self) -> None:
        self._opened: dict[str, Any] = {}
        self.notes: list[str] = []

    def recording(self, configuration: Configuration) -> "Recording | None":
        """The recording or the replayed motion of a configuration; None without one.

        Raises:
            UserError: if a file is missing or not valid.
        """
        if isinstance(configuration.path, ReplayedPath):
            return self.open(configuration.path)
        if configuration.source.kind == "rendered":
            return None
        recording = self.open(configuration.source)
        parked = isinstance(configuration.ego, Parked)
        return replace(recording, pose_files=()) if parked else recording

    def open(self, parameters: Any) -> Any:
        """The `Recording` of a source or a replayed path, or the `Scans` of a file, by its
        parameters; errors as above. The truth of scans is checked too."""
        name = repr(parameters)
        if name not in self._opened:
            self._opened[name] = _open(parameters, self.notes)
        return self._opened[name]

    def add(self, parameters: Any, opened: Any) -> None:
        """Let `parameters` also mean what is `opened`: with the frames that it has."""
        self._opened[repr(parameters)] = opened


def _open(parameters: Any, notes: list[str]) -> Any:
    # Imported here, because most runs have no such files.
    if isinstance(parameters, FileParameters):
        from stixel_cli.measurements.file import read_scans

        if parameters.path is None:
            raise UserError(
                "measurement.path: is missing: give the file of the scans, .csv or .npz"
            )
        units = {"time_unit": parameters.time_unit, "angle_unit": parameters.angle_unit}
        scans = read_scans(
            parameters.path,
            parameters.ego,
            parameters.range_std,
            **units,
            note=notes.append,
            road_z=parameters.road_z,
        )
        if parameters.truth is not None:
            # Shapely is imported for it.
            from stixel_cli.measurements.file_truth import read_truth

            read_truth(scans, parameters.truth, **units)
        return scans
    if isinstance(parameters, ReplayedPath):
        from stixel_cli.recordings.replay import find_replay

        return find_replay(parameters)
    from stixel_cli.recordings.find import find_recording

    return find_recording(parameters)
