#!/usr/bin/env bash
# Executes a script on results in a container of a run image.
set -euo pipefail
here=$(cd "$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")" && pwd)
package=$(cd "$here/../../.." && pwd)

image=${ROBOVAST_IMAGE:-}
compat_version=$(sed -n 's/^COMPAT_VERSION = //p' "$package/common/execution.py")
provenance=
script=

usage() {
  cat <<END
usage: docker_exec.sh [--image IMAGE] [--compat-version N] [--provenance-file HOST_PATH] SCRIPT [ARG…] FOLDER

  --image IMAGE                 run image (default: \$ROBOVAST_IMAGE)
  --compat-version N            image interface version of the image (default: version of RoboVAST)
  --provenance-file HOST_PATH   output file for the provenance of the script

SCRIPT is searched in the working directory, in \$CONFIG_DIR (the folder of the .vast file) and next to this
program. FOLDER is /input in the container, SCRIPT's folder is /scripts, and the folder of HOST_PATH is
/provenance. The container runs \`SCRIPT [--provenance-file /provenance/NAME] ARG… /input\`, with python3 if the name
ends with .py; \`import rosbags_common\` works.
END
}

fail() { # exit code, message
  echo "error: $2" >&2
  exit "$1"
}

while [ $# -gt 0 ] && [ -z "$script" ]; do
  case $1 in
    --image) image=${2:?--image needs the name of an image}; shift ;;
    --compat-version) compat_version=${2:?--compat-version needs a number}; shift ;;
    --provenance-file) provenance=${2:?--provenance-file needs a path}; shift ;;
    -h | --help) usage; exit 0 ;;
    -*) usage >&2; fail 2 "unknown option $1" ;;
    *) script=$1 ;;
  esac
  shift
done
if [ -z "$script" ] || [ $# -eq 0 ]; then usage >&2; fail 2 "SCRIPT and FOLDER are needed."; fi
input=${*: -1}
set -- "${@:1:$#-1}"
[ -d "$input" ] || fail 2 "$input: there is no such folder."
for folder in . "${CONFIG_DIR:-.}" "$here"; do
  case $script in /*) break ;; esac
  if [ -f "$folder/$script" ]; then script=$folder/$script; break; fi
done
[ -f "$script" ] || fail 2 "$script: there is no such script."
[ -n "$image" ] || fail 3 "no container image is named: give --image, or set ROBOVAST_IMAGE."

engine=docker
command -v docker >/dev/null || engine=podman
command -v $engine >/dev/null || fail 3 "neither docker nor podman is here."
$engine info >/dev/null 2>&1 || fail 3 "$engine does not answer. Is its daemon running, and may you use it?"

# The image must speak our version of the run contract, before the script starts.
$engine image inspect "$image" >/dev/null 2>&1 || $engine pull --quiet "$image" >/dev/null ||
  fail 3 "the image $image is not on this machine and cannot be pulled."
found=$($engine run --rm --network none --entrypoint cat "$image" /etc/robovast_compat_version 2>/dev/null || true)
[ "$found" = "$compat_version" ] || fail 3 "the image $image is not compatible: image interface version \`$compat_version\` is needed, \
the image has \`${found:-none}\`. Rebuild it from container/robovast/Dockerfile, or use the RoboVAST that it was built for."

folder=$(cd "$(dirname "$script")" && pwd)
command=("/scripts/$(basename "$script")")
case $script in *.py) command=(python3 "${command[0]}") ;; esac
options=(--rm --network none --entrypoint /bin/bash --env HOME=/tmp --env PYTHONPATH=/robovast
  --volume "$(cd "$input" && pwd):/input"
  --volume "$folder:/scripts:ro"
  --volume "$(dirname "$package")/rosbags_common.py:/robovast/rosbags_common.py:ro")
if [ -n "$provenance" ]; then
  options+=(--volume "$(cd "$(dirname "$provenance")" && pwd):/provenance")
  command+=(--provenance-file "/provenance/$(basename "$provenance")")
fi
# What the container writes belongs to the user.
if [ $engine = podman ]; then options+=(--userns keep-id); else options+=(--user "$(id -u):$(id -g)"); fi

# shellcheck disable=SC2016  # it is the container's shell that expands
sourcing='for setup in "/opt/ros/${ROS_DISTRO:-none}/setup.bash" /ws/install/setup.bash; do
  if [ -f "$setup" ]; then . "$setup"; fi
done
exec "$@"'
exec $engine run "${options[@]}" "$image" -c "$sourcing" bash "${command[@]}" "$@" /input
