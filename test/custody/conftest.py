"""The import paths of the simulation, whose modules lie beside the tests of this folder."""
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(folder) for folder in (HERE, HERE / "rules") if str(folder) not in sys.path]
