# shellcheck shell=bash
# Sourced in every container of traffic.vast before the scenario, which sees what is exported here.
# All containers of a job share /out, so the socket between them lies there.
export TRAFFIC_FOLDER=${ROBOVAST_OUT_DIR:-/out}
export TRAFFIC_SOCKET=traffic.sock

if [ "${CONTAINER_NAME:-}" = traffic ]; then
  exec python3 "${ROBOVAST_CONFIG_DIR:-/config}/files/traffic.py"
fi
