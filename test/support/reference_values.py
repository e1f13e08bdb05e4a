"""Joint angles and poses printed by real controllers, from the driver's data file of arm models."""
from typing import Any, Dict, List

import yaml

from jaka_ros_driver.kinematics.arm_models import MODELS_FILE


def reference_values() -> List[Dict[str, Any]]:
    """Return every value, mm and rad, with its source."""
    with open(MODELS_FILE, encoding="utf-8") as file:
        return yaml.safe_load(file)["reference_values"]
