# Sourced by the other scripts: where things are, and an environment in which ROS 1 builds and runs.
# shellcheck shell=bash

repository=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
package=active_matching_slam

# The system's own tools come first: ROS uses the system's Python, not another that PATH may name.
export PATH="/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin:$PATH"

# Sources the setup.bash of a catkin space; those don't hold up under 'set -u'.
sourceSpace() {
  set +u
  # shellcheck source=/dev/null
  source "$1/setup.bash"
  set -u
}

# Ubuntu keeps ROS apart from the system; Debian does not.
enterRos() {
  if [ -z "${CMAKE_PREFIX_PATH:-}" ] && [ -r /opt/ros/noetic/setup.bash ]; then
    sourceSpace /opt/ros/noetic
  fi
}
enterRos

# With the options of scripts/install_dependencies. On Ubuntu ROS itself may only be there afterwards.
installDependencies() {
  "$repository/scripts/install_dependencies" "$@"
  enterRos
}

# As many compilers side by side as there are cores, and memory for (1.5 GB each).
buildJobs() {
  local cores memory
  cores=$(nproc)
  memory=$(awk '/^MemAvailable:/ {print int($2 / 1500000)}' /proc/meminfo)
  [ "$memory" -ge 1 ] || memory=1
  echo $((cores < memory ? cores : memory))
}
