#!/bin/sh
# Resolves pyproject.toml into requirements/*.txt: names, versions, markers and hashes, nothing else.
#
# Called by `make lock`.  Versions already in the files are kept unless --upgrade is given.  run.txt
# comes first and binds dev.txt, so what is tested is what is shipped.
set -eu
cd "$(dirname "$0")/.."

uv=${1:-uv}
[ $# -eq 0 ] || shift
command -v "$uv" >/dev/null || {
    echo "lock: '$uv' is not on the path; install uv, or name it: make lock UV=/path/to/uv" >&2
    exit 2
}

resolve() {
    out=requirements/$1.txt
    shift
    "$uv" pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-sources \
        --no-header --no-annotate --no-emit-index-url --only-binary :all: \
        --output-file "$out" "$@" >/dev/null
    echo "$out: $(grep -c '==' "$out") packages"
}

resolve run pyproject.toml --all-extras "$@"
resolve build --group build --constraint requirements/run.txt "$@"
resolve dev pyproject.toml --all-extras --group dev --constraint requirements/run.txt \
    --constraint requirements/build.txt "$@"
resolve peers --group peers --constraint requirements/dev.txt "$@"
