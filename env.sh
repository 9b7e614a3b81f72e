# Source this: a shell (bash or zsh) in which every node's executable, `python -m` and the `vergence` command work.
#   source env.sh
# Discovery stays on this host unless ROS_AUTOMATIC_DISCOVERY_RANGE says otherwise (SUBNET for a head on a Pi).

if [ -n "${BASH_SOURCE:-}" ]; then
  _vergence_root="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
else
  _vergence_root="$(cd "$(dirname "$0")" && pwd)"
fi

if [ ! -f "$_vergence_root/install/local_setup.sh" ]; then
  echo "vergence: nothing is built in $_vergence_root yet: run 'make setup' there first" >&2
  unset _vergence_root
  return 1 2>/dev/null || exit 1
fi

if [ -f "${VERGENCE_ROS_SETUP:-/opt/ros/jazzy/setup.sh}" ]; then
  . "${VERGENCE_ROS_SETUP:-/opt/ros/jazzy/setup.sh}"
fi
. "$_vergence_root/.venv/bin/activate"
case ":${AMENT_PREFIX_PATH:-}:" in
  *":$VIRTUAL_ENV:"*) ;;
  *) export AMENT_PREFIX_PATH="${AMENT_PREFIX_PATH:+$AMENT_PREFIX_PATH:}$VIRTUAL_ENV" ;;
esac
COLCON_CURRENT_PREFIX="$_vergence_root/install" . "$_vergence_root/install/local_setup.sh"
for _vergence_bin in "$_vergence_root"/install/*/lib/vergence_*; do
  case ":$PATH:" in
    *":$_vergence_bin:"*) ;;
    *) [ -d "$_vergence_bin" ] && PATH="$_vergence_bin:$PATH" ;;
  esac
done
export PATH
export VERGENCE_CONFIG_DIR="$_vergence_root/config"
export FASTRTPS_DEFAULT_PROFILES_FILE="${FASTRTPS_DEFAULT_PROFILES_FILE:-$_vergence_root/config/fastdds.xml}"
export ROS_AUTOMATIC_DISCOVERY_RANGE="${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}"
unset _vergence_root _vergence_bin
