from typing import Any

# The classes are made at run time.
def generate_dynamic(core_type: str, msg_cat: str) -> dict[str, Any]: ...
