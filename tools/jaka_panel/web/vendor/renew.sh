#!/usr/bin/env bash
# Renews the libraries of the page from npm, in the versions below, or tells whether they are unchanged.
#   renew.sh          fetches, checks the packages' hashes, writes the files and SHA256SUMS
#   renew.sh --check  compares the files with SHA256SUMS; needs no network
# The page has no build step and its content security policy allows no import map, so the one change made to a file is
# that imports of 'three' become relative paths.
set -euo pipefail
cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")"

# package, version, and the hash that npm states for it ("npm view PACKAGE@VERSION dist.integrity")
THREE=(three 0.187.0 Qiu7R+Cmh8CstZsY1uJOSWnVlfo7ZtNLV7mF8Jltk3LB3AtDu9cRZlcnRKkAk8Y4z6KKw35z7Y7Urd7jWY8etA==)
URDF=(urdf-loader 0.13.1 bHHoh0Yxrgrw91dPAmVnzKleA8HiVMeHy6xYqOVRw3LuZ2hDOwUiQVCbrzPZckO5S30F1Yym8zLCINN0HfcM3w==)
UPLOT=(uplot 1.6.32 KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW1AHtpm6IKTXImkbLgkMy+jabjLgSLMasNuGGzQm/ep3tOkyTxpiQIw==)

if [ "${1-}" = --check ]; then
  sha256sum --check --quiet --strict SHA256SUMS
  [ "$(find . -type f ! -name renew.sh ! -name SHA256SUMS | sort)" = "$(sed 's/^[0-9a-f]*  //' SHA256SUMS | sort)" ] \
    || { echo "renew.sh: error: files beside those of SHA256SUMS" >&2; exit 1; }
  exit
fi

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

unpack() {  # unpack PACKAGE VERSION HASH: into $scratch/PACKAGE
  local archive
  archive=$scratch/$(cd "$scratch" && npm pack --silent "$1@$2")
  [ "$(openssl dgst -sha512 -binary "$archive" | base64 -w0)" = "$3" ] \
    || { echo "renew.sh: error: $1 $2 is not the package that was pinned" >&2; exit 1; }
  mkdir "$scratch/$1"
  tar -xzf "$archive" -C "$scratch/$1" --strip-components=1
}

take() {  # take SOURCE TARGET: one file of a package, with line ends and imports that fit here
  local up
  mkdir -p "$(dirname "$2")"
  up=$(dirname "$2" | sed 's|[^/]*|..|g')
  sed -E -e 's/\r$//' \
    -e "s#from 'three';#from '$up/three/three.module.js';#" \
    -e "s#from 'three/examples/jsm/([^']*)';#from '$up/three/\1';#" "$scratch/$1" >"$2"
}

unpack "${THREE[@]}"
unpack "${URDF[@]}"
unpack "${UPLOT[@]}"
rm -rf three urdf-loader/*.js uplot
for file in three.module.js three.core.js; do take three/build/$file three/$file; done
for file in controls/OrbitControls.js loaders/STLLoader.js loaders/TGALoader.js loaders/ColladaLoader.js \
  loaders/collada/ColladaComposer.js loaders/collada/ColladaParser.js; do
  take three/examples/jsm/$file three/$file
done
take three/LICENSE three/LICENSE
for file in URDFLoader.js URDFClasses.js; do take urdf-loader/src/$file urdf-loader/$file; done  # its package has no LICENSE
for file in uPlot.esm.js uPlot.min.css; do take uplot/dist/$file uplot/$file; done
take uplot/LICENSE uplot/LICENSE
find . -type f ! -name renew.sh ! -name SHA256SUMS | LC_ALL=C sort | xargs sha256sum >SHA256SUMS
