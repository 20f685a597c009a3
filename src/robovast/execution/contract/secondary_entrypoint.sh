#!/usr/bin/env bash
# Runs the pre command in a secondary container, which CONTAINER_NAME names, until it is told to
# stop (SIGTERM) or the main container's lock on $ROBOVAST_OUT_DIR/.running is released.
#
# Leaves in OUTPUT_DIR: resource_usage_$CONTAINER_NAME.csv and logs/system_$CONTAINER_NAME.log.
# Exit code: 0, or as in entrypoint.sh, whose functions it uses.

# shellcheck source-path=SCRIPTDIR source=entrypoint.sh
source "${BASH_SOURCE[0]%/*}/entrypoint.sh"

# Tells this script to stop when the main container has ended: its lock can be shared, and was seen held
# or has grown. One process, whose number is known, so that none is left when this script ends first.
end_with_main() {
    exec python3 -I -S -c '
import fcntl, os, signal, sys, time
while True:
    try:
        with open(sys.argv[1]) as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                fcntl.flock(lock, fcntl.LOCK_SH)
                break
            if os.fstat(lock.fileno()).st_size > int(sys.argv[3]):
                break
    except FileNotFoundError:
        pass
    time.sleep(0.5)
os.kill(int(sys.argv[2]), signal.SIGTERM)
' "$_out/.running" $$ "$_before"
}

end_secondary() {
    stop_all $$
    close_log
}

main_secondary() {
    _before=$(stat -c %s "$_out/.running" 2>/dev/null || echo 0)
    log_to "$_logs/system_$CONTAINER_NAME.log"
    match_user_to_uid
    source_ros
    start_monitor "$CONTAINER_NAME"
    trap end_secondary EXIT
    trap 'exit 0' TERM INT
    end_with_main &
    (source_pre_command; wait) &
    wait $!
    local code=$?
    say "the pre command and its programs ended with code $code"
    ((code == 0)) || exit "$code"
    wait
}

main_secondary
