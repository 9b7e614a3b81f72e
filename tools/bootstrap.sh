#!/usr/bin/env bash
# Make .venv and install/ from nothing, or bring them up to date. Idempotent: a second run only compares stamps.
#   tools/bootstrap.sh run|dev      run: what the nodes need; dev: what tests, lint and benchmarks add
# What the build needs is installed first; the rest is installed while colcon builds.
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cd "$root"
level="${1:-run}"
venv="$root/.venv"
ros_setup="${VERGENCE_ROS_SETUP:-/opt/ros/jazzy/setup.bash}"
python="${PYTHON:-python3}"
# Exact versions, written by tools/lock.sh. Beside an apt ROS those that fit apt's numpy and OpenCV.
if [ -f "$ros_setup" ]; then lock=requirements/lock_apt.txt; else lock=requirements/lock.txt; fi

say() { printf '\033[1m[setup %3d s]\033[0m %s\n' "$SECONDS" "$*" >&2; }
fail() { printf '[setup] %s\n' "$*" >&2; exit 1; }

# colcon, CMake and the wheels break on other paths, after minutes or when the first node starts.
(LC_ALL=C; [[ "$root" =~ ^[A-Za-z0-9._/+@,=~-]+$ ]]) ||
  fail "the path of this folder must have only ASCII letters, digits and . _ / + @ , = ~ -: got '$root'; move it"

# One bootstrap at a time: two in one tree would break each other's build.
exec 9>"$root/.bootstrap.lock"
flock 9

need_tools() {
  "$python" -c 'import sys; sys.exit(not ((3, 10) <= sys.version_info[:2] <= (3, 14)))' 2>/dev/null ||
    fail "$python must be Python 3.10 to 3.14 (set PYTHON=...): found $("$python" --version 2>&1)"
  "$python" -c 'import venv, ensurepip' 2>/dev/null ||
    fail "$python has no venv module: apt install python3-venv"
  local tool
  for tool in gcc g++ make; do
    command -v "$tool" >/dev/null || fail "no $tool: apt install build-essential (the messages are compiled)"
  done
  echo '#include <Python.h>' | gcc -E $("$python" -c 'import sysconfig; print("-I"+sysconfig.get_paths()["include"])') - \
    >/dev/null 2>&1 || fail "no Python headers: apt install python3-dev"
}

install_packages() {  # install_packages STAMP REQUIREMENTS...
  local name="$1" stamp="$venv/.stamp-$1" sum began="$SECONDS"
  shift
  sum="$(cat "$@" "$lock" | sha256sum)"
  [ "$(cat "$stamp" 2>/dev/null)" = "$sum" ] && return 0
  say "installing packages ($name): $*"
  local args=() file
  for file in "$@"; do args+=(-r "$file"); done
  local status
  set +e
  # By the environment, so that what pip builds from source is built with locked versions as well.
  PIP_CONSTRAINT="$lock" PIP_BUILD_CONSTRAINT="$lock" \
    "$venv/bin/pip" install --disable-pip-version-check --progress-bar off "${args[@]}" 2>&1 |
    grep --line-buffered -E '^(Collecting|Installing collected|ERROR|error)|[Ee]rror:' |
    sed -u -E 's/^Collecting ([^ (]+).*/[setup]   fetching \1/; s/^(Installing collected packages).*/[setup]   unpacking/' >&2
  status="${PIPESTATUS[0]}"
  set -e
  [ "$status" -eq 0 ] || fail "pip could not install $*: see the lines above"
  printf '%s' "$sum" >"$stamp"
  say "installed packages ($name) in $((SECONDS - began)) s"
}

make_venv() {
  if [ ! -x "$venv/bin/python" ]; then
    need_tools
    say "a first set-up takes about two minutes, and longer where packages are not in pip's cache yet"
    say "creating $venv with $("$python" --version)"
    if [ -f "$ros_setup" ]; then
      "$python" -m venv --system-site-packages "$venv"
    else
      "$python" -m venv "$venv"
    fi
  fi
  if [ -f "$ros_setup" ]; then
    "$venv/bin/python" -c 'import aiohttp, cv2, numpy, yaml' 2>/dev/null ||
      fail "ROS is here, but not what its packages need: apt install python3-aiohttp python3-numpy python3-opencv python3-yaml"
  else
    install_packages ros requirements/ros.txt
    "$venv/bin/python" tools/mend_wheel_paths.py "$venv"
  fi
}

install_the_rest() {
  if [ -f "$ros_setup" ]; then
    install_packages run requirements/beside_apt.txt
  else
    install_packages run requirements/run.txt requirements/beside_apt.txt
  fi
  [ "$level" = dev ] && install_packages dev requirements/dev.txt
  return 0
}

# What a rebuild depends on: with --symlink-install, Python modules and configuration need none.
source_sum() {
  {
    find src \( -name package.xml -o -name 'setup.*' -o -name CMakeLists.txt -o -name '*.msg' -o -name '*.srv' \
      -o -name '*.action' \) -type f -print0 | sort -z | xargs -0 sha256sum
    find src -path '*/__pycache__' -prune -o -path '*.egg-info' -prune -o -type f -print | sort
    echo "$root $("$venv/bin/python" --version)"
  } | sha256sum
}

build() {
  local sum stamp="$root/install/.stamp"
  sum="$(source_sum)"
  [ "$(cat "$stamp" 2>/dev/null)" = "$sum" ] && return 0
  local began="$SECONDS"
  say "building the workspace with colcon (a first build takes about a minute)"
  set +u
  if [ -f "$ros_setup" ]; then . "$ros_setup"; fi
  . "$venv/bin/activate"
  set -u
  export AMENT_PREFIX_PATH="${AMENT_PREFIX_PATH:+$AMENT_PREFIX_PATH:}$venv"
  export CMAKE_PREFIX_PATH="${CMAKE_PREFIX_PATH:+$CMAKE_PREFIX_PATH:}$venv"
  export PYTHONWARNINGS="ignore::DeprecationWarning,ignore:::setuptools.command.install,ignore:::setuptools.command.develop,ignore:::pkg_resources"
  find src -maxdepth 2 -name '*.egg-info' -type d -exec rm -rf {} + 2>/dev/null || true
  # Else colcon has make wait while the machine is busy, which pip keeps it.
  export MAKEFLAGS="${MAKEFLAGS:--j$(getconf _NPROCESSORS_ONLN)}"
  mkdir -p log
  # By this Python, which the executables then start with: apt's colcon alone would start them without this environment.
  command -v colcon >/dev/null || fail "no colcon: apt install python3-colcon-common-extensions"
  if ! python "$(command -v colcon)" --log-base log build --base-paths src --symlink-install \
    --event-handlers console_start_end+ desktop_notification- status- \
    --cmake-args -DBUILD_TESTING=OFF "-DPython3_EXECUTABLE=$venv/bin/python" "-DPYTHON_EXECUTABLE=$venv/bin/python" \
    >log/bootstrap.txt 2>&1; then
    tail -n 40 log/bootstrap.txt >&2
    fail "the build failed: the whole output is in log/bootstrap.txt"
  fi
  printf '%s' "$sum" >"$stamp"
  say "built $(find install -maxdepth 1 -name 'vergence*' | wc -l) packages in $((SECONDS - began)) s"
}

make_venv
install_the_rest &
rest=$!
trap wait EXIT  # a failed build leaves no half-installed packages behind
build
wait "$rest"
