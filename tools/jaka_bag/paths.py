"""Names of files as callers may give them."""
import os
from typing import Union

PathLike = Union[str, "os.PathLike[str]"]
