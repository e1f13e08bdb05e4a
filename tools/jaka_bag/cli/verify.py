"""``jaka_bag verify``: was a signed log changed, or an audit log of the driver?"""
import argparse
from typing import List

from ..errors import BagError, UsageError
from ..operations.audit_log import is_audit_log, verify_audit
from ..operations.signature import load_public_key, verify
from .main import printable
from .quantities import given

EPILOG = """\
jaka_bag record --sign KEY.pem writes NAME.sig beside each finished log NAME: the SHA-256 of every record of the log,
and an Ed25519 signature over them. A changed byte is named by the record that it lies in. Without --key it is shown
only that log and signature belong together; with the signer's public key, that nobody else made them.

Of an audit log of the driver (docs/audit.md), given as its folder or its .jsonl files, the chain of hashes is followed:
the first line that was changed, is missing, out of order, cut or foreign is named. Who rewrites the whole chain is
found out only by the last hash: write it down, or send it elsewhere, each time that it is printed.

Keys: openssl genpkey -algorithm ed25519 -out key.pem; openssl pkey -in key.pem -pubout -out public.pem

examples:
  jaka_bag verify blackbox_2026-05-04-10-11-12_emergency_stop.mcap
  jaka_bag verify --key public.pem *.mcap
  jaka_bag verify ~/.ros/jaka_audit

Exit code: 0 unchanged, 1 changed or not signed, 2 usage.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``jaka_bag verify`` to a parser."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="signed logs; audit logs, or folders of them")
    parser.add_argument("--key", type=given, metavar="PUBLIC",
                        help="public key in PEM that they ought to be signed with")
    parser.add_argument("--signature", type=given, metavar="FILE", help="the signature, where it is not FILE.sig")


def run(args: argparse.Namespace) -> int:
    """Compare each log with its signature, follow the chain of each audit log; 0 where all are unchanged."""
    if args.signature and len(args.files) > 1:
        raise UsageError("--signature goes with one log")
    trusted = load_public_key(args.key) if args.key else None
    audit_logs = [path for path in args.files if is_audit_log(path)]
    are_good = _audit_logs_are_whole(audit_logs)
    for path in args.files:
        if path in audit_logs:
            continue
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


def _audit_logs_are_whole(paths: List[str]) -> bool:
    are_whole = True
    for account in verify_audit(paths):
        counted = "%d lines in %d files, from %s to %s" % (
            account.lines, account.files, account.first_time or "-", account.last_time or "-")
        if account.defect is None:
            text = "%s: %s, whole; last hash %s" % (account.place, counted, account.last_hash)
        else:
            are_whole = False
            text = "%s: line %d: %s (before it: %s)" % (
                account.defect.path, account.defect.line, account.defect.what, counted)
        print(printable(text))
        for note in account.notes:
            print(printable("  note: %s" % note))
    return are_whole
