# shellcheck shell=bash
# Sourced in every container before the scenario: what is exported here, the scenario sees.
# All containers of a job share /out, so the sensor's socket lies there.
export SENSOR_FOLDER=${ROBOVAST_OUT_DIR:-/out}
export SENSOR_SOCKET=sensor.sock

if [ "${CONTAINER_NAME:-}" = sensor ]; then
  exec python3 "${ROBOVAST_CONFIG_DIR:-/config}/files/sensor.py"
fi
