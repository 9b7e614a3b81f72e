#!/usr/bin/env bash
# Write requirements/lock.txt and lock_apt.txt anew: the exact version of every package that the bootstrap installs.
#   tools/lock.sh           the newest release of everything
#   tools/lock.sh --keep    keep the versions that still fit: for an edited requirements file
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../requirements"
case "${1:-}" in
  "") upgrade=(--upgrade) ;;
  --keep) upgrade=() ;;
  *) echo "usage: tools/lock.sh [--keep]" >&2; exit 2 ;;
esac

# The resolver is pinned too; it answers for every Python and platform at once, whatever runs it.
tool="$(mktemp -d)"
trap 'rm -rf "$tool"' EXIT
"${PYTHON:-python3}" -m venv "$tool"
"$tool/bin/pip" install --quiet --disable-pip-version-check uv==0.13.9

lock() { # lock OUTPUT OLDEST_PYTHON INPUTS...
  local output="$1" python="$2"
  shift 2
  "$tool/bin/uv" pip compile --quiet --universal --python-version "$python" --no-header --no-annotate \
    "${upgrade[@]}" --output-file "$output" "$@"
  sed -i "1i # Exact versions, for the bootstrap. Written by tools/lock.sh; do not edit." "$output"
  echo "requirements/$output: $(grep -c == "$output") pins" >&2
}

lock lock.txt 3.10 run.txt ros.txt dev.txt
lock lock_apt.txt 3.12 beside_apt.txt dev.txt apt_versions.txt
