#!/usr/bin/env bash
# Checks the JavaScript of the panel's page: check.sh [unit] [lint] [types] [vendor]; all without arguments.
# Needs node, and what tools/dev setup installs from package-lock.json into build/js.
set -euo pipefail
HERE=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
ROOT=$HERE/../../..
WEB=$ROOT/tools/jaka_panel/web
MODULES=$ROOT/build/js/node_modules
PATH=$ROOT/build/venv/bin:$PATH  # where tools/dev puts node on a machine that has none
cd "$ROOT"

unit() { node --test test/jaka_panel/js/unit/*.test.js; }

lint() {
  NODE_PATH=$MODULES "$MODULES/.bin/eslint" --config test/jaka_panel/js/eslint.config.cjs --max-warnings 0 \
    tools/jaka_panel/web/js tools/jaka_panel/web/i18n test/jaka_panel/js/unit
}

types() {  # in a copy, where declarations stand in the places of the libraries
  local copy
  copy=$(mktemp -d)
  trap 'rm -rf "$copy"' RETURN
  cp -r "$WEB/js" "$WEB/i18n" "$HERE/types/vendor" "$HERE/tsconfig.json" "$copy"
  (cd "$copy" && "$MODULES/.bin/tsc" -p .)
}

vendor() { "$WEB/vendor/renew.sh" --check; }

[ $# -gt 0 ] || set -- unit lint types vendor
for check in "$@"; do
  case $check in
    unit | lint | types | vendor) "$check" ;;
    *) echo "check.sh: error: no check '$check'" >&2; exit 2 ;;
  esac
done
