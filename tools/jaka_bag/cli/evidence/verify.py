"""``jaka_bag verify``: was a signed log changed?"""
import argparse

from ...errors import BagError, UsageError
from ...operations.signature import load_public_key, verify

EPILOG = """\
jaka_bag record --sign KEY.pem writes NAME.sig beside each finished log NAME: the SHA-256 of every record of the log,
and an Ed25519 signature over them. A changed byte is named by the record that it lies in. Without --key it is shown
only that log and signature belong together; with the signer's public key, that nobody else made them.

Keys: openssl genpkey -algorithm ed25519 -out key.pem; openssl pkey -in key.pem -pubout -out public.pem

examples:
  jaka_bag verify blackbox_2026-05-04-10-11-12_emergency_stop.mcap
  jaka_bag verify --key public.pem *.mcap

Exit code: 0 unchanged, 1 changed or not signed, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of ``jaka_bag verify``."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="signed logs")
    parser.add_argument("--key", metavar="PUBLIC", help="public key in PEM that they ought to be signed with")
    parser.add_argument("--signature", metavar="FILE", help="the signature, where it is not FILE.sig")


def run(args: argparse.Namespace) -> int:
    """Compare each log with its signature; 0 where all are unchanged."""
    if args.signature and len(args.files) > 1:
        raise UsageError("--signature goes with one log")
    trusted = load_public_key(args.key) if args.key else None
    are_good = True
    for path in args.files:
        try:
            result = verify(path, trusted, args.signature)
        except BagError as error:
            are_good = False
            print("%s: NOT VERIFIED: %s" % (path, error))
            continue
        problems = list(result.problems)
        if result.is_trusted is False:
            problems.append("it is signed with another key than that of %s" % args.key)
        for problem in problems:
            print("%s: CHANGED: %s" % (path, problem))
        if not problems:
            print("%s: unchanged since it was signed at %s with key %s%s" % (
                path, result.signed_at, result.signer, "" if result.is_trusted else
                " (whose that is only --key can tell)"))
        are_good = are_good and not problems
    return 0 if are_good else 1
