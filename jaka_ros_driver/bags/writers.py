"""Opens an output by its name: ``.bag``, ``.mcap``, or a rosbag2 folder."""
from pathlib import Path
from typing import Optional

from .bag_writer import BagWriter
from .chunk_writer import ChunkWriter
from .errors import BagError
from .mcap_writer import McapWriter
from .paths import PathLike

SUFFIXES = (".bag", ".mcap")


def create_log(path: PathLike, compression: Optional[str] = None, level: Optional[int] = None,
               overwrite: bool = False, profile: str = "ros1", as_rosbag2: bool = False) -> ChunkWriter:
    """Begin an output.

    Args:
        path: Its suffix decides about the format.
        compression: None for the format's default: zstd for MCAP, none for .bag.
        level: The codec's level; None for the codec's default.
        overwrite: Replace an existing output.
        profile: Profile of an MCAP.
        as_rosbag2: Make a rosbag2 folder: ROS 1 messages are converted to CDR.

    Raises:
        BagError: The suffix is neither, the compression is not the format's, or it cannot be created.
        OutputExists: The output exists and ``overwrite`` is False.
    """
    suffix = Path(path).suffix
    if as_rosbag2:
        if suffix:
            raise BagError("the output of the profile ros2 is a folder: %s has a suffix" % path)
        from .rosbag2_writer import Rosbag2Writer
        return Rosbag2Writer(path, compression or "zstd", level, overwrite)
    if suffix == ".mcap":
        return McapWriter(path, profile, compression or "zstd", level, overwrite=overwrite)
    if suffix == ".bag":
        return BagWriter(path, compression or "none", level, overwrite=overwrite)
    raise BagError("%s: the name of an output ends in .bag or .mcap" % path)
