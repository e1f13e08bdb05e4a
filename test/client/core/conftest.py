"""The import path of the stories of this folder, a module beside its tests."""
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
