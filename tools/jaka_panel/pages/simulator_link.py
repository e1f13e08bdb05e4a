"""The simulated controller's operator port (docs/simulation.md, "The operator port"): what a person there can do."""
import asyncio
import json
from typing import Any, Dict, Mapping

from ..settings import LOOPBACK

TIMEOUT_S = 5.0
"""Longest wait, s, for an answer of the simulated controller's operator port, on the same computer."""
_LONGEST = 1 << 20
"""Longest answer, byte, of that port."""
READING = ("state", "events", "wire")
ACTIONS = READING + (
    "press_emergency_stop", "release_emergency_stop", "hit", "push", "set_input", "load_force_sensor", "fault",
    "clear_faults", "close", "reset", "half_open", "stall", "refuse", "reboot", "boot", "slow_feed")


async def ask(port: int, request: Mapping[str, Any]) -> Dict[str, Any]:
    """Send one request; return the answer, ``{"ok": ...}``, which is not ok where nobody answers."""
    try:
        return await asyncio.wait_for(_ask(port, request), TIMEOUT_S)
    except (OSError, ValueError, asyncio.TimeoutError) as error:
        return {"ok": False, "error": "no simulated controller answers on port %d: %s" % (port, error or "too late")}


async def _ask(port: int, request: Mapping[str, Any]) -> Dict[str, Any]:
    reader, writer = await asyncio.open_connection(LOOPBACK, port, limit=_LONGEST)
    try:
        writer.write(json.dumps(dict(request)).encode() + b"\n")
        answer = json.loads(await reader.readline())
    finally:
        writer.close()
    if not isinstance(answer, dict):
        raise ValueError("no object")
    return answer
