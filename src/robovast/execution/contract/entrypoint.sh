#!/usr/bin/env bash
# Runs one job: the scenario of SCENARIO_FILE, once per document of SCENARIO_PARAMETER_FILE.
#
# Needs only bash, coreutils and python3 of the image, whoever made it. Leaves in OUTPUT_DIR:
# sysinfo.yaml, resource_usage_main.csv, logs/system.log. While it lives, it holds an exclusive
# lock on $ROBOVAST_OUT_DIR/.running, which the kernel releases however it ends.
#
# Exit code: that of scenario-execution, or
#   69  the image lacks something, which the message names
#   70  the pre command failed, or the post command cannot be run
#   73  an output folder is not writable, or belongs to a job that still runs

contract=${BASH_SOURCE[0]%/*}
config=${ROBOVAST_CONFIG_DIR:-/config}
out=${ROBOVAST_OUT_DIR:-/out}
logs=$OUTPUT_DIR/logs

say() { printf '[robovast] %s\n' "$*"; }

fail() { # CODE MESSAGE...
    say "error: ${*:2}"
    exit "$1"
}

# The log is complete once tee has ended. A daemon that a scenario leaves behind may keep the pipe
# to it open, hence the limit. tee ignores the signals that end the job, to hear its last words.
log_to() { # FILE
    check_output "$logs"
    exec 3>&1
    coproc log { trap '' INT TERM; exec tee -a "$1" 4>&1 >&3 3>&-; }
    log_ended=${log[0]}
    exec >&"${log[1]}" 2>&1 3>&-
    eval "exec ${log[1]}>&-"
    trap 'exec >&- 2>&-; read -rt 2 -u "$log_ended"' EXIT
}

check_tools() {
    local tool tools=(python3 stdbuf tee find) missing=()
    wants_x11 && tools+=(Xvfb start-stop-daemon)
    for tool in "${tools[@]}"; do
        type -P "$tool" >/dev/null || missing+=("$tool")
    done
    [[ ${#missing[@]} == 0 ]] || fail 69 "the image lacks: ${missing[*]} (looked on PATH $PATH;" \
        "with ENABLE_X11=false, Xvfb and start-stop-daemon are not needed)"
}

check_output() { # FOLDER...
    local folder
    mkdir -p "$@" 2>/dev/null
    for folder; do
        [[ -d $folder && -w $folder ]] || fail 73 "user $EUID cannot write the output folder $folder"
    done
}

# Descriptor 9 is closed for every child: a daemon that survives the job must not hold the lock.
hold_lock() {
    exec 9>>"$out/.running" || fail 73 "cannot write $out/.running"
    flock -n 9 2>/dev/null || python3 -I -S -c '
import fcntl, time
for _ in range(50):
    try:
        raise SystemExit(fcntl.flock(9, fcntl.LOCK_EX | fcntl.LOCK_NB))
    except OSError:
        time.sleep(0.1)
raise SystemExit(1)' || fail 73 "another job runs in $out (it holds the lock $out/.running)"
}

match_user_to_uid() {
    ((EUID == 0)) || ! type -P fixuid >/dev/null || eval "$(fixuid -q)"
}

source_ros() {
    local setup
    for setup in "/opt/ros/$ROS_DISTRO/setup.bash" /ws/install/setup.bash; do
        # shellcheck disable=SC1090
        [[ -f $setup ]] && source "$setup"
    done
}

# Where a pre or post command is: its path is written as seen in a container, under /config.
command_path() { # PATH
    case $1 in
    /config/*) echo "$config/${1#/config/}" ;;
    /*) echo "$1" ;;
    *) echo "$config/$1" ;;
    esac
}

# Sets executor; it is the program that `ros2 run scenario_execution_ros scenario_execution_ros`
# would start, without the second that the ros2 command takes to find it, and to forward signals.
find_executor() {
    local prefix IFS=:
    for prefix in $AMENT_PREFIX_PATH; do
        executor=$prefix/lib/scenario_execution_ros/scenario_execution_ros
        [[ -x $executor ]] && return
    done
    executor=$(type -P scenario_execution) || fail 69 "the image has no scenario-execution:" \
        "neither the ROS package scenario_execution_ros in /opt/ros/\$ROS_DISTRO or /ws/install," \
        "nor the command scenario_execution on PATH $PATH"
}

# Sets command.
scenario_command() {
    local post extra
    command=("$executor" -o "$SCENARIO_OUTPUT_DIR" "$config/$SCENARIO_FILE")
    if [[ $POST_COMMAND ]]; then
        post=$(command_path "$POST_COMMAND")
        [[ -f $post && -x $post ]] || fail 70 "the post command $post is not an executable file"
        command+=(--post-run "$post")
    fi
    [[ $SCENARIO_PARAMETER_FILE ]] &&
        command+=(--scenario-parameter-file "$config/$SCENARIO_PARAMETER_FILE")
    [[ $SIMULATION ]] && command+=(--simulation "$SIMULATION")
    if [[ $OUTPUT_RESULT_PER_SCENARIO == true ]]; then
        command+=(--output-result-per-scenario)
        use_driver
    fi
    read -ra extra <<<"$SCENARIO_EXECUTION_PARAMETERS"
    command=(stdbuf -oL -eL "${command[@]}" "${extra[@]}")
}

# scenario-execution writes verdicts only when the last scenario has ended; the driver writes each
# at once. It runs inside the interpreter of the executor, which its first line names.
use_driver() {
    local line interpreter
    { read -r line && read -r interpreter; } <"$executor"
    case $line in
    '#!'*python*) read -ra interpreter <<<"${line#\#!}" ;;
    *) interpreter=("${executor%/*}/python3") ;; # a long path makes the first line #!/bin/sh
    esac
    if type -P "${interpreter[0]}" >/dev/null; then
        command=("${interpreter[@]}" "$contract/run_scenarios.py" "${command[@]}")
    else
        say "warning: $executor is no Python program; verdicts appear when the whole pack has ended"
    fi
}

wants_x11() { [[ ${ENABLE_X11:-true} != [Ff]alse ]]; }

start_x() {
    local number=${DISPLAY##*:} ready
    wants_x11 && ! [[ -S /tmp/.X11-unix/X${number%%.*} ]] || return 0
    # shellcheck disable=SC2086  # no DISPLAY means no argument: Xvfb then takes a free number
    exec {ready}< <(exec Xvfb $DISPLAY -displayfd 1 -screen 0 1920x1080x24 -nolisten tcp 2>"$logs/xvfb.log")
    read -rt 30 number <&"$ready" || fail 69 "Xvfb did not start, see $logs/xvfb.log"
    export DISPLAY=:$number
    exec {ready}<&-
}

# Without a container, only the descendants of this script belong to the job.
start_monitor() { # NAME
    local root=()
    [[ $config == /config ]] || root=(--root-pid $$)
    python3 -I -S "$contract/monitor_resources.py" "$OUTPUT_DIR/resource_usage_$1.csv" "${root[@]}" &
    monitor=$!
}

source_pre_command() {
    [[ $PRE_COMMAND ]] || return 0
    local pre code
    pre=$(command_path "$PRE_COMMAND")
    [[ -f $pre ]] || fail 70 "the pre command $pre does not exist"
    in_pre_command=1 # tells an `exit` of its own from ours
    # shellcheck disable=SC1090
    source "$pre"
    code=$?
    in_pre_command=
    set +eu
    ((code == 0)) || fail 70 "the pre command $pre failed with code $code"
}

# An asynchronous command ignores SIGINT, the one signal on which every ros2 bag closes its file.
record_rosout() {
    [[ $executor == */scenario_execution_ros ]] || return 0
    env --default-signal=INT ros2 bag record -s mcap -o "$logs/rosout_bag" /rosout \
        >"$logs/rosout_bag.log" 2>&1 &
    recorder=$!
}

# Runs a command, hands it the request to stop, and returns its code.
supervise() { # COMMAND...
    local child code signalled=
    "$@" 9>&- &
    child=$!
    trap 'signalled=1; kill -TERM "$child" 2>/dev/null' TERM INT
    while wait "$child"; code=$?; [[ $signalled ]]; do signalled=; done
    return "$code"
}

# Also what a pre command left in the background.
stop_descendants() { # PID
    local child children
    read -ra children <"/proc/$1/task/$1/children"
    for child in "${children[@]}"; do
        stop_descendants "$child"
        kill "$child"
    done
} 2>/dev/null

end_job() { # CODE
    local code=$1
    set +eu # a pre command that ended the shell may have left them on
    if [[ $recorder ]]; then
        kill -INT "$recorder"
        wait "$recorder"
    fi
    wait "$sysinfo"
    stop_descendants "$BASHPID"
    wait "$monitor"
    [[ ! $in_pre_command ]] || ((code > 128)) || fail 70 "the pre command left the shell with $code"
    exit "$code"
}

job() {
    python3 -I -S "$contract/collect_sysinfo.py" "$OUTPUT_DIR/sysinfo.yaml" &
    sysinfo=$!
    trap 'end_job $?' EXIT
    start_x
    start_monitor main
    source_pre_command
    record_rosout
    supervise "${command[@]}"
}

main() {
    log_to "$logs/system.log"
    check_tools
    check_output "$out" "$SCENARIO_OUTPUT_DIR"
    hold_lock
    match_user_to_uid
    source_ros
    find_executor
    scenario_command
    export PYTHONUNBUFFERED=1 # what a program said before it was killed is in the log
    say "job $OUTPUT_DIR: ${command[*]@Q}"
    supervise job
    local code=$?
    say "ended with code $code"
    exit "$code"
}

[[ ${BASH_SOURCE[0]} != "$0" ]] || main
