# shellcheck shell=bash
# Sourced in every container: two of the three start their part of the system here and stay in it.
files=${ROBOVAST_CONFIG_DIR:-/config}/files

case ${CONTAINER_NAME:-} in
  simulation) exec ros2 launch "$files/simulation.launch.py" ;;
  nav) exec ros2 launch "$files/navigation.launch.py" ;;
esac
