"""The settings of the panel, from the command line; the token."""
import argparse
import ipaddress
import os
import re
import secrets
import socket
import stat
from dataclasses import dataclass
from typing import List, Optional, Tuple

PORT = 8080
"""Default port of the page, as local servers of pages have it."""
PORTS_TRIED = 20
"""Number of ports tried, from the asked-for one on: other panels and services have some."""
LOOPBACK = "127.0.0.1"
_LOOPBACKS = {"0.0.0.0": LOOPBACK, "::": "::1"}
"""The loopback address by the wildcard that listens on all addresses."""
_TOKEN_BYTES = 24
"""Random bytes of a token: 192 bits cannot be guessed."""
_SHORTEST_TOKEN = 16
"""Fewest characters of a person's own token."""

EPILOG = """\
It prints the address of the page, with a token behind '#'. Without the token a page can only watch. Whoever has it can
move the arm: it is a key.

--host with anything but loopback lets other computers in. Then give --tls-cert and --tls-key, or --insecure-http: with
that, everybody on the way reads the token, and can move the arm.

--behind-tls names the panel as browsers call it where a proxy on this computer serves it by TLS: then pages of
https://NAME may ask, and no others. The proxy must pass Host and WebSockets on as they are.

A stop of this page is no emergency stop: it passes a browser, a network, this server and the driver.
"""


class WrongSettings(ValueError):
    """The error of options that cannot be what is meant; the text says why."""


@dataclass(frozen=True)
class Settings:
    """The settings of the panel.

    Attributes:
        host: Address to listen on.
        port: First port to try.
        names: Host names by which the page may be called, besides loopback and addresses.
        tls: Certificate and key.
        behind_tls: Name, and port where it is not 443, by which browsers reach a proxy that serves the panel by TLS.
        token: Secret that a page needs to give commands.
        read_only: True if nothing but a stop is passed on.
        logs: Folder whose logs can be replayed.
        jog_fraction: Largest share of the driver's jog limits that a page can ask for.
        pages: Largest number of pages with the token at once.
        simulator_port: The simulated controller's operator port, for the only arm; 0: as the launch file says.
        cell_data: File of the cell's data.
    """

    host: str = LOOPBACK
    port: int = PORT
    names: Tuple[str, ...] = ()
    tls: Optional[Tuple[str, str]] = None
    behind_tls: Optional[str] = None
    token: str = ""
    read_only: bool = False
    logs: Optional[str] = None
    jog_fraction: float = 1.0
    pages: int = 8
    simulator_port: int = 0
    cell_data: str = ""

    @property
    def is_loopback(self) -> bool:
        """True if only this computer can reach the panel."""
        return is_loopback(self.host)

    @property
    def scheme(self) -> str:
        """The URL scheme of the address that browsers have of the panel: http or https."""
        return "http" if self.tls is None and self.behind_tls is None else "https"

    def address(self, port: int, token: Optional[str] = None) -> str:
        """Return the URL of the page on this computer, or at the proxy, with the token where one is given."""
        if self.behind_tls is not None:
            return "https://%s/%s" % (self.behind_tls, "" if token is None else "#token=" + token)
        return self._url(_LOOPBACKS.get(self.host, self.host), port, token)

    def address_elsewhere(self, port: int) -> str:
        """Return the URL of the page on other computers."""
        return self._url(_own_address(self.host) if self.host in _LOOPBACKS else self.host, port, None)

    def _url(self, host: str, port: int, token: Optional[str]) -> str:
        host = "[%s]" % host if ":" in host else host
        return "%s://%s:%d/%s" % (self.scheme, host, port, "" if token is None else "#token=" + token)


def _own_address(wildcard: str) -> str:
    """Return the address, of the wildcard's family, by which others reach this computer; its name for want of one."""
    family, far = (socket.AF_INET6, "2001:db8::1") if ":" in wildcard else (socket.AF_INET, "192.0.2.1")
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((far, 9))  # an address for documentation: nothing is sent, the way there is looked up
            return str(probe.getsockname()[0])
    except OSError:
        return socket.gethostname()


def is_loopback(host: str) -> bool:
    """Return whether an address or name is this computer's own."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def settings_from(arguments: List[str]) -> Settings:
    """Return the settings of a command line; argparse ends the process if it is wrong.

    Raises:
        WrongSettings: Options contradict each other, or a file cannot be used.
    """
    options = _parser().parse_args(arguments)
    if bool(options.tls_cert) != bool(options.tls_key):
        raise WrongSettings("--tls-cert and --tls-key belong together")
    if not is_loopback(options.host) and not options.tls_cert and not options.insecure_http:
        raise WrongSettings("--host %s lets other computers in: give --tls-cert and --tls-key, or --insecure-http, "
                            "with which everybody on the way can read the token and move the arm" % options.host)
    if options.behind_tls is not None and (options.tls_cert or not is_loopback(options.host)):
        raise WrongSettings("--behind-tls is for a proxy on this computer, which has the certificate: without "
                            "--tls-cert, and with a --host that is loopback")
    if options.logs is not None and not os.path.isdir(options.logs):
        raise WrongSettings("--logs %s is no folder" % options.logs)
    token = token_from_file(options.token_file) if options.token_file else new_token()
    return Settings(
        options.host, options.port, (*options.allow_name, *_names(options.behind_tls)),
        (options.tls_cert, options.tls_key) if options.tls_cert else None, options.behind_tls, token,
        options.read_only, options.logs or None, options.max_jog_speed / 100.0, options.pages, options.simulator_panel,
        options.cell_data or default_cell_data())


def default_cell_data() -> str:
    """Return the file of the cell's data below $ROS_HOME, or below ~/.ros."""
    return os.path.join(os.environ.get("ROS_HOME") or os.path.join(os.path.expanduser("~"), ".ros"), "jaka_cell",
                        "cell.json")


def new_token() -> str:
    """Generate a token that nobody guesses."""
    return secrets.token_urlsafe(_TOKEN_BYTES)


def token_from_file(path: str) -> str:
    """Return the token in a file that only its owner can read; make the file if there is none.

    Raises:
        WrongSettings: Others can read it, it is too short, or cannot be read or made.
    """
    try:
        if not os.path.exists(path):
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(new_token() + "\n")
        if stat.S_IMODE(os.stat(path).st_mode) & 0o077:
            raise WrongSettings("--token-file %s can be read by others: chmod 600 %s" % (path, path))
        with open(path, encoding="ascii") as file:
            token = file.read().strip()
    except (OSError, UnicodeDecodeError) as error:
        raise WrongSettings("--token-file %s: %s" % (path, error)) from error
    if len(token) < _SHORTEST_TOKEN or not all(letter.isalnum() or letter in "-_" for letter in token):
        raise WrongSettings("--token-file %s: a token has at least %d letters, digits, - or _" % (
            path, _SHORTEST_TOKEN))
    return token


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="jaka_panel", epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter,
                                     description="An operator's page in the browser, for all drivers of a ROS graph.")
    parser.add_argument("--port", type=_port, default=PORT, metavar="N",
                        help="port of the page, or the next free one (default %d); 0 picks a free one" % PORT)
    parser.add_argument("--host", type=_given, default=LOOPBACK, metavar="ADDRESS",
                        help="address to listen on (default %s: this computer only)" % LOOPBACK)
    parser.add_argument("--tls-cert", type=_given, metavar="FILE", help="certificate, PEM")
    parser.add_argument("--tls-key", type=_given, metavar="FILE", help="its key, PEM")
    parser.add_argument("--behind-tls", type=_authority, metavar="NAME[:PORT]",
                        help="how browsers call a proxy on this computer that serves the panel by TLS, see below")
    parser.add_argument("--insecure-http", action="store_true", help="let other computers in without TLS, see below")
    parser.add_argument("--allow-name", action="append", default=[], metavar="NAME",
                        help="a host name by which browsers call this computer; addresses are allowed anyway")
    parser.add_argument("--token-file", type=_given, metavar="FILE",
                        help="file with the token, made where it is not there (default: a new token with each start)")
    parser.add_argument("--read-only", action="store_true", help="pages can watch, and stop, and nothing else")
    parser.add_argument("--logs", metavar="FOLDER", help="folder whose logs can be replayed")
    parser.add_argument("--cell-data", type=_given, metavar="FILE",
                        help="names, points, frames, payloads of the cell, shared by all pages; made where it is not "
                             "there (default jaka_cell/cell.json in $ROS_HOME, else in ~/.ros)")
    parser.add_argument("--max-jog-speed", type=_percent, default=100.0, metavar="PERCENT",
                        help="of the driver's jog limits, the most that a page can set (default 100; each page begins "
                             "with 10)")
    parser.add_argument("--pages", type=_count, default=8, metavar="N",
                        help="pages with the token at once (default 8); half as many without")
    parser.add_argument("--simulator-panel", type=_port, default=0, metavar="PORT",
                        help="number of the simulated controller's operator port (default: as the launch file set it)")
    return parser


def _given(text: str) -> str:
    if not text.strip():  # a variable of the shell that is not set must not be taken for no option
        raise argparse.ArgumentTypeError("it is empty")
    return text


def _authority(text: str) -> str:
    if not re.fullmatch(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?", text):
        raise argparse.ArgumentTypeError("%r is no lower-case name, with a port where it is not 443" % text)
    return text


def _names(authority: Optional[str]) -> Tuple[str, ...]:
    """Return the name in NAME[:PORT], without brackets, if there is one."""
    if authority is None:
        return ()
    return (re.sub(r":[0-9]{1,5}$", "", authority).strip("[]"),)


def _port(text: str) -> int:
    return _within(text, 0, 65535)


def _count(text: str) -> int:
    return _within(text, 1, 64)


def _within(text: str, low: int, high: int) -> int:
    if not text.isdigit() or not low <= int(text) <= high:
        raise argparse.ArgumentTypeError("%r is no whole number within %d to %d" % (text, low, high))
    return int(text)


def _percent(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError("%r is not within 1 to 100" % text)
    return value
